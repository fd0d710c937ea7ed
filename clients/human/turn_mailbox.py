"""Where a runner lays down the turns of a person, and the person's screen takes them up: two threads meet here.

The runner is never kept waiting. A turn that the person still thinks about is a `Thinking`, and the runner asks again; at the
deadline the orders go out as they stand.
"""

import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observation, Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team
from arena.policy import BatchPolicy, MatchResult, Orders
from clients.human.commander import Commander
from clients.human.view_model import Picture
from clients.seat import Seat, Thinking
from policies.registry import load

MARGIN_S = 0.75
"""A turn ends so long before the pit would end it: the runner looks every quarter of a second, and the orders must travel."""


class Desk:
    """One person's place, for one match after the other. Every method may be called from any thread."""

    def __init__(self, autopilot: str = "", *, clock: Callable[[], float] = time.monotonic) -> None:
        self.lock = threading.RLock()
        """Held while `commander` is used."""
        self.commander: Commander | None = None
        """Of the match that runs, or ran last; None before the first."""
        self.opponent = ""
        self.match = ""
        self.result: MatchResult | None = None
        """How the last match ended; None while one runs."""
        self.waits = ""
        """What for: while no match runs, and while the pit is lost."""
        self.seen: list[Observation] = []
        """Of the match that runs, or ran last."""
        self.autopilot = autopilot
        """The fighter that moves units without orders; empty for none."""
        self.on_change: Callable[[], None] = lambda: None
        """Called when there is something new to show, from the runner's thread."""
        self.wake: Callable[[], None] = lambda: None
        """Called when a turn has ended, so that the runner need not find out by itself."""
        self._clock = clock
        self._turn_time_s: float | None = None
        self._deadline_s: float | None = None
        self._done_tick = -1
        self._pilot: BatchPolicy | None = None
        self._told: Observations | None = None

    def make(self, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        """Return the policy of a seat: the `BatchFactory` that a runner wants."""
        return _Person(ruleset, team, n_seats, self)

    def wait(self, reason: str) -> None:
        """Hear what is waited for: as a runner's `on_wait`."""
        self.waits = reason
        self.on_change()

    def meet(self, seat: Seat) -> None:
        """Hear which match begins: as a runner's `on_seat`."""
        with self.lock:
            self.opponent, self.match = seat.ticket.opponent, seat.ticket.match
            self.waits = ""
            self._turn_time_s = seat.ticket.turn_time_s
        self.on_change()

    @property
    def is_playing(self) -> bool:
        """Whether a match runs."""
        with self.lock:
            return self.commander is not None and self.result is None

    @property
    def is_my_turn(self) -> bool:
        """Whether the person may still change what happens in this tick."""
        with self.lock:
            return self.commander is not None and self.is_playing and self._done_tick < self.commander.tick

    def picture(self) -> Picture | None:
        """Return what there is to be shown; None before the first turn."""
        with self.lock:
            if self.commander is None or self.commander.tick < 0:
                return None
            return self.commander.picture(self._clock())

    def command(self, tell: Callable[[Commander], object]) -> None:
        """Tell the units something; the turn ends if that was all that there was to be said."""
        with self.lock:
            if self.commander is None:
                return
            tell(self.commander)
            is_said = self.is_my_turn and self.commander.is_complete
        if is_said:
            self.end_turn()

    def end_turn(self) -> None:
        """Let the orders go out as they stand."""
        with self.lock:
            if self.commander is not None:
                self._done_tick = self.commander.tick
        self.wake()

    def fly_by(self, autopilot: str) -> None:
        """Choose another autopilot, from this turn on; it remembers nothing of the turns before. Empty: none."""
        with self.lock:
            commander, told = self.commander, self._told
        pilot = None
        if autopilot and commander is not None:
            pilot = _start(autopilot, commander.ruleset, commander.team)
        advice = None if pilot is None or told is None else _ask(pilot, told)
        with self.lock:
            self.autopilot = autopilot
            if commander is self.commander:
                self._pilot = pilot
                if pilot is not None and self._told is not None and told is not self._told:
                    advice = _ask(pilot, self._told)  # another turn began meanwhile
                if commander is not None:
                    commander.advise(advice)

    def sit_down(self, ruleset: Ruleset, team: Team) -> None:
        """Begin a match."""
        commander = Commander(ruleset, team)
        pilot = _start(self.autopilot, ruleset, team) if self.autopilot else None
        with self.lock:
            self.commander, self._pilot, self._told = commander, pilot, None
            self.result, self._done_tick = None, -1
            self.seen = []

    def ask(self, observations: Observations) -> list[int]:
        """Return the orders of a turn, an action per unit; `Thinking` while the person has not ended it."""
        with self.lock:
            commander = self.commander
            assert commander is not None
            is_new = commander.tick != int(observations.tick[0])
            is_back, self.waits = bool(self.waits), ""  # whoever is asked is not waiting
            if is_new:
                self._show(commander, observations)
            elif is_back and self._is_late():  # a pit that asks so late began the turn anew, after it was away itself
                self._set_deadline(self.seen[-1])
                commander.extend(self._deadline_s)
            is_late = self._is_late()
            is_done = is_late or self._done_tick >= commander.tick
            if is_done:
                self._done_tick = commander.tick
            actions = [int(action) for action in commander.actions()]
        if is_new or is_late or is_back:
            self.on_change()
        if not is_done:
            raise Thinking
        return actions

    def rest(self, result: MatchResult) -> None:
        """Hear how the match ended."""
        with self.lock:
            self.result = result
        self.on_change()

    def _show(self, commander: Commander, observations: Observations) -> None:
        self._told = observations.select(np.zeros(1, np.intp))
        seen = self._told.seat(0, commander.ruleset)
        self.seen.append(seen)
        self._set_deadline(seen)
        commander.see(seen, None if self._pilot is None else _ask(self._pilot, self._told), self._deadline_s)

    def _set_deadline(self, seen: Observation) -> None:
        if self._turn_time_s is None:
            self._deadline_s = None
        else:
            self._deadline_s = self._clock() + max(self._turn_time_s + (seen.clock_s or 0.0) - MARGIN_S, 0.0)

    def _is_late(self) -> bool:
        return self._deadline_s is not None and self._clock() >= self._deadline_s


class _Person(BatchPolicy):
    """A person, as a runner knows one."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int, desk: Desk) -> None:
        super().__init__(ruleset, team, n_seats)
        self._desk = desk

    def start(self, seats: NDArray[np.intp]) -> None:
        """Clear the desk."""
        self._desk.sit_down(self.ruleset, self.team)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Write what the person wants, or raise `Thinking`."""
        orders[0] = self._desk.ask(observations)

    def end(self, seat: int, result: MatchResult) -> None:
        """Tell the person."""
        self._desk.rest(result)


def _start(name: str, ruleset: Ruleset, team: Team) -> BatchPolicy:
    pilot = load(name)(ruleset, team, 1)
    pilot.start(np.zeros(1, np.intp))
    return pilot


def _ask(pilot: BatchPolicy, told: Observations) -> list[int]:
    """Return what an autopilot would do; staying where it gives no action that there is."""
    orders = np.zeros((1, told.cell.shape[1]), np.int8)
    pilot.act(told, orders)
    return [int(order) if order in tuple(Action) else int(Action.STAY) for order in orders[0].tolist()]
