"""The network side of one match: who sits where, what they are sent, and its journal."""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256

from arena.errors import ArenaError
from arena.game.ruleset import to_dict
from arena.game.types import Team
from arena.policy import MatchResult
from arena.protocol import topics
from arena.protocol.codec import encode
from arena.protocol.messages import Ended, Facts, History, Message, Ticket, Turn
from arena.protocol.sealing import OpenSeal
from arena.referee.match import Ask, Match
from arena.referee.seating import SeatId
from arena.transport import Put, Session

_HISTORY_BYTES = 50_000


@dataclass(slots=True)
class Chair:
    """A seat of the match on the network."""

    name: str
    holder: SeatId | None
    """Who has it, or had it before vanishing; None after a restart of the pit, until somebody comes back."""
    put: Put
    end: Callable[[], None]
    seal: OpenSeal = field(default_factory=OpenSeal)


class Table:
    """A running match, its two chairs, and its journal."""

    def __init__(
        self, session: Session, pit: str, match: Match, holders: dict[Team, SeatId | None], journal: int, *, fsync: bool
    ) -> None:
        self.match = match
        self.id = sha256(match.header.identity.encode()).hexdigest()[:16]
        self._journal, self._fsync = journal, fsync
        self._public = session.broadcast(topics.public(pit, self.id))
        self.chairs: dict[Team, Chair] = {}
        for team, name in zip(Team, (match.header.blue, match.header.red), strict=True):
            put, end = session.publisher(topics.observation(pit, self.id, team))
            self.chairs[team] = Chair(name, holders[team], put, end)

    def ticket(self, team: Team) -> Ticket:
        """Return what a client needs to take a seat."""
        ruleset, terms = self.match.header.ruleset, self.match.terms
        return Ticket(
            match=self.id,
            team=int(team),
            ruleset={"name": ruleset.name, **to_dict(ruleset)},
            opponent=self.chairs[team.other].name,
            turn_time_s=terms.turn_time_s,
            bank_s=terms.bank_s,
            tick=self.match.tick,
        )

    def write(self, data: bytes) -> None:
        """Append to the journal, all or nothing; what cannot be written ends the pit before anybody hears of it."""
        try:
            n_written = os.write(self._journal, data)
            if self._fsync:
                os.fdatasync(self._journal)
        except OSError as error:
            raise ArenaError(f"cannot write a journal: {error.strerror}") from error
        if n_written != len(data):
            raise ArenaError("cannot write a journal: the disk is full")

    def ask(self, ask: Ask) -> None:
        """Send a seat its observation."""
        self._send(ask.team, Turn(tick=ask.tick, observation=ask.observation))

    def publish_facts(self) -> None:
        """Tell everyone what everyone may know of the tick."""
        if self._public.is_heard:
            blue, red, score = self.match.facts
            self._public.put(encode(Facts(tick=self.match.tick, living=[blue, red], score=score)))

    def send_history(self, team: Team, known_ticks: int) -> None:
        """Send what a seat was shown before it came back, in pieces that fit a message."""
        known = max(known_ticks, 0)
        observations, orders = self.match.history(team, known)
        if not observations:
            return
        step = max(1, _HISTORY_BYTES // (len(observations[0]) + len(orders[0]) + 8))
        for first in range(0, len(observations), step):
            piece = slice(first, first + step)
            self._send(team, History(first_tick=known + first, observations=observations[piece], orders=orders[piece]))

    def end(self, result: MatchResult) -> None:
        """Tell everyone how the match ended, and let go of it."""
        ended = Ended(
            ending=result.ending.name.lower(),
            winner=None if result.winner is None else result.winner.name.lower(),
            score=result.score,
            ticks=result.ticks,
            reason=result.reason,
            faults={team.name.lower(): self.match.record(team).faults() for team in Team},
        )
        for team, chair in self.chairs.items():
            self._send(team, ended)
            chair.end()
        self._public.put(encode(ended))
        self._public.end()
        self.put_down()

    def put_down(self) -> None:
        """Close the journal as it stands: a later referee can resume the match."""
        os.close(self._journal)

    def _send(self, team: Team, message: Message) -> None:
        chair = self.chairs[team]
        chair.put(chair.seal.close(encode(message)))
