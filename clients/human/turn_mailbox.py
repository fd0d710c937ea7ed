"""The mailbox between a client's thread and a person's screen: turns go in on one side, orders on the other.

The client never waits for the person. While the person thinks, its policy raises `Thinking` and is asked again; at the deadline
the orders go out as they stand.
"""

import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from arena.console import clean
from arena.game.observation import Observation, Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team
from arena.policy import BatchPolicy, MatchResult, Orders, Thinking
from clients.human.commander import Commander
from clients.human.view_model import ViewModel
from clients.seat import Seat
from policies.registry import load

MARGIN_S = 0.75
"""A turn ends so long before the pit would end it: the client looks every quarter of a second, and the orders must travel."""


class TurnMailbox:
    """The turns and orders of one person, match after match. Every method may be called from any thread."""

    def __init__(self, autopilot: str = "", *, clock: Callable[[], float] = time.monotonic) -> None:
        self.lock = threading.RLock()
        """Held while `commander` is used."""
        self.commander: Commander | None = None
        """Of the match that runs, or ran last; None before the first."""
        self.opponent = ""
        self.match = ""
        self.result: MatchResult | None = None
        """How the last match ended; None while one runs."""
        self.waiting_for = ""
        """The reason, while no match runs or the pit is lost; else empty."""
        self.seen: list[Observation] = []
        """Observations of the match that runs, or ran last."""
        self.autopilot = autopilot
        """The policy that moves units without orders; empty for none."""
        self.on_change: Callable[[], None] = lambda: None
        """Called from the client's thread when there is something new to show."""
        self.wake: Callable[[], None] = lambda: None
        """Called when a turn has ended, so that the client asks for the orders at once."""
        self._clock = clock
        self._turn_time_s: float | None = None
        self._deadline_s: float | None = None
        self._done_tick = -1
        self._pilot: BatchPolicy | None = None
        self._observations: Observations | None = None

    def make(self, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        """Return the policy of a seat: a `BatchFactory`."""
        return _Person(ruleset, team, n_seats, self)

    def on_wait(self, reason: str) -> None:
        """Take what the client waits for: a runner's `on_wait`."""
        self.waiting_for = clean(reason)
        self.on_change()

    def on_seat(self, seat: Seat) -> None:
        """Take which match begins: a runner's `on_seat`."""
        with self.lock:
            self.opponent, self.match = clean(seat.ticket.opponent), seat.ticket.match
            self.waiting_for = ""
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

    def view_model(self) -> ViewModel | None:
        """Return what a screen shows now; None before the first turn."""
        with self.lock:
            if self.commander is None or self.commander.tick < 0:
                return None
            return self.commander.view_model(self._clock())

    def command(self, act: Callable[[Commander], object]) -> None:
        """Change the orders; the turn ends once every living unit has one."""
        with self.lock:
            if self.commander is None:
                return
            act(self.commander)
            is_complete = self.is_my_turn and self.commander.is_complete
        if is_complete:
            self.end_turn()

    def end_turn(self) -> None:
        """Send the orders as they stand."""
        with self.lock:
            if self.commander is not None:
                self._done_tick = self.commander.tick
        self.wake()

    def set_autopilot(self, autopilot: str) -> None:
        """Choose another autopilot from this turn on, empty for none; it remembers nothing of the turns before."""
        with self.lock:
            commander, observations = self.commander, self._observations
        pilot = None
        if autopilot and commander is not None:
            pilot = _start(autopilot, commander.ruleset, commander.team)
        advice = None if pilot is None or observations is None else _ask(pilot, observations)
        with self.lock:
            self.autopilot = autopilot
            if commander is self.commander:
                self._pilot = pilot
                if pilot is not None and self._observations is not None and observations is not self._observations:
                    advice = _ask(pilot, self._observations)  # another turn began meanwhile
                if commander is not None:
                    commander.advise(advice)

    def begin_match(self, ruleset: Ruleset, team: Team) -> None:
        """Begin a match."""
        commander = Commander(ruleset, team)
        pilot = _start(self.autopilot, ruleset, team) if self.autopilot else None
        with self.lock:
            self.commander, self._pilot, self._observations = commander, pilot, None
            self.result, self._done_tick = None, -1
            self.seen = []

    def request_orders(self, observations: Observations) -> list[int]:
        """Return the orders of a turn, an action per unit; `Thinking` while the person has not ended it."""
        with self.lock:
            commander = self.commander
            assert commander is not None
            is_new = commander.tick != int(observations.tick[0])
            is_back, self.waiting_for = bool(self.waiting_for), ""  # the pit is there
            if is_new:
                self._begin_turn(commander, observations)
            elif is_back and self._is_late():  # the pit was away, and began the turn again
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
            raise Thinking(has_seen=True)
        return actions

    def on_end(self, result: MatchResult) -> None:
        """Take how the match ended."""
        with self.lock:
            self.result = result
        self.on_change()

    def _begin_turn(self, commander: Commander, observations: Observations) -> None:
        self._observations = observations.select(np.zeros(1, np.intp))
        seen = self._observations.seat(0, commander.ruleset)
        self.seen.append(seen)
        self._set_deadline(seen)
        commander.see(seen, None if self._pilot is None else _ask(self._pilot, self._observations), self._deadline_s)

    def _set_deadline(self, seen: Observation) -> None:
        if self._turn_time_s is None:
            self._deadline_s = None
        else:
            self._deadline_s = self._clock() + max(self._turn_time_s + (seen.clock_s or 0.0) - MARGIN_S, 0.0)

    def _is_late(self) -> bool:
        return self._deadline_s is not None and self._clock() >= self._deadline_s


class _Person(BatchPolicy):
    """The policy of a seat that a person plays."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int, mailbox: TurnMailbox) -> None:
        super().__init__(ruleset, team, n_seats)
        self._mailbox = mailbox

    def start(self, seats: NDArray[np.intp]) -> None:
        """Begin a match."""
        self._mailbox.begin_match(self.ruleset, self.team)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Write the person's orders, or raise `Thinking`."""
        orders[0] = self._mailbox.request_orders(observations)

    def end(self, seat: int, result: MatchResult) -> None:
        """Show the person how the match ended."""
        self._mailbox.on_end(result)


def _start(name: str, ruleset: Ruleset, team: Team) -> BatchPolicy:
    pilot = load(name)(ruleset, team, 1)
    pilot.start(np.zeros(1, np.intp))
    return pilot


def _ask(pilot: BatchPolicy, observations: Observations) -> list[int]:
    """Return the actions of an autopilot, where it gives an unknown one, staying."""
    orders = np.zeros((1, observations.cell.shape[1]), np.int8)
    pilot.act(observations, orders)
    return [int(order) if order in tuple(Action) else int(Action.STAY) for order in orders[0].tolist()]
