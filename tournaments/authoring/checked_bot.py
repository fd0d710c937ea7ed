"""What a check finds of a bot, from the matches that it plays.

One process plays all matches, so that what it keeps of each is seen to grow. Two are played again in fresh processes, from the
same keys, and the orders have to be the same.
"""

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import median

from arena.console import clean
from arena.errors import PolicyError
from arena.files import MOST_TEXT_BYTES, read_file
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.match.seat_clock import SeatClock
from arena.match.time_control import TimeControl
from arena.policy import BatchFactory, Faults
from arena.sandbox.limits import Limits
from policies.bot_file import NO_BOT
from policies.program import PREFIX as PROGRAM
from policies.workers.files import resolve
from policies.workers.policy import WorkerFactory
from tournaments.authoring.findings import AllTurnTimes, Finding, Report
from tournaments.authoring.global_randomness import find_global_randomness
from tournaments.authoring.turn_times import TurnTimes
from tournaments.running.preflight import PATIENCE_S
from tournaments.running.trial import Trial

N_REPLAYS = 2
"""Matches that are played again."""
_LEAK_BYTES = 2e6
"""A match; what Python grows by itself is far less, and what a Java machine does is less."""
_MOST_CALLS_SHOWN = 3
_MOST_LETTERS = 200


@dataclass(slots=True, kw_only=True)
class CheckedMatch:
    """One match of a check."""

    number: int
    opponent: str
    team: Team
    orders: list[tuple[int, ...]] = field(default_factory=list)
    took_s: list[float] = field(default_factory=list)
    has_answered: bool = False
    """Whether there was a turn in which nothing was wrong with its orders."""
    ending: str = ""
    points: float | None = None
    is_broken: bool = False
    """Whether the process failed in it."""

    def __str__(self) -> str:
        return f"match {self.number}, {self.team.name.lower()} against {self.opponent}"

    def keys(self) -> MatchKeys:
        secret = secret_from_seed(0)
        return MatchKeys(
            map_key=derive_map_key(secret, f"check/{self.opponent}", 0),
            match_key=derive_match_key(secret, f"check/{self.number}"),
        )


