"""A pit under load: how many matches at once, beside bare Zenoh with the same messages, and what each costs.

For each number of matches: turns a second of seats that answer at once; then the seats answer after a while, as under a clock,
and orders that come too late are counted. The seats are held by one light process, over one session.
"""

import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from arena.errors import ArenaError, InputError
from arena.game.ruleset import load
from arena.game.types import Team
from arena.jit import cache_root
from arena.network.address import free_port
from arena.network.session import open_router, read_key, read_payload
from arena.protocol import topics
from benchmarks.measuring.many_seats import PIT, ManySeats
from benchmarks.measuring.processor_time import children_of, spent_by

MATCHES = "1,8,64"
TURN_TIME_S = 1.0
RUN_S = 3.0
_WARM_S = 1.0
_RUNS = 3
_START_S = 120.0
_READY_S = 1.0
_FIRST = 8
"""Matches that a pit has when its memory is read first: the others' is what it grows by."""
_PAUSE = (0.7, 0.9)
"""Of a turn's time, after which a seat under a clock answers."""
_OBSERVATION, _ORDERS = 28 + 576, 28 + 64
"""Bytes of a sealed observation under ruleset paper, and of sealed orders."""
_SETTINGS = ("--set", "tick_limit=1000000")


class Cost(NamedTuple):
    """What the processes of a pit have."""

    resident_kb: float
    n_files: int
    """In the one that has most."""
    n_threads: int
    processor_s: float


def run(
    progress: Callable[[str], None], matches: str = MATCHES, workers: int = 1, turn_time: float = TURN_TIME_S
) -> dict[str, Any]:
    """Matches at once in one pit: turns a second beside bare Zenoh, the pit's part of a turn, late orders, what each costs."""
    results: dict[str, Any] = {"workers": workers, "cores": len(os.sched_getaffinity(0)), "turn_time_s": turn_time}
    for n_matches in read_numbers(matches):
        runs: list[tuple[dict[str, float], dict[str, float]]] = []
        for number in range(1 if n_matches > 256 else _RUNS):
            progress(f"{n_matches} matches, run {number + 1}, as fast as can be")
            runs.append((_measure_pit(n_matches, workers), _measure_bare(n_matches)))
        progress(f"{n_matches} matches, turns of {turn_time:g} s")
        results[f"matches_{n_matches}"] = {
            "as_fast_as_can_be": _summarise(runs),
            "under_a_clock": _measure_pit(n_matches, workers, turn_time),
        }
    return results


def read_numbers(text: str) -> list[int]:
    """Return the numbers of matches in a text such as 1,8,64; `InputError` if there is none, or one that cannot be."""
    words = text.split(",")
    if not all(word.strip().isascii() and word.strip().isdecimal() and 0 < int(word) <= 10_000 for word in words):
        raise InputError(f"--matches is {text!r}; it must be numbers of matches from 1 to 10000, as in 1,8,64")
    return [int(word) for word in words]


def _summarise(runs: list[tuple[dict[str, float], dict[str, float]]]) -> dict[str, Any]:
    ours: dict[str, Any] = {name: round(median(one[name] for one, _ in runs), 3) for name in runs[0][0]}
    bare = {name: round(median(one[name] for _, one in runs), 3) for name in runs[0][1]}
    ratio = median(one["turns_per_s"] / other["turns_per_s"] for one, other in runs)
    return {**ours, "bare_zenoh": bare, "ratio": round(ratio, 3)}


def _measure_pit(n_matches: int, workers: int, turn_time: float | None = None) -> dict[str, float]:
    """Return what was seen of a pit: seats answer at once, or under a clock of `turn_time`, without any extra time."""
    ruleset = load("paper").with_({"tick_limit": 1_000_000})
    pause_s = (0.0, 0.0) if turn_time is None else (_PAUSE[0] * turn_time, _PAUSE[1] * turn_time)
    with _pit(workers, turn_time) as (endpoint, process, metrics):
        seats = ManySeats(endpoint, pause_s)
        try:
            n_first = 0 if turn_time is None else min(n_matches, _FIRST)
            if n_first:
                seats.join(2 * n_first, ruleset)
                _warm(seats, _WARM_S)
            first = _cost(process)
            seats.join(2 * (n_matches - n_first), ruleset)
            _warm(seats, _WARM_S if turn_time is None else 2 * turn_time)
            before, late_before = _cost(process), _count_late(metrics)
            seen = seats.play(RUN_S if turn_time is None else max(RUN_S, 10 * turn_time))
            after = _cost(process)
        finally:
            seats.close()
        n_late = _count_late(metrics) - late_before
    costs: dict[str, float] = {"files": after.n_files, "threads": after.n_threads}
    if n_matches > n_first > 0:
        costs["kb_a_match"] = round((after.resident_kb - first.resident_kb) / (n_matches - n_first))
    return {
        **_describe(seen.n_turns, seen.took_s, seen.own_parts_s),
        "us_a_turn": round((after.processor_s - before.processor_s) / max(seen.n_turns, 1) * 1e6, 1),
        "late": n_late,
        "late_by_the_load": seen.n_late,
        **costs,
    }


