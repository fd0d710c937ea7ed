"""The network: turns per second and the latency of a turn, with clients that always give the same orders.

With the environment variable ARENA_YARDSTICK, a folder with `zenoh_turns.py`, bare Zenoh runs by turns with ours, with the same
matches and processes: it puts as many bytes, and does nothing else. What a turn costs is told in microseconds of processor time,
too, which other work on the machine changes less than the turns in a second.
"""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from arena.errors import ArenaError
from arena.game.engine import warm
from arena.game.keys import MatchKeys
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team
from arena.match.time_control import TimeControl
from arena.network.address import free_port
from arena.network.session import open_router
from arena.pit.effects import MatchEnded
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.seating import PlannedSeating
from arena.policy import BatchPolicy, Orders
from arena.protocol.identity import Identity
from arena.protocol.sealing import Opener, Sealer
from arena.records.plan import MatchPlan
from benchmarks.measuring.processor_time import Spent, children_of, spent_by
from clients.runner import Runner
from clients.settings import ClientSettings

SIZES = ((1, 1), (8, 8), (64, 16))
"""Matches at once, and seats that a client process holds."""
RUNS = 3
RUN_S = 3.0
_START_LIMIT_S = 60.0
_NAME = "constant"
_LOOK_S = 0.25
"""Between two looks at what a yardstick has spent."""
_SEALINGS = 20_000
MESSAGE_BYTES = (500, 20)
"""Of an observation under ruleset paper, and of orders, about."""


class Constant(BatchPolicy):
    """Every unit stays: what a turn costs beside thinking."""

    def act(self, observations: Observations, orders: Orders) -> None:
        """Stay."""


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Turns per second and their latency over Zenoh, at 1, 8 and 64 matches at once; a whole match from a cold start."""
    folder = os.environ.get("ARENA_YARDSTICK")
    results: dict[str, Any] = {}
    for matches, seats in SIZES:
        pairs = []
        for number in range(RUNS):
            progress(f"{matches} matches, run {number + 1} of {RUNS}")
            ours = _measure(matches, seats)
            pairs.append((ours, _yardstick(Path(folder), matches, seats) if folder else None))
        results[f"matches_{matches}"] = _summary(pairs)
    progress("sealing")
    seconds = _time_sealing()
    turn_s = 1 / results["matches_1"]["ticks_per_s"]
    results["sealing"] = {"us_a_turn": round(seconds * 1e6, 2), "share_of_a_turn": round(seconds / turn_s, 4)}
    progress("a whole match of fresh processes")
    results["fresh_match_s"] = round(median(_time_fresh_match() for _ in range(RUNS)), 2)
    return results


def _summary(pairs: list[Any]) -> dict[str, Any]:
    """Return medians, and of the ratio pair by pair."""
    summary: dict[str, Any] = {name: round(median(ours[name] for ours, _ in pairs), 3) for name in pairs[0][0]}
    if all(bare for _, bare in pairs):
        summary["yardstick"] = {name: round(median(bare[name] for _, bare in pairs), 3) for name in pairs[0][1]}
        summary["ratio"] = round(median(ours["ticks_per_s"] / bare["ticks_per_s"] for ours, bare in pairs), 3)
    return summary


def _measure(n_matches: int, seats_per_process: int) -> dict[str, float]:
    """Run matches that do not end, and return what one window of time held."""
    ruleset = load("paper").with_({"tick_limit": 1_000_000})
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    plans = [_plan(number) for number in range(n_matches)]
    warm(ruleset)
    spawn = multiprocessing.get_context("spawn")
    n_processes = 2 * n_matches // seats_per_process
    with tempfile.TemporaryDirectory() as folder, open_router(endpoint, "bench") as session:
        context, time_control = PitContext(pit="bench", identity=Identity.make()), TimeControl(turn_time_s=60.0)
        referee = Referee(session, context, ruleset, PlannedSeating(plans), time_control, Path(folder), on_end=_object)
        clients = [spawn.Process(target=play, args=(endpoint, seats_per_process), daemon=True) for _ in range(n_processes)]
        for client in clients:
            client.start()
        try:
            _run_until(referee, lambda: referee.n_running == n_matches and min(_ticks(referee)) > 5, _START_LIMIT_S)
            end_s = time.monotonic() + 0.5
            _run_until(referee, lambda: time.monotonic() >= end_s, 10.0)
            sides = [os.getpid()], [client.pid for client in clients if client.pid is not None]
            spent_before, before, begin_s = [spent_by(side) for side in sides], _ticks(referee), time.monotonic()
            _run_until(referee, lambda: time.monotonic() >= begin_s + RUN_S, 2 * RUN_S)
            took_s, after, spent_after = time.monotonic() - begin_s, _ticks(referee), [spent_by(side) for side in sides]
            latencies = sorted(
                max(pair)
                for match, first, last in zip(referee.matches, before, after, strict=True)
                for pair in list(zip(*(match.record(team).latencies_s for team in Team), strict=False))[first:last]
            )
        finally:
            for client in clients:
                client.kill()
                client.join()
            referee.close()
    n_ticks = sum(after) - sum(before)
    pit, theirs = (later.since(sooner) for sooner, later in zip(spent_before, spent_after, strict=True))
    return {
        "ticks_per_s": n_ticks / took_s,
        "p50_ms": latencies[len(latencies) // 2] * 1e3,
        "p99_ms": latencies[int(len(latencies) * 0.99)] * 1e3,
        "us_a_turn": (pit.total_s + theirs.total_s) / n_ticks * 1e6,
        "us_of_referee": pit.own_s / n_ticks * 1e6,
        "us_of_its_zenoh": pit.zenoh_s / n_ticks * 1e6,
        "us_of_clients": theirs.own_s / n_ticks * 1e6,
        "us_of_their_zenoh": theirs.zenoh_s / n_ticks * 1e6,
    }


def _object(ended: MatchEnded) -> None:
    raise ArenaError(f"the benchmark's match {ended.header.identity} ended: {ended.result.reason}")


def _ticks(referee: Referee) -> list[int]:
    return [match.tick for match in referee.matches]


def _run_until(referee: Referee, is_reached: Callable[[], bool], limit_s: float) -> None:
    end_s = time.monotonic() + limit_s
    referee.run(lambda: is_reached() or time.monotonic() >= end_s)
    if not is_reached():
        raise ArenaError(f"the benchmark's matches did not come to play within {limit_s:.0f} s")


def _plan(number: int) -> MatchPlan:
    keys = MatchKeys(map_key=number.to_bytes(32, "big"), match_key=(number + 1000).to_bytes(32, "big"))
    return MatchPlan(identity=f"bench/{number}", blue=_NAME, red=_NAME, keys=keys)


def play(endpoint: str, n_slots: int) -> None:
    """Hold seats until killed; in a process of its own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    settings = ClientSettings(
        endpoint=endpoint, pit="bench", name=_NAME, team="any", make=_constant, n_matches=None, n_slots=n_slots
    )
    Runner(settings, on_seat=lambda _: None, on_end=lambda _: None, on_wait=lambda _: None).run()