class CheckedBot:
    """What is found of a bot, match by match."""

    def __init__(
        self,
        spec: str,
        ruleset: Ruleset,
        time_control: TimeControl,
        limits: Limits,
        *,
        has_wall: bool,
        opponents: Sequence[str],
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._spec, self._ruleset, self._clock, self._opponents = spec, ruleset, time_control, opponents
        self._limits, self._has_wall, self._load_patience_s = limits, has_wall, patience_s
        self._patience_s = PATIENCE_S if time_control.turn_time_s is None else time_control.turn_time_s + time_control.bank_s
        _, self._files = resolve(spec)
        self._findings: dict[str, Finding] = {}
        self._matches: list[CheckedMatch] = []
        self._memory: list[int] = []
        self._output = bytearray()

    def make(self, *, is_shared: bool) -> WorkerFactory:
        """Return what starts processes of the bot: one for all matches, whose output is judged, or one for each."""
        return WorkerFactory(
            self._spec, has_wall=self._has_wall, limits=self._limits, patience_s=self._patience_s, is_shared=is_shared,
            on_output=self._output.extend if is_shared else lambda _: None,
        )  # fmt: skip

    def load(self, factory: WorkerFactory) -> float | None:
        """Start a process, and return after how many seconds it was ready; None if it never was."""
        begun_s = time.monotonic()
        try:
            factory.prepare(self._load_patience_s)
        except PolicyError as error:
            if NO_BOT in str(error):
                raise PolicyError(str(error).partition(" cannot start: ")[2] or str(error)) from error
            why = str(error).partition(" cannot start: ")[2] or str(error)
            self._find("load", f"it cannot start: {why}{self._hint(why)}", is_fatal=True)
            return None
        return time.monotonic() - begun_s

    def play_all(
        self, factory: WorkerFactory, opponents: Sequence[BatchFactory], most_s: float, advance: Callable[[int], None]
    ) -> None:
        """Play every opponent on both sides, and two matches again."""
        until_s, n_left = time.monotonic() + most_s, len(Team) * len(opponents) + N_REPLAYS
        for name, opponent in zip(self._opponents, opponents, strict=True):
            for team in Team:
                match = CheckedMatch(number=len(self._matches) + 1, opponent=name, team=team)
                self._matches.append(match)
                self._play(match, factory, opponent, (until_s - time.monotonic()) / n_left)
                if any(finding.is_fatal for finding in self._findings.values()):
                    return
                held = factory.memory_bytes()
                self._memory += [] if held is None else [held]
                n_left -= 1
                advance(1)
        for match, opponent in ((self._matches[0], opponents[0]), (self._matches[-1], opponents[-1])):
            self._play_again(match, opponent, (until_s - time.monotonic()) / n_left)
            n_left -= 1
            advance(1)

    def _play(self, match: CheckedMatch, factory: BatchFactory, opponent: BatchFactory, most_s: float) -> None:
        trial = Trial(factory, self._ruleset, match.team, match.keys(), opponent, str(match.number))
        faults = trial.start()
        if faults.raised:
            why = next((sentence for sentence, _ in faults.reasons.values()), "it failed, and says nothing of it")
            why = why.partition("; all its units")[0]
            self._find("start", f"it fails when a match starts: {why}{self._hint(why)}", is_fatal=True)
            return
        clock, n_missed = SeatClock(self._clock, 0.0), 0
        clock.go_on(0.0)
        until_s = time.monotonic() + most_s
        while not trial.is_over and (not match.took_s or time.monotonic() < until_s):
            turn = trial.play_turn()
            match.took_s.append(turn.took_s)
            match.orders.append(turn.orders)
            match.has_answered |= not turn.faults.reasons
            self._judge(match, turn.tick, turn.faults)
            if match.is_broken:
                return
            n_missed = n_missed + 1 if clock.is_late(turn.took_s) else 0
            clock.begin_turn(0.0)
            if n_missed:
                clock.charge_all()
            else:
                clock.charge(turn.took_s)
            if self._clock.turn_time_s is not None and turn.took_s > self._clock.turn_time_s:
                self._find(
                    "time",
                    f"tick {turn.tick} of {match}: a turn of {turn.took_s:.2f} s, and {self._clock.turn_time_s:g} s are given",
                )
            if n_missed >= self._clock.most_missed:
                self._find("forfeit", f"tick {turn.tick} of {match}: {n_missed} turns missed in a row forfeit it", is_fatal=True)
                return
        self._judge(match, trial.result.ticks, trial.end())
        match.ending = (
            trial.result.seen_by(match.team).describe(match.team)
            if trial.is_over
            else f"cut short after {trial.result.ticks} ticks"
        )
        match.points = trial.result.points(match.team) if trial.is_over else None

    def _judge(self, match: CheckedMatch, tick: int, faults: Faults) -> None:
        """Take down why units stayed."""
        for kind, (sentence, count) in faults.reasons.items():
            if kind == "process":
                match.is_broken = True
                self._find(kind, self._how_it_failed(match, tick, sentence), is_fatal=True)
                continue
            _, _, why = sentence.rpartition(f"tick {tick}: ")
            line = self._line_of(faults.first_traceback, why)
            self._find(f"orders {kind}", f"tick {tick} of {match}: {why}{line}{self._hint(why)}", count)

    def _hint(self, why: str) -> str:
        """Return what a bot's author may not know who reads that something is missing."""
        is_missing = self._has_wall and ("FileNotFoundError" in why or "ModuleNotFoundError" in why)
        return "; behind its wall a bot sees its own file and what is installed with the arena" if is_missing else ""

    def _how_it_failed(self, match: CheckedMatch, tick: int, sentence: str) -> str:
        why = sentence.partition(": ")[2].partition("; all its units")[0]
        if why.startswith("it did not answer") and self._clock.turn_time_s is not None:
            where = why.partition("; ")[2].partition(": ")[2]
            more = f" or the {self._clock.bank_s:g} s of extra time" if self._clock.bank_s else ""
            why = f"no answer within {self._clock.turn_time_s:g} s{more}" + (f"; it stood at {where}" if where else "")
        return f"tick {tick} of {match}: {why}"

    def _line_of(self, traceback: str | None, sentence: str) -> str:
        """Return the line of the bot's own file that led to an exception, unless the sentence names it."""
        if traceback is None or not self._files or re.search(rf"\({re.escape(self._files[0].name)}, line \d+\)", sentence):
            return ""
        lines = re.findall(rf'File "{re.escape(str(self._files[0]))}", line (\d+)', traceback)
        return f"; called in {self._files[0].name}, line {lines[-1]}" if lines else ""

    def _play_again(self, match: CheckedMatch, opponent: BatchFactory, most_s: float) -> None:
        """Play a match from the same keys in a fresh process, and compare the orders."""
        factory = self.make(is_shared=False)
        try:
            factory.prepare(self._load_patience_s)
            trial = Trial(factory, self._ruleset, match.team, match.keys(), opponent, str(match.number))
            trial.start()
            until_s = time.monotonic() + most_s
            for tick, before in enumerate(match.orders):
                if trial.is_over or (tick and time.monotonic() > until_s):
                    break
                if trial.play_turn().orders != before:
                    earlier = "" if match.number == 1 else ", when no other match came before it in its process"
                    self._find("chance", f"tick {tick} of {match}: other orders the second time, from the same keys{earlier}")
                    break
        finally:
            factory.close()

    def _find(self, kind: str, sentence: str, count: int = 1, *, is_fatal: bool = False) -> None:
        """Keep what is found first of a kind, and count the others."""
        before = self._findings.get(kind)
        found = Finding(kind=kind.partition(" ")[0], sentence=sentence, count=count, is_fatal=is_fatal)
        self._findings[kind] = found if before is None else replace(before, count=before.count + count)

    def report(self, load_s: float | None, no_wall: str | None) -> Report:
        """Return what was found."""
        times = self._times()
        turn_time_s = self._clock.turn_time_s
        if times is not None and not any(finding.is_fatal for finding in self._findings.values()):
            if not any(match.has_answered for match in self._matches):
                self._find("silent", f"it gave orders in none of its {times.n_turns:,} turns", is_fatal=True)
            elif turn_time_s is not None and times.median_ms > 1000 * turn_time_s:
                slow = f"its turns take {times.median_ms / 1000:.2f} s in the median, and {turn_time_s:g} s are given"
                self._find("slow", f"{slow}: its extra time would run out, and its matches be forfeited", is_fatal=True)
        growth = [after - before for before, after in zip(self._memory[1:], self._memory[2:], strict=False)]
        growth_bytes = round(median(growth)) if growth else None
        if growth_bytes is not None and growth_bytes > _LEAK_BYTES:
            self._find("memory", f"a process that plays match after match grows by {growth_bytes / 1e6:.1f} MB a match")
        self._find_output()
        self._find_global_randomness()
        played = [match for match in self._matches if match.points is not None]
        return Report(
            bot=clean(self._spec),
            rules=self._ruleset.name,
            opponents=tuple(self._opponents),
            no_wall=no_wall,
            size_bytes=sum(file.stat().st_size for file in self._files if file.is_file()) if self._files else None,
            load_s=load_s,
            matches=tuple(f"{match}: {match.ending}" for match in self._matches),
            wins=sum(match.points == 1.0 for match in played),
            draws=sum(match.points == 0.5 for match in played),
            losses=sum(match.points == 0.0 for match in played),
            times=times,
            memory_bytes=self._memory[-1] if self._memory else None,
            growth_bytes=growth_bytes,
            findings=tuple(self._findings.values()),
        )

    def _times(self) -> AllTurnTimes | None:
        turns = [(took_s, f"tick {tick} of {match}") for match in self._matches for tick, took_s in enumerate(match.took_s)]
        if not turns:
            return None
        times = TurnTimes.of([took_s for took_s, _ in turns])
        return AllTurnTimes(**asdict(times), n_turns=len(turns), worst_at=max(turns)[1])

    def _find_output(self) -> None:
        """Judge what it printed: of a program, stderr is its own, and lines on stdout that are no answers are noted there."""
        lines = [line for line in bytes(self._output).decode("utf-8", "replace").splitlines() if line.strip()]
        if self._spec.startswith(PROGRAM):
            for number, line in enumerate(line for line in lines if "not JSON" in line):
                self._find(f"output {number}", clean(line)[:_MOST_LETTERS])
            if lines and any(finding.is_fatal for finding in self._findings.values()):
                self._find("output", f"its last words are: {clean(lines[-1])[:_MOST_LETTERS]}")
        elif lines:
            self._find("output", f"it prints, the first time: {clean(lines[0])[:_MOST_LETTERS]}", len(lines))

    def _find_global_randomness(self) -> None:
        if not self._spec.endswith(".py"):
            return
        try:
            source = read_file(Path(self._spec), MOST_TEXT_BYTES * 16).decode("utf-8", "replace")
        except OSError:
            return  # it was there when its process loaded it
        calls = find_global_randomness(source)
        if calls:
            shown = ", ".join(f"{name} (line {line})" for line, name in calls[:_MOST_CALLS_SHOWN])
            more = f" and {len(calls) - _MOST_CALLS_SHOWN} more" if len(calls) > _MOST_CALLS_SHOWN else ""
            self._find("source", f"it draws from chance that no replay brings back: {shown}{more}; use observation.rng")
