"""One seat of one match as its client sees it, without I/O: the referee's messages go in, the answers come out.

The policy is asked once for each tick, whatever is sent twice, lost, or sent again after a restart of either side. A policy may
need longer (`arena.policy.Thinking`), and nothing here waits for it: what arrives meanwhile stays in line, and is shown to it one
tick after the other. An answer that the referee does not wait for any more is not sent.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from arena.errors import UnreadableError
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, read_rules
from arena.game.types import Team, Termination
from arena.policy import BatchFactory, BatchPolicy, Faults, MatchResult, Thinking
from arena.protocol.messages import UNKNOWN_US, Ended, History, Message, Orders, Ready, Ticket, Turn
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


class _Shown(NamedTuple):
    """What the policy is to be shown of a tick."""

    observation: bytes
    played: bytes | None
    """The orders that were played, if that is history."""
    charged_us: int
    """As in `Turn`."""


class Seat:
    """A policy that plays one seat.

    Parameters
    ----------
    clock
        Times the policy's turns, in seconds.
    n_in_turn
        Seats whose policies think one after the other, so that each has a share of a turn's time.
    """

    def __init__(
        self,
        ticket: Ticket,
        commitment: bytes,
        make: BatchFactory,
        *,
        match: str = "",
        clock: Callable[[], float] | None = None,
        n_in_turn: int = 1,
    ) -> None:
        self.ticket, self.commitment = ticket, commitment
        self.ruleset, self.team = read_ticket(ticket)
        self.ended: Ended | None = None
        self.is_gone = False
        """Whether the match was given up: it is over, and how it ended is not known."""
        self.known_ticks = 0
        """Observations that the policy has been shown, and has answered."""
        self.is_behind = False
        """Whether a turn was lost on its way; the referee sends what is missing to who takes the seat again."""
        self.charges_us: list[int] = []
        """What the pit's clock charged for each turn, as far as it has said so; `UNKNOWN_US` where it has not."""
        self.took_s: dict[int, float] = {}
        """How long the policy thought about each tick, by `clock`."""
        self._clock = clock
        self._began_s: float | None = None
        """When the policy was shown the first observation that waits."""
        self._reader = ObservationReader(self.ruleset, self.team)
        self._in_memory: tuple[bytes, int, Observations] | None = None
        """The observation that was read last: its bytes, its tick, and what they say."""
        self._policy: BatchPolicy = make(self.ruleset, self.team, 1)
        self._policy.name_match(0, match or ticket.match)
        if ticket.turn_time_s is not None:
            self._policy.set_turn_time(ticket.turn_time_s / n_in_turn)
        self._has_started = False
        self._must_say_ready = False
        self._waiting: deque[_Shown] = deque()
        """Tick by tick from `known_ticks` on; the policy may be thinking about the first. A match has no more than its ticks."""
        self._caught_up_at: int | None = None
        """The tick at which the history ends that the policy is being shown."""
        self._asked_tick = -1
        """The tick that the referee asked for last."""
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

    @property
    def owes_ready(self) -> bool:
        """Whether the policy still starts, or sees its history: the referee has nothing to say until then."""
        return self._must_say_ready or (self._caught_up_at is not None and bool(self._waiting))

    @property
    def is_starting(self) -> bool:
        """Whether the policy has not started yet."""
        return not self._has_started

    @property
    def transcript(self) -> Path | None:
        """The file of what this seat is shown, if that is kept."""
        return None if self._transcript is None else self._transcript.path

    def keep(self, transcript: TranscriptWriter, *, explains: bool = False) -> None:
        """Write what this seat is shown, and what its policy notes, to a transcript; `explains` as a `BatchPolicy` has it."""
        self._transcript = transcript
        self._policy.keeps_annotations, self._policy.explains = True, explains

    def listen(self) -> list[Message]:
        """Take the seat, for the first time or again; return what is to be said, `Ready` once the policy has started."""
        self.is_behind, self._must_say_ready = False, True
        if self._caught_up_at is not None:  # the rest is sent again; the policy may be thinking about the first
            self._caught_up_at = None
            while len(self._waiting) > 1:
                self._waiting.pop()
        return self.think()

    def receive(self, message: Message) -> list[Message]:
        """Take a message, and return what is to be said.

        Raises
        ------
        UnreadableError
            No referee says this; nothing has changed.
        """
        if self.ended is not None:
            return []
        if type(message) is Turn:
            return self._take_turn(message)
        if type(message) is History:
            return self._take_history(message)
        if type(message) is Ended:
            self._end(message)
        return []

    def think(self) -> list[Message]:
        """Go on where the policy needed longer, and return what is to be said."""
        said: list[Message] = []
        if self.ended is not None:
            return said
        try:
            if not self._has_started:
                self._policy.start(_SEAT)
                self._has_started = True
            if self._must_say_ready:
                self._must_say_ready = False
                said.append(self._ready())
            while self._waiting:
                tick = self.known_ticks
                self._show(self._waiting[0])
                self._waiting.popleft()
                if tick == self._asked_tick:
                    said.append(self._orders_of(tick))
                if self.known_ticks == self._caught_up_at:
                    self._caught_up_at = None
                    if not self._waiting:  # else the referee has asked already
                        said.append(self._ready())
        except Thinking:
            return said
        return said

    def abandon(self) -> None:
        """End a match that is gone for the policy, which may hold a process for it; how it ended is not known."""
        if self.ended is None:
            self.is_gone = True
            self._waiting.clear()
            self._policy.end(
                0,
                MatchResult(ending=Termination.VOID, winner=None, score=0, ticks=self.known_ticks, reason="the match is gone"),
            )

    def result(self) -> MatchResult:
        """Return how the match ended, from this side."""
        if self.ended is None:
            raise ValueError("the match is not over")
        return read_result(self.ended).seen_by(self.team)

    def faults(self) -> Faults:
        """Return the policy's faults since the last call."""
        return self._policy.take_faults(0)

    @property
    def _n_received(self) -> int:
        """Observations without a gap from the first: those that the policy has been shown, and those that wait."""
        return self.known_ticks + len(self._waiting)

    def _ready(self) -> Ready:
        return Ready(known_ticks=self._n_received)

    def _orders_of(self, tick: int) -> Orders:
        return Orders(tick=tick, actions=self._answers[tick])

    def _take_turn(self, turn: Turn) -> list[Message]:
        tick, n_received = turn.tick, self._n_received
        if tick < 0:
            raise UnreadableError(f"there is no tick {tick}")
        if tick > n_received:
            self.is_behind = True
            return []
        if tick == n_received:
            self._read(turn.observation, tick)
            self._waiting.append(_Shown(turn.observation, None, turn.charged_us))
            self.charges_us += [UNKNOWN_US] * (tick - 1 - len(self.charges_us))
            if tick > len(self.charges_us):
                self.charges_us.append(turn.charged_us)
        self._asked_tick = tick
        if tick < self.known_ticks:
            return [self._orders_of(tick)]
        return self.think()

    def _take_history(self, history: History) -> list[Message]:
        """Have the policy shown what it missed; its actions then are of no use any more."""
        n_received = self._n_received
        n_known = n_received - history.first_tick
        if history.first_tick < 0 or n_known < 0:
            return []
        missed = list(zip(history.observations[n_known:], history.orders[n_known:], strict=False))
        for tick, (observation, _) in enumerate(missed, start=n_received):
            self._read(observation, tick)
        self._waiting += [_Shown(*one, UNKNOWN_US) for one in missed]
        self.is_behind = False
        if history.end_tick > self.known_ticks:
            self._caught_up_at = history.end_tick
        return self.think()

    def _read(self, data: bytes, tick: int) -> Observations:
        """Return an observation in memory that the next call overwrites."""
        if self._in_memory is not None and data is self._in_memory[0] and tick == self._in_memory[1]:
            return self._in_memory[2]
        if tick >= self.ruleset.tick_limit:
            raise UnreadableError(f"there is no tick {tick} in matches of {self.ruleset.tick_limit} ticks")
        self._in_memory = None
        observations = self._reader.read(data)
        if (told := observations.tick.item(0)) != tick:
            raise UnreadableError(f"the observation is of tick {told}, not {tick}")
        self._in_memory = data, tick, observations
        return observations

    def _show(self, shown: _Shown) -> None:
        """Show the policy an observation; its answer is kept, or what was played if that is history."""
        observations = self._read(shown.observation, self.known_ticks)
        self._orders[:] = 0
        if self._clock is not None and self._began_s is None:
            self._began_s = self._clock()
        try:
            self._policy.act(observations, self._orders)
        except Thinking as thinking:
            is_asked = shown.played is None and self.known_ticks == self._asked_tick
            if is_asked or not thinking.has_seen:
                raise
            self._orders[:] = 0
        if self._clock is not None and self._began_s is not None:
            self.took_s[self.known_ticks] = self._clock() - self._began_s
            self._began_s = None
        self.known_ticks += 1
        self._answers.append(self._orders.tobytes() if shown.played is None else shown.played)
        self._head.add(shown.observation)
        if self._transcript is not None:
            self._transcript.add(shown.observation, self._answers[-1], shown.charged_us, self._policy.take_annotations(0))

    def _end(self, ended: Ended) -> None:
        """End the match at once, even if the policy still thinks."""
        result = read_result(ended).seen_by(self.team)
        self.ended = ended
        self._waiting.clear()
        self._policy.end(0, result)
        if self._transcript is not None:
            self._transcript.end(result)