def _constant(ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
    return Constant(ruleset, team, n_seats)


def _yardstick(folder: Path, matches: int, seats: int) -> dict[str, float]:
    """Return what bare Zenoh does."""
    command = [
        sys.executable, "-W", "ignore", str(folder / "zenoh_turns.py"), "--matches", str(matches), "--per-process", str(seats),
        "--seconds", str(RUN_S), "--endpoint", f"tcp/127.0.0.1:{free_port()}",
    ]  # fmt: skip
    looks: list[tuple[float, Spent]] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        while running.poll() is None:
            looks.append((time.monotonic(), spent_by([running.pid, *children_of(running.pid)])))
            time.sleep(_LOOK_S)
        said = "" if running.stdout is None else running.stdout.read()
    if running.returncode:
        raise ArenaError(f"the yardstick failed: exit code {running.returncode}")
    facts = json.loads(said.splitlines()[-1])
    rates = [(later[1].total_s - sooner[1].total_s) / (later[0] - sooner[0]) for sooner, later in pairwise(looks[:-1])]
    in_run = rates[-int(0.8 * RUN_S / _LOOK_S) :]  # what it measured last, without its own end
    return {
        "ticks_per_s": facts["ticks_per_s"],
        "p50_ms": facts["tick_ms"]["p50"],
        "p99_ms": facts["tick_ms"]["p99"],
        "us_a_turn": median(in_run) / facts["ticks_per_s"] * 1e6,
    }


def _time_sealing() -> float:
    """Return the seconds that it takes to seal and open the four messages of a turn: two observations, two answers."""
    observation, orders = (bytes(n_bytes) for n_bytes in MESSAGE_BYTES)
    ways = [
        (Sealer(bytes(32), context), Opener(bytes(32), context), message)
        for context, message in ((b"blue", observation), (b"red", observation), (b"blue orders", orders), (b"red orders", orders))
    ]
    begin_s = time.perf_counter()
    for tick in range(_SEALINGS):
        for sealer, opener, message in ways:
            opener.open(sealer.close(message, tick))
    return (time.perf_counter() - begin_s) / _SEALINGS


def _time_fresh_match() -> float:
    """Return the seconds from three commands, typed at once, to the last one's end."""
    with tempfile.TemporaryDirectory() as folder:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        arena = [sys.executable, "-c", "from tournaments.cli import main; main()"]
        begin_s = time.monotonic()
        commands = [
            ["serve", "--listen", endpoint, "--matches", "1", "--data", folder, "--seed", "1"],
            ["join", "--pit", endpoint, "--team", "red", "--policy", "rush"],
            ["join", "--pit", endpoint, "--team", "blue", "--policy", "patrol"],
        ]
        processes = [
            subprocess.Popen([*arena, *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for command in commands
        ]
        codes = [process.wait(60) for process in processes]
        if any(codes):
            raise ArenaError(f"a fresh match failed: exit codes {codes}")
        return time.monotonic() - begin_s