def _describe(n_turns: int, took_s: float, parts_s: list[float]) -> dict[str, float]:
    ordered = sorted(parts_s) or [0.0]
    return {
        "turns_per_s": round(n_turns / took_s, 1),
        "p50_ms": round(ordered[len(ordered) // 2] * 1e3, 3),
        "p99_ms": round(ordered[int(len(ordered) * 0.99)] * 1e3, 3),
    }


def _warm(seats: ManySeats, seconds: float) -> None:
    end_s = time.monotonic() + _START_S
    while not seats.get_ready():
        if time.monotonic() > end_s:
            raise ArenaError(f"the benchmark's matches did not all begin within {_START_S:.0f} s")
        seats.play(_READY_S)
    seats.play(seconds)


@contextmanager
def _pit(workers: int, turn_time: float | None) -> Iterator[tuple[str, int, str]]:
    """Open a pit, and yield where it is, its process, and where it tells its metrics."""
    endpoint, listen = f"tcp/127.0.0.1:{free_port()}", f"127.0.0.1:{free_port()}"
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-P", "-c", "from tournaments.cli import main; main()", "serve", "--listen", endpoint, "--pit", PIT,
            "--data", folder, "--workers", str(workers), "--metrics", listen, "--missed", "1000000", "--grace", "600", *_SETTINGS,
            *(("--turn-time", "600") if turn_time is None else ("--turn-time", str(turn_time), "--bank", "0")),
            "--most-matches", "10000",
        ]  # fmt: skip
        with (Path(folder) / "log").open("wb") as log:
            environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache_root())}
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment)
        try:
            end_s = time.monotonic() + _START_S
            while "join with" not in (said := (Path(folder) / "log").read_text()):
                if process.poll() is not None or time.monotonic() > end_s:
                    raise ArenaError(f"the benchmark's pit did not open: {said.strip()}")
                time.sleep(0.05)
            yield endpoint, process.pid, f"http://{listen}/metrics"
        finally:
            process.kill()
            process.wait()


def _cost(process: int) -> Cost:
    family = [process, *children_of(process)]
    resident = sum(int(Path(f"/proc/{one}/statm").read_text().split()[1]) for one in family) * os.sysconf("SC_PAGE_SIZE") / 1e3
    n_files = max(len(os.listdir(f"/proc/{one}/fd")) for one in family)  # noqa: PTH208  # a third of the time of pathlib's
    n_threads = max(len(os.listdir(f"/proc/{one}/task")) for one in family)  # noqa: PTH208
    return Cost(resident, n_files, n_threads, spent_by(family).total_s)


def _count_late(url: str) -> int:
    with urllib.request.urlopen(url, timeout=30) as answer:
        lines = answer.read().decode().splitlines()
    return sum(int(float(line.split()[-1])) for line in lines if line.startswith("arena_faults_total{") and '"late"' in line)


# Bare Zenoh: a router that waits for both messages of a lane, and puts two


def _measure_bare(n_matches: int) -> dict[str, float]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    spawn = multiprocessing.get_context("spawn")
    ours, theirs = spawn.Pipe()
    process = spawn.Process(target=_echo, args=(endpoint, n_matches, theirs), daemon=True)
    process.start()
    try:
        ours.recv()
        seats = ManySeats(endpoint)
        try:
            for lane in range(n_matches):
                for team in Team:
                    seats.add(lane, team, _bare_orders)
            time.sleep(0.2)
            ours.send("begin")
            _warm(seats, _WARM_S)
            seen = seats.play(RUN_S)
        finally:
            seats.close()
    finally:
        process.kill()
        process.join()
    return _describe(seen.n_turns, seen.took_s, seen.own_parts_s)


def _bare_orders(tick: int) -> bytes:
    return bytes(8) + tick.to_bytes(4, "big") + bytes(_ORDERS - 12)


def _echo(endpoint: str, n_lanes: int, pipe: Connection) -> None:
    """Do no more than a pit must with the messages of its seats."""
    with open_router(endpoint, PIT) as session:
        heard = session.collect(topics.all_actions(PIT), 100_000)
        puts = {lane: [session.publisher(topics.observation(PIT, lane, team))[0] for team in Team] for lane in range(n_lanes)}
        ticks, n_heard = dict.fromkeys(puts, 0), dict.fromkeys(puts, 0)
        pipe.send(None)
        pipe.recv()

        def ask(lane: int) -> None:
            payload = bytes(8) + ticks[lane].to_bytes(4, "big") + bytes(_OBSERVATION - 12)
            for put in puts[lane]:
                put(payload)

        for lane in puts:
            ask(lane)
        while True:
            sample = heard.wait()
            lane, _ = topics.read_action(read_key(sample))
            if int.from_bytes(read_payload(sample)[8:12], "big") == ticks[lane]:
                n_heard[lane] += 1
                if n_heard[lane] == len(Team):
                    n_heard[lane] = 0
                    ticks[lane] += 1
                    ask(lane)
