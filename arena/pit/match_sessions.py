"""The matches that one process referees: those that run, and those that are over and wait for their receipts. Without I/O."""

import logging
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import NamedTuple

from arena.errors import JournalError, UnreadableError
from arena.game.types import Team
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.pit.authenticator import PendingRequest
from arena.pit.bundles import Bundles
from arena.pit.effects import CloseMatch, Effect, MatchEnded, OpenMatch
from arena.pit.events import ActionReceived, BundleReceived, UnfinishedFound
from arena.pit.lanes import Lanes
from arena.pit.match_session import MatchSession, PitContext
from arena.pit.seats import Seat
from arena.protocol.bundles import read_bundle, read_seat_number
from arena.protocol.handshake import Caller, new_secret
from arena.protocol.messages import JoinRequest, Signed, Ticket
from arena.protocol.sealing import Opener
from arena.records.journal import Header

logger = logging.getLogger(__name__)

RECEIPTS_S = 2.0
"""How long a match that is over waits for its receipts."""
PATIENCE_S = 1.0
"""How long seats may take to get ready, while others wait for room."""
_LANES_APART = 3_000
"""Between the first lanes of two processes: more than a pit ever needs at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewMatch:
    """A match as it is handed to whoever referees it."""

    header: Header
    entries: dict[Team, bytes]
    """Public keys of those who play."""
    nonce: bytes
    """In its name on the network."""
    lane: int


class MatchOver(NamedTuple):
    """How a match ended."""

    match: str
    ended: MatchEnded
    ending: Signed
    """As both seats and everyone else get it."""


class MatchClosed(NamedTuple):
    """A match whose journal was closed."""

    match: str
    header: Header | None
    """None if it left no journal."""


@dataclass(frozen=True, slots=True)
class _Closing:
    """A match that is over and waits for its receipts."""

    session: MatchSession
    until_s: float


class MatchSessions:
    """Referees matches.

    Parameters
    ----------
    on_over
        What else is to be done as soon as a match is over.
    on_closed
        What else is to be done once its journal is closed.
    lanes
        Those that may be used; any without it.
    note_lane
        Is told the lane of each message of a bundle before it is handed in.
    """

    def __init__(
        self,
        context: PitContext,
        time_control: TimeControl,
        on_over: Callable[[MatchOver], list[Effect]],
        on_closed: Callable[[MatchClosed], list[Effect]],
        lanes: range | None = None,
        note_lane: Callable[[int], None] = lambda lane: None,
    ) -> None:
        self._context, self._time_control = context, time_control
        self._on_over, self._on_closed = on_over, on_closed
        self._note_lane = note_lane
        self._lanes = _lanes_of(lanes)
        self._bundles = Bundles(_lanes_of(lanes))
        """Whose lanes are set apart from those of matches by their keys."""
        self._by_lane: dict[int, MatchSession] = {}
        """Those that run, and those that wait for their receipts."""
        self._former_openers: dict[int, dict[Team, tuple[Opener, ...]]] = {}
        """By lane, of the match that was there last: a process that slept may say something yet."""
        self._running: dict[str, MatchSession] = {}
        self._closing: dict[str, _Closing] = {}

    @property
    def running(self) -> Collection[MatchSession]:
        """Those that are not over, in the order of their beginning."""
        return self._running.values()

    @property
    def has_closing(self) -> bool:
        """Whether a match waits for its receipts."""
        return bool(self._closing)

    def find(self, match: str) -> MatchSession | None:
        """Return a match that runs."""
        return self._running.get(match)

    def take_lane(self, now_s: float) -> int:
        """Return a lane for the next match; it is given back when the match is closed."""
        return self._lanes.take(now_s)

    def begin(self, new: NewMatch, now_s: float) -> list[Effect]:
        """Begin a match."""
        return self._add(Match(new.header, self._time_control, now_s), new.entries, new.nonce, new.lane).open()

    def resume(self, found: UnfinishedFound, lane: int, now_s: float) -> list[Effect]:
        """Take up an unfinished match at its very tick; nothing is done if its journal does not hold."""
        match = Match(found.journal.header, self._time_control, now_s)
        try:
            match_effects = match.recover(found.journal)
        except JournalError as error:
            logger.warning("%s cannot be resumed: %s", found.name, error)
            return []
        session = self._add(match, found.entries, found.nonce, lane)
        facts = {"event": "match resumed", "match": session.id, "identity": match.header.identity, "tick": match.tick}
        logger.info("resumed %s at tick %d", match.header.identity, match.tick, extra={"facts": facts})
        opened = OpenMatch(session.id, found.name, found.n_bytes, session.lane)
        return [opened, *self._settle(session, session.carry(match_effects), now_s)]

    def receive(self, event: ActionReceived, now_s: float) -> list[Effect]:
        """Take a message on a seat's key."""
        session = self._by_lane.get(event.lane)
        return [] if session is None else self._receive(session, event.team, event.payload, now_s, event.arrived_s)

    def receive_bundle(self, event: BundleReceived, now_s: float) -> list[Effect]:
        """Take messages of seats of one client; what is no bundle of its, or of another's seat, counts for nothing."""
        bundles = self._bundles.at(event.lane)
        if bundles is None:
            return []
        try:
            messages = read_bundle(event.payload)
        except UnreadableError:
            return []
        effects: list[Effect] = []
        for number, message in messages:
            lane, team = read_seat_number(number)
            session = self._by_lane.get(lane)
            if session is not None and session.seats[team].bundles is bundles:
                self._note_lane(lane)
                effects += self._receive(session, team, message, now_s, event.arrived_s)
        return effects

    @property
    def holds_bundles(self) -> bool:
        """Whether something was gathered for clients."""
        return self._bundles.wait

    def take_bundles(self, now_s: float) -> list[Effect]:
        """Return all that was gathered, to be sent now."""
        return [*self._bundles.take(now_s)]

    def _receive(self, session: MatchSession, team: Team, payload: bytes, now_s: float, arrived_s: float | None) -> list[Effect]:
        if session.ending is None:
            session.due_s = 0.0
            return self._settle(session, session.receive(team, payload, now_s, arrived_s), now_s)
        effects = session.receive_receipt(team, payload)
        return effects + self._close(session.id, now_s) if session.has_receipts else effects

    def advance(self, now_s: float) -> list[Effect]:
        """Let time pass. Only matches are looked at in which that may change something: of a thousand, next to none."""
        self._bundles.advance(
            now_s, lambda: {seat.bundles for session in self._by_lane.values() for seat in session.seats.values()}
        )
        effects: list[Effect] = []
        for session in [session for session in self._running.values() if session.due_s <= now_s]:
            effects += self._settle(session, session.advance(now_s), now_s)
        for match, closing in list(self._closing.items()):
            closing.session.try_again()
            if now_s >= closing.until_s:
                effects += self._close(match, now_s)
        return effects

    def issue_ticket(self, seat: Seat, pending: PendingRequest, now_s: float) -> list[Effect]:
        """Give a seat to who asks for it, under new keys."""
        return [pending.reply(self.make_ticket(self._running[seat.match], seat.team, pending.caller))]

    def make_ticket(self, session: MatchSession, team: Team, caller: Caller) -> Ticket:
        """Return a ticket for a seat, whose messages go in bundles if its client wants that."""
        request = caller.request
        bundles = self._bundles.find(request) if isinstance(request, JoinRequest) else None
        return session.issue_ticket(team, caller, bundles)

    def leave(self, seat: Seat, now_s: float) -> list[Effect]:
        """Note that the process which held a seat is gone."""
        session = self._running.get(seat.match)
        if session is None:
            return []
        session.due_s = 0.0
        return self._settle(session, session.carry(session.match.leave(seat.team, now_s)), now_s)

    def forfeit(self, seat: Seat, why: str, now_s: float) -> list[Effect]:
        """Have a seat forfeit its match, unless that is over."""
        session = self._running.get(seat.match)
        return [] if session is None else self._settle(session, session.carry(session.match.forfeit(seat.team, why)), now_s)

    def void(self, match: str, why: str, now_s: float) -> list[Effect]:
        """End a match by a fault that is no seat's; nothing is done if it does not run."""
        session = self._running.get(match)
        return [] if session is None else self._settle(session, session.carry(session.match.void(why)), now_s)

    def give_up_unready(self, now_s: float) -> list[Effect]:
        """Void the match whose seats take longest to get ready, if that is too long: who never plays must not keep others out."""
        session = max(self._running.values(), key=lambda session: session.match.unready_s(now_s), default=None)
        if session is None or session.match.unready_s(now_s) < PATIENCE_S:
            return []
        return self.void(session.id, "was not ready while others waited for room", now_s)

    def stop(self, now_s: float) -> list[Effect]:
        """Sign the journals of matches that are over, and leave the others as they stand."""
        effects = [effect for match in list(self._closing) for effect in self._close(match, now_s)]
        effects += [CloseMatch(match) for match in self._running]
        self._running.clear()
        return effects

    def _add(self, match: Match, entries: dict[Team, bytes], nonce: bytes, lane: int) -> MatchSession:
        session = MatchSession(self._context, match, entries, nonce, lane, self._former_openers.pop(lane, {}))
        self._running[session.id] = self._by_lane[lane] = session
        return session

    def _settle(self, session: MatchSession, effects: list[Effect], now_s: float) -> list[Effect]:
        """Return the effects, and those of the match's ending if that has come."""
        if session.ending is None:
            return effects
        match, result = session.match, session.match.result
        assert result is not None
        del self._running[session.id]
        self._closing[session.id] = _Closing(session, now_s + RECEIPTS_S)
        records = {team: match.record(team) for team in Team}
        facts = {"event": "match ended", "match": session.id, "identity": match.header.identity, **result.to_dict()}
        facts["faults"] = {team.name.lower(): record.faults() for team, record in records.items()}
        ending = result.ending.name.lower()
        logger.info("match %s: %s, winner %s", match.header.identity, ending, result.winner, extra={"facts": facts})
        ended = MatchEnded(header=match.header, result=result, seats=records, entries=session.entries)
        return effects + self._on_over(MatchOver(session.id, ended, session.ending))

    def _close(self, match: str, now_s: float) -> list[Effect]:
        """Close the journal of a match that is over."""
        session = self._closing.pop(match).session
        del self._by_lane[session.lane]
        self._former_openers[session.lane] = session.openers
        self._lanes.give_back(session.lane, now_s)
        closed = MatchClosed(match, session.match.header if session.has_journal else None)
        return [*session.close(), *self._on_closed(closed)]


def _lanes_of(lanes: range | None) -> Lanes:
    """Return lanes that begin elsewhere in each process."""
    if lanes is None:
        return Lanes(_LANES_APART * new_secret()[0])
    return Lanes(lanes.start + int.from_bytes(new_secret()[:4], "big") % len(lanes), lanes)
