"""One seat of one match as its client sees it, without I/O: messages of the referee go in, messages to it come out.

The policy is asked once for each tick, whatever is sent twice, lost, or told again after a restart of either side.
"""

from collections.abc import Sequence

import numpy as np

from arena.errors import UnreadableError
from arena.game.ruleset import Ruleset, from_dict
from arena.game.types import Ending, Team
from arena.policy import BatchFactory, BatchPolicy, Faults, MatchResult
from arena.protocol.messages import Ended, History, Message, Orders, Ready, Ticket, Turn
from arena.protocol.sight import unpack

_SEAT = np.zeros(1, np.intp)


def read_ticket(ticket: Ticket) -> tuple[Ruleset, Team]:
    """Return what a seat plays, and for whom.

    Raises
    ------
    InputError
        The ruleset is none that this version knows.
    """
    values = dict(ticket.ruleset)
    return from_dict(str(values.pop("name", "unnamed")), values), Team(ticket.team)


class Seat:
    """A policy at work in one seat."""

    def __init__(self, ticket: Ticket, make: BatchFactory) -> None:
        self.ticket = ticket
        self.ruleset, self.team = read_ticket(ticket)
        self.ended: Ended | None = None
        self.known_ticks = 0
        """Observations that the policy has been shown."""
        self._policy: BatchPolicy = make(self.ruleset, self.team, 1)
        self._policy.start(_SEAT)
        self._orders = np.zeros((1, len(self.ruleset.team(self.team))), np.int8)
        self._last: Orders | None = None

    def ready(self) -> Ready:
        """Return what tells the referee that this seat listens, at first or again."""
        # The last answer may never have arrived, so its tick is not claimed as settled.
        return Ready(known_ticks=self.known_ticks)

    def receive(self, message: Message) -> Message | None:
        """Take a message, and return the answer if it wants one."""
        if type(message) is Turn:
            return self._answer(message)
        if type(message) is History:
            self._catch_up(message)
        elif type(message) is Ended and self.ended is None:
            self.ended = message
            self._policy.end(0, self.result())
        return None

    def result(self) -> MatchResult:
        """Return how the match ended, from this side."""
        if self.ended is None:
            raise ValueError("the match is not over")
        winner = None if self.ended.winner is None else Team[self.ended.winner.upper()]
        return MatchResult(
            ending=Ending[self.ended.ending.upper()],
            winner=winner,
            score=self.ended.score if self.team is Team.BLUE else -self.ended.score,
            ticks=self.ended.ticks,
            reason=self.ended.reason,
        )

    def faults(self) -> Faults:
        """Return what the policy did wrong since the last call."""
        return self._policy.take_faults(0)

    def _answer(self, turn: Turn) -> Message | None:
        if self._last is not None and turn.tick == self._last.tick:
            return self._last
        if turn.tick > self.known_ticks:
            return self.ready()
        if turn.tick < self.known_ticks:
            return None
        self._last = Orders(tick=turn.tick, actions=self._ask_policy(turn.observation))
        return self._last

    def _catch_up(self, history: History) -> None:
        """Show the policy what it missed; what it would have done then is of no use any more."""
        missed: Sequence[bytes] = history.observations[max(self.known_ticks - history.first_tick, 0) :]
        if history.first_tick > self.known_ticks:
            return
        for observation in missed:
            self._ask_policy(observation)

    def _ask_policy(self, data: bytes) -> bytes:
        observations, _ = unpack(data, self.ruleset, self.team)
        if int(observations.tick[0]) != self.known_ticks:
            raise UnreadableError(f"the observation is of tick {observations.tick[0]}, not {self.known_ticks}")
        self._orders[:] = 0
        self._policy.act(observations, self._orders)
        self.known_ticks += 1
        return self._orders.tobytes()
