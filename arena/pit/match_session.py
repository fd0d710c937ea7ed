"""The network side of one match: who sits where, what they are sent under which keys, and its journal."""

import os
from collections.abc import Callable
from dataclasses import dataclass

from arena.errors import ArenaError
from arena.game.types import Team
from arena.match.effects import Ask
from arena.match.match import Match
from arena.network.session import Put, Session
from arena.pit.seating import SeatId
from arena.policy import MatchResult
from arena.protocol import topics
from arena.protocol.codec import encode
from arena.protocol.handshake import Caller, new_secret
from arena.protocol.identity import Identity
from arena.protocol.messages import Commitment, Ended, History, Message, PublicState, Receipt, Signed, Ticket, Truth, Turn
from arena.protocol.sealing import Opener, Sealer, truth_sealer
from arena.protocol.signed import commit, sign_journal, sign_statement
from arena.records.framing import rules_values
from arena.records.journal import match_id, write_receipt, write_seats, write_signature

_HISTORY_BYTES = 50_000
_TURN_EXTRA_BYTES = 32
"""What a `Turn` is longer than its observation, at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PitContext:
    """What all tables of a pit share."""

    session: Session
    pit: str
    identity: Identity
    spectator_key: bytes | None = None
    fsync: bool = False


@dataclass(slots=True)
class SeatSession:
    """A seat of the match on the network."""

    name: str
    entry: bytes
    """The public key that it belongs to."""
    put: Put
    end: Callable[[], None]
    holder: SeatId | None = None
    """Who has it, or had it before vanishing; None after a restart of the pit, until somebody comes back."""
    sealer: Sealer | None = None
    opener: Opener | None = None
    sent: tuple[int, bytes] = (-1, b"")
    """The last turn as it was sealed: a resend under one key repeats it."""
    n_suspect: int = 0
    """Messages of late that did not open."""
    receipt: Receipt | None = None


class MatchSession:
    """A running match, its two chairs, and its journal."""

    def __init__(self, house: PitContext, match: Match, entries: dict[Team, bytes], journal: int) -> None:
        self.match, self._house = match, house
        self.id = match_id(match.header.identity)
        self._journal = journal
        session, pit = house.session, house.pit
        self._public = session.broadcast(topics.public(pit, self.id))
        self._truth = session.broadcast(topics.truth(pit, self.id))
        self._salt = new_secret()
        self._truth_sealer = house.spectator_key and truth_sealer(house.spectator_key, self._salt, pit, self.id)
        self.chairs: dict[Team, SeatSession] = {}
        for team, name in zip(Team, (match.header.blue, match.header.red), strict=True):
            put, end = session.publisher(topics.observation(pit, self.id, team))
            self.chairs[team] = SeatSession(name, entries[team], put, end)
        commitment = sign_statement(house.identity, Commitment(match=self.id, digest=commit(self.id, match.header.keys)))
        self._commitment = encode(commitment)
        self.seats_record = write_seats(house.identity.public, entries, commitment.signature)

    def seat(self, team: Team, caller: Caller, holder: SeatId) -> Ticket:
        """Give a seat to who called, under keys of its own, from whichever process had it before."""
        ruleset, time_control, chair = self.match.header.ruleset, self.match.time_control, self.chairs[team]
        secret = new_secret()
        n_bytes = self.match.n_shown_bytes(team) + _TURN_EXTRA_BYTES
        chair.sealer, chair.opener = caller.sit(self.id, team, secret, n_bytes)
        chair.sent, chair.holder = (-1, b""), holder
        return Ticket(
            match=self.id,
            team=int(team),
            ruleset=rules_values(ruleset),
            opponent=self.chairs[team.other].name,
            turn_time_s=time_control.turn_time_s,
            bank_s=time_control.bank_s,
            tick=self.match.tick,
            secret=secret,
            commitment=self._commitment,
        )

    def write(self, data: bytes) -> None:
        """Append to the journal, all or nothing; what cannot be written ends the pit before anybody hears of it."""
        try:
            n_written = os.write(self._journal, data)
            if self._house.fsync:
                os.fdatasync(self._journal)
        except OSError as error:
            raise ArenaError(f"cannot write a journal: {error.strerror}") from error
        if n_written != len(data):
            raise ArenaError("cannot write a journal: the disk is full")

    def ask(self, ask: Ask) -> None:
        """Send a seat its observation."""
        chair = self.chairs[ask.team]
        if chair.sealer is None:
            return
        if chair.sent[0] != ask.tick:
            chair.sent = ask.tick, chair.sealer.close(encode(Turn(tick=ask.tick, observation=ask.observation)), ask.tick)
        chair.put(chair.sent[1])

    def publish(self) -> None:
        """Tell everyone what everyone may know of the tick, and spectators with the key all of it."""
        tick = self.match.tick
        if self._public.has_subscribers:
            blue, red, score = self.match.facts
            names = [chair.name for chair in self.chairs.values()]
            facts = PublicState(tick=tick, names=names, living=[blue, red], score=score, commitment=self._commitment)
            self._public.put(encode(facts))
        if self._truth_sealer and self._truth.has_subscribers:
            board, seen = self.match.truth()
            sealed = self._truth_sealer.close(encode(Truth(tick=tick, board=board, seen=seen)), tick)
            self._truth.put(self._salt + sealed)

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
        self.chairs[team].sent = (-1, b"")  # as it was sealed, the turn would stand before the history, and not open any more

    def end(self, result: MatchResult) -> Signed:
        """Tell everyone how the match ended, and return what was told."""
        ended = Ended(
            match=self.id,
            **result.in_words(),
            faults={team.name.lower(): self.match.record(team).faults() for team in Team},
        )
        signed = sign_statement(self._house.identity, ended)
        for team in Team:
            self._send(team, signed)
        self._public.put(encode(signed))
        return signed

    def accept(self, team: Team, receipt: Receipt) -> None:
        """Put a seat's receipt into the journal, once."""
        if self.chairs[team].receipt is None:
            self.chairs[team].receipt = receipt
            self.write(write_receipt(team, receipt))

    @property
    def has_receipts(self) -> bool:
        """Whether both seats gave theirs."""
        return all(chair.receipt is not None for chair in self.chairs.values())

    def close(self) -> None:
        """Sign the journal, and let go of it all."""
        self.write(write_signature(sign_journal(self._house.identity, self.match.head)))
        for chair in self.chairs.values():
            chair.end()
        self._public.end()
        self._truth.end()
        self.put_down()

    def put_down(self) -> None:
        """Close the journal as it stands: a later referee can resume the match."""
        os.close(self._journal)

    def _send(self, team: Team, message: Message) -> None:
        chair = self.chairs[team]
        if chair.sealer is not None:
            chair.put(chair.sealer.close(encode(message), self.match.tick))
