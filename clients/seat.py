"""One seat of one match as its client sees it, without I/O: the referee's messages go in, the answers come out.

The policy is asked once for each tick, whatever is sent twice, lost, or sent again after a restart of either side.
"""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from arena.errors import UnreadableError
from arena.game.ruleset import Ruleset, from_dict
from arena.game.types import Team
from arena.policy import BatchFactory, BatchPolicy, Faults, MatchResult, Thinking
from arena.protocol.messages import Ended, History, Message, Orders, Ready, Ticket, Turn
from arena.protocol.observation_codec import ObservationReader
from arena.protocol.topics import is_chunk
from arena.records.transcript import Head, TranscriptWriter

_SEAT = np.zeros(1, np.intp)


def read_ticket(ticket: Ticket) -> tuple[Ruleset, Team]:
    """Return the ruleset and the team of a ticket.

    Raises
    ------
    InputError
        The ruleset is none that this version knows.
    UnreadableError
        The ticket is for no team, or for no match that can be.
    """
    if ticket.team not in tuple(Team) or not is_chunk(ticket.match):
        raise UnreadableError(f"the ticket is for team {ticket.team} in match {ticket.match!r}")
    return read_rules(ticket.ruleset), Team(ticket.team)


def read_result(ended: Ended) -> MatchResult:
    """Return how a match ended, by the pit's message; `UnreadableError` if no match ends like this."""
    try:
        return MatchResult.from_dict(asdict(ended))
    except KeyError as error:
        raise UnreadableError(f"no match ends like this: {error}") from error


def read_rules(values: Mapping[str, Any]) -> Ruleset:
    """Return the ruleset of a ticket or a lobby; `InputError` if it is none that this version knows."""
    rest = dict(values)
    return from_dict(str(rest.pop("name", "unnamed")), rest)


class Seat:
    """A policy that plays one seat."""

    def __init__(self, ticket: Ticket, commitment: bytes, make: BatchFactory) -> None:
        self.ticket, self.commitment = ticket, commitment
        self.ruleset, self.team = read_ticket(ticket)
        self.ended: Ended | None = None
        self.known_ticks = 0
        """Observations that the policy has been shown."""
        self._reader = ObservationReader(self.ruleset, self.team)
        self._policy: BatchPolicy = make(self.ruleset, self.team, 1)
        self._policy.start(_SEAT)
        self._orders = np.zeros((1, len(self.ruleset.team(self.team))), np.int8)
        self._answers: list[bytes] = []
        """The policy's answer to each observation, for a resend."""
        self._head = Head()
        self._transcript: TranscriptWriter | None = None

    @property
    def head(self) -> bytes:
        """The hash chain over all that this seat was shown."""
        return self._head.digest

    @property
    def answers(self) -> list[bytes]:
        """The answer to each tick so far, a byte per unit."""
        return self._answers

    def keep(self, transcript: TranscriptWriter) -> None:
        """Write what this seat is shown to a transcript."""
        self._transcript = transcript

    def ready(self) -> Ready:
        """Return the message that this seat is subscribed, for the first time or again."""
        return Ready(known_ticks=self.known_ticks)

    def receive(self, message: Message) -> Message | None:
        """Take a message, and return the answer if it wants one; `Thinking`, and nothing has changed, if that takes longer."""
        if self.ended is not None:
            return None
        if type(message) is Turn:
            return self._answer(message)
        if type(message) is History:
            self._catch_up(message)
        elif type(message) is Ended:
            result = read_result(message).seen_by(self.team)
            self.ended = message
            self._policy.end(0, result)
            if self._transcript is not None:
                self._transcript.end(result)
        return None

    def result(self) -> MatchResult:
        """Return how the match ended, from this side."""
        if self.ended is None:
            raise ValueError("the match is not over")
        return read_result(self.ended).seen_by(self.team)

    def faults(self) -> Faults:
        """Return the policy's faults since the last call."""
        return self._policy.take_faults(0)

    def _answer(self, turn: Turn) -> Message | None:
        if turn.tick < 0:
            raise UnreadableError(f"there is no tick {turn.tick}")
        if turn.tick > self.known_ticks:
            return self.ready()
        if turn.tick == self.known_ticks:
            self._ask_policy(turn.observation)
        return Orders(tick=turn.tick, actions=self._answers[turn.tick])

    def _catch_up(self, history: History) -> None:
        """Show the policy what it missed; its actions then are of no use any more."""
        if not 0 <= history.first_tick <= self.known_ticks:
            return
        known = self.known_ticks - history.first_tick
        for observation, orders in zip(history.observations[known:], history.orders[known:], strict=False):
            self._ask_policy(observation, orders)

    def _ask_policy(self, data: bytes, played: bytes | None = None) -> None:
        """Show the policy an observation; its answer is kept, or what was played if that is history."""
        observations = self._reader.read(data)
        if int(observations.tick[0]) != self.known_ticks:
            raise UnreadableError(f"the observation is of tick {observations.tick[0]}, not {self.known_ticks}")
        self._orders[:] = 0
        try:
            self._policy.act(observations, self._orders)
        except Thinking:
            if played is None:
                raise
        self.known_ticks += 1
        self._answers.append(self._orders.tobytes() if played is None else played)
        self._head.add(data)
        if self._transcript is not None:
            self._transcript.add(data, self._answers[-1])
