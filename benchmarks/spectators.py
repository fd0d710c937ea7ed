"""Spectators: what a turn costs the pit's process when many watch its match, at the pit itself, through a relay, and stopped."""

import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from statistics import median
from threading import Event, Thread
from typing import Any

from arena.errors import ArenaError
from arena.game.engine import warm
from arena.game.keys import MatchKeys
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team
from arena.match.time_control import TimeControl
from arena.network.address import Address, free_port
from arena.network.session import open_client, open_router
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.seating import PlannedSeating
from arena.policy import BatchPolicy, Orders
from arena.protocol import topics
from arena.protocol.identity import Identity
from arena.records.plan import MatchPlan
from clients.relay import Relay
from clients.runner import Runner
from clients.settings import ClientSettings

COUNTS = (0, 1, 100, 1_000)
RUNS = 3
RUN_S = 3.0
_PIT, _NAME = "bench", "paced"
_THINK_S = 0.02
"""Of each seat, at each turn: so a turn's cost is that of a match that people watch, and not of a flood."""
_IN_PROCESS = 250
"""Spectators' sessions in a process."""
_LIMIT_S = 120.0
Progress = Callable[[str], None]


class Paced(BatchPolicy):
    """Every unit stays, after a while."""

    def act(self, observations: Observations, orders: Orders) -> None:
        """Wait, and stay."""
        time.sleep(_THINK_S)


def run(progress: Progress) -> dict[str, Any]:
    """What a turn costs a pit with 0, 1, 100 and 1,000 spectators of its match, directly, through a relay, and stopped."""
    return measure(progress, COUNTS)


def measure(progress: Progress, counts: Sequence[int]) -> dict[str, Any]:
    """Return the cost of a turn by how spectators come, and how many they are."""
    figures: dict[str, Any] = {}
    for way in ("at_the_pit", "through_a_relay"):
        with _Final(has_relay=way == "through_a_relay") as final:
            found = figures[way] = {}
            for count in counts:
                progress(f"{count} spectators {way.replace('_', ' ')}")
                final.gather(count)
                found[str(count)] = final.measure()
            if way == "at_the_pit":
                progress(f"{counts[-1]} spectators who are stopped")
                final.stop_spectators()
                figures["stopped"] = final.measure()
    return figures


