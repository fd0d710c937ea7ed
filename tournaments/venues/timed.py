"""Matches against the clock, without a network: the pit's own match and its clients' own seats, joined in this process.

Time is charged, turns are late and matches are forfeited as in a pit, since the same code rules. One match is played at a time,
so that nobody is late by this machine's making.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import Event

from arena.game.ruleset import Ruleset, rules_values
from arena.game.types import Team
from arena.local.saving import make_journals_folder, save
from arena.local.venue import MatchRecord, OnNews, announce
from arena.match.effects import Ask, Effect, End, Write
from arena.match.match import Match, Phase
from arena.match.time_control import TimeControl
from arena.policy import BatchFactory, Faults
from arena.protocol.messages import UNKNOWN_US, Ended, Message, Orders, Ready, Ticket, Turn
from arena.records.journal import Header
from arena.records.plan import MatchPlan, network_name
from clients.seat import Seat
from policies.workers.policy import LOAD_S, WorkerFactory

_LOOK_S = 0.01
"""Between two looks at the clock."""
LATE, SLOW = "late turns", "turns that the bank paid for"
"""Kinds of `Faults.reasons`."""


def play(
    ruleset: Ruleset,
    plans: Sequence[MatchPlan],
    fighters: Mapping[str, BatchFactory],
    time_control: TimeControl,
    *,
    journals: Path | None = None,
    on_news: OnNews | None = None,
) -> Iterator[MatchRecord]:
    """Play matches one after the other, and yield each as it ends.

    Parameters
    ----------
    fighters
        By name. One in processes of its own is waited for as long as the clock allows; another thinks in this thread, and what it
        takes is known once it has answered.
    on_news
        Called as soon as a match ends.
    """
    records = _play(ruleset, plans, fighters, time_control)
    if on_news is not None:
        records = announce(records, on_news)
    if journals is None:
        return records
    make_journals_folder(journals)
    return save(records, journals)


def _play(
    ruleset: Ruleset, plans: Sequence[MatchPlan], fighters: Mapping[str, BatchFactory], time_control: TimeControl
) -> Iterator[MatchRecord]:
    woken = Event()
    apart = [make for make in fighters.values() if isinstance(make, WorkerFactory)]
    for make in apart:
        make.wake = woken.set
    for plan in plans:
        match = _TimedMatch(ruleset, plan, fighters, time_control)
        try:
            while match.is_running:
                if woken.wait(_LOOK_S):
                    woken.clear()
                    match.hear()
                match.advance()
        except KeyboardInterrupt as error:
            for make in apart:
                make.explain(error)
            raise
        yield match.record()


@dataclass(slots=True, kw_only=True)
class _Side:
    """A seat, and how long its turns took."""

    seat: Seat
    is_apart: bool
    """Whether its fighter thinks in a process of its own."""
    bank_s: float
    asked_s: list[float] = field(default_factory=list)
    """When the match asked, tick by tick."""
    answered_s: list[float] = field(default_factory=list)
    """When the fighter had its answer, in time or not."""
    late: list[tuple[int, float]] = field(default_factory=list)
    """Ticks that were ruled late, and what the bank had for them."""
    slow: list[tuple[int, float]] = field(default_factory=list)
    """Ticks that the bank paid for, and what it had."""

    def describe(self, tick: int, bank_s: float, turn_time_s: float, now_s: float) -> str:
        """Return how long a turn took that took too long: from when it was asked, as it is charged."""
        is_answered = tick < len(self.answered_s)
        took_s = (self.answered_s[tick] if is_answered else now_s) - self.asked_s[tick]
        bank = f" and {bank_s:.2f} s in the bank" if bank_s > 0 else ""
        return f"tick {tick}: {'' if is_answered else 'no answer in '}{took_s:.2f} s, of {turn_time_s:g} s allowed{bank}"


class _TimedMatch:
    """A match and its two seats."""

    def __init__(
        self, ruleset: Ruleset, plan: MatchPlan, fighters: Mapping[str, BatchFactory], time_control: TimeControl
    ) -> None:
        self._plan, self._turn_time_s = plan, time_control.turn_time_s or 0.0
        header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=ruleset, keys=plan.keys)
        patient = replace(time_control, grace_s=time_control.grace_s + LOAD_S)  # a process has yet to load its fighter
        self._match = Match(header, patient, time.monotonic())
        self._journal = [self._match.start_record]
        self._asks: deque[Ask] = deque()
        self._sides: dict[Team, _Side] = {}
        names = {Team.BLUE: plan.blue, Team.RED: plan.red}
        for team, name in names.items():
            ticket = Ticket(
                match=network_name(plan.identity, b"", b""),
                lane=0,
                team=int(team),
                ruleset=rules_values(ruleset),
                opponent=names[team.other],
                turn_time_s=time_control.turn_time_s,
                bank_s=time_control.bank_s,
                tick=0,
                secret=b"",
                commitment=b"",
            )
            self._sides[team] = _Side(
                seat=Seat(ticket, b"", fighters[name], match=plan.identity),
                is_apart=isinstance(fighters[name], WorkerFactory),
                bank_s=time_control.bank_s,
            )
        for team in Team:
            self._turn_to(team, Seat.listen)
        self._ask()

    @property
    def is_running(self) -> bool:
        """Whether it is not over."""
        return self._match.phase is not Phase.OVER

    def hear(self) -> None:
        """Take what fighters have answered in their processes."""
        for team in Team:
            self._turn_to(team, Seat.think)
        self._ask()

    def advance(self) -> None:
        """Look at the clock."""
        self._carry_out(self._match.advance(time.monotonic()))
        self._ask()

    def record(self) -> MatchRecord:
        """Return what was played, once it is over."""
        match = self._match
        if match.result is None:
            raise ValueError("the match is not over")
        return MatchRecord(
            plan=self._plan,
            result=match.result,
            faults=(self._faults(Team.BLUE), self._faults(Team.RED)),
            n_unreadable=(match.record(Team.BLUE).unreadable, match.record(Team.RED).unreadable),
            journal=b"".join(self._journal),
        )

    def _ask(self) -> None:
        """Ask the seats that the match wants asked. Those who think apart are asked first, so that they wait for nobody."""
        while self._asks:
            asks = sorted(self._asks, key=lambda ask: not self._sides[ask.team].is_apart)
            self._asks.clear()
            for ask in asks:
                self._turn_to(ask.team, partial(_show, ask))

    def _turn_to(self, team: Team, speak: Callable[[Seat], list[Message]]) -> None:
        """Tell a seat something, and take to the match what it says."""
        side, match = self._sides[team], self._match
        began_s = time.monotonic()
        said = speak(side.seat)
        now_s = time.monotonic()
        side.answered_s += [now_s] * (side.seat.known_ticks - len(side.answered_s))
        for message in said:
            if type(message) is Orders:
                # Who thinks in this thread may have waited for the other to do so.
                arrived_s = now_s if side.is_apart else side.asked_s[message.tick] + now_s - began_s
                self._carry_out(match.submit(team, message.tick, message.actions, now_s, arrived_s))
            elif type(message) is Ready:
                self._carry_out(match.ready(team, now_s))

    def _carry_out(self, effects: list[Effect]) -> None:
        for effect in effects:
            if type(effect) is Write:
                self._journal.append(effect.data)
            elif type(effect) is Ask:
                self._note_time(effect)
                self._asks.append(effect)
            elif type(effect) is End:
                self._end(effect)

    def _note_time(self, ask: Ask) -> None:
        """Note what the turn before was charged."""
        side = self._sides[ask.team]
        side.asked_s.append(time.monotonic())
        over_s = 0.0 if ask.charged_us == UNKNOWN_US else ask.charged_us / 1e6 - self._turn_time_s
        if not self._note_late(ask.team) and over_s > 0.0:
            side.slow.append((ask.tick - 1, side.bank_s))
            side.bank_s = max(side.bank_s - over_s, 0.0)

    def _note_late(self, team: Team) -> bool:
        """Note whether the turn before was late."""
        side = self._sides[team]
        if self._match.record(team).late == len(side.late):
            return False
        side.late.append((self._match.tick - 1, side.bank_s))
        side.bank_s = 0.0
        return True

    def _end(self, end: End) -> None:
        for team in Team:
            self._note_late(team)
        counted = {team.name.lower(): self._match.record(team).faults() for team in Team}
        ended = Ended(match="", **end.result.to_dict(), faults=counted)
        for side in self._sides.values():
            side.seat.receive(ended)

    def _faults(self, team: Team) -> Faults:
        """Return what went wrong on a seat, its late turns among it."""
        side, now_s = self._sides[team], time.monotonic()
        faults = side.seat.faults()
        for kind, ticks, then in ((LATE, side.late, "all its units stay"), (SLOW, side.slow, "the bank pays")):
            if ticks:
                faults.note(kind, f"{side.describe(*ticks[0], self._turn_time_s, now_s)}; {then}", len(ticks))
        return faults


def _show(ask: Ask, seat: Seat) -> list[Message]:
    return seat.receive(Turn(tick=ask.tick, observation=ask.observation, charged_us=ask.charged_us))