class _Final:
    """A match that does not end, refereed by this thread, with its players and spectators in other processes."""

    def __init__(self, *, has_relay: bool) -> None:
        self._has_relay = has_relay
        self._spawn = multiprocessing.get_context("spawn")
        self._processes: list[BaseProcess] = []
        self._crowds: list[tuple[BaseProcess, Connection]] = []
        self._n_spectators = 0
        self._has_stopped = False

    def __enter__(self) -> "_Final":
        ruleset = load("paper").with_({"tick_limit": 1_000_000})
        warm(ruleset)
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        keys = MatchKeys(map_key=bytes(32), match_key=bytes(32))
        plan = MatchPlan(identity=f"{_PIT}/final", blue=_NAME, red=_NAME, keys=keys)
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            session = stack.enter_context(open_router(endpoint, _PIT))
            self._referee = Referee(
                session, PitContext(pit=_PIT, identity=Identity.make()), ruleset, PlannedSeating([plan]),
                TimeControl(turn_time_s=60.0), folder, on_end=_object,
            )  # fmt: skip
            stack.callback(self._referee.close)
            stack.callback(self._end_processes)
            for _ in Team:
                self._start(play, endpoint)
            self._endpoint = endpoint
            if self._has_relay:
                self._endpoint = f"tcp/127.0.0.1:{free_port()}"
                self._await(self._start(relay, endpoint, self._endpoint))
            self._run(lambda: self._tick > 5)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _end_processes(self) -> None:
        for process in self._processes:
            process.kill()
            process.join()

    def _start(self, target: Callable[..., None], *arguments: Any) -> Connection:
        ours, theirs = self._spawn.Pipe()
        process = self._spawn.Process(target=target, args=(theirs, *arguments), daemon=True)
        process.start()
        self._processes.append(process)
        return ours

    @property
    def _tick(self) -> int:
        return min((match.tick for match in self._referee.matches), default=0)

    def _run(self, is_reached: Callable[[], bool]) -> None:
        end_s = time.monotonic() + _LIMIT_S
        self._referee.run(lambda: is_reached() or time.monotonic() >= end_s)
        if not is_reached():
            raise ArenaError(f"the benchmark's match did not go on within {_LIMIT_S:.0f} s")

    def _await(self, pipe: Connection) -> Any:
        """Referee until somebody says something, and return it."""
        said: list[Any] = []
        has_said = Event()

        def listen() -> None:
            said.append(pipe.recv())
            has_said.set()

        Thread(target=listen, daemon=True).start()
        self._run(has_said.is_set)
        return said[0]

    def gather(self, count: int) -> None:
        """Let more spectators come, until there are so many."""
        while self._n_spectators < count:
            n_more = min(_IN_PROCESS, count - self._n_spectators)
            pipe = self._start(watch, self._endpoint, n_more)
            self._await(pipe)
            self._crowds.append((self._processes[-1], pipe))
            self._n_spectators += n_more

    def measure(self) -> dict[str, Any]:
        """Return medians of several windows of time."""
        runs = [self._measure_once() for _ in range(RUNS)]
        figures = {name: round(median(run[name] for run in runs), 3) for name in runs[0]}
        n_late = sum(match.record(team).faults()["late"] for match in self._referee.matches for team in Team)
        return {**figures, "late_turns": n_late, "heard_by": self._count_hearing()}

    def _measure_once(self) -> dict[str, float]:
        before, begin_s = self._tick, time.monotonic()
        process_s, thread_s = time.process_time(), time.thread_time()
        self._run(lambda: time.monotonic() >= begin_s + RUN_S)
        n_turns = max(self._tick - before, 1)
        process_ms, thread_ms = (1e3 * (time.process_time() - process_s), 1e3 * (time.thread_time() - thread_s))
        (match,) = self._referee.matches
        latencies_s = [max(pair) for pair in zip(*(match.record(team).latencies_s for team in Team), strict=False)][before:]
        return {
            "process_ms_a_turn": process_ms / n_turns,
            "referee_ms_a_turn": thread_ms / n_turns,
            "turns_per_s": n_turns / RUN_S,
            "slowest_turn_ms": 1e3 * max(latencies_s, default=0.0),
        }

    def _count_hearing(self) -> int:
        """Return how many spectators heard something since the last count."""
        hearing = 0
        for _, pipe in () if self._has_stopped else self._crowds:
            pipe.send(None)
            hearing += self._await(pipe)
        return hearing

    def stop_spectators(self) -> None:
        """Stop the processes of all spectators: their connections stay, and are not read."""
        self._has_stopped = True
        for process, _ in self._crowds:
            assert process.pid is not None
            os.kill(process.pid, signal.SIGSTOP)


def _object(ended: object) -> None:
    raise ArenaError(f"the benchmark's match ended: {ended}")


def play(pipe: Connection, endpoint: str) -> None:
    """Hold a seat until killed; in a process of its own."""
    settings = ClientSettings(endpoint=endpoint, pit=_PIT, name=_NAME, team="any", make=_paced, n_matches=None, n_slots=1)
    Runner(settings, on_seat=lambda _: None, on_end=lambda _: None, on_wait=lambda _: None).run()


def _paced(ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
    return Paced(ruleset, team, n_seats)


def watch(pipe: Connection, endpoint: str, count: int) -> None:
    """Watch by many sessions until killed, and say how many heard something whenever asked; in a process of its own."""
    os.nice(5)
    sessions = [open_client(endpoint) for _ in range(count)]
    heard = [session.collect(topics.all_public(_PIT), 1) for session in sessions]
    pipe.send(count)
    while True:
        pipe.recv()
        pipe.send(sum(one.take() is not None for one in heard))


def relay(pipe: Connection, pit: str, endpoint: str) -> None:
    """Relay until killed; in a process of its own."""
    with open_router(endpoint, _PIT, for_players=False) as router:
        address = Address(endpoint=pit, pit=_PIT)
        Relay(address, None, router, lambda key: None, pipe.send).run()
