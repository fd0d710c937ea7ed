"""All matches of a pit: those that run, those that wait for their receipts, and the journals of those that are over."""

import logging
import secrets
from collections import OrderedDict
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from arena.errors import JournalError, ProtocolError
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.pit.archive import MOST_KEPT, Archive
from arena.pit.bundles import Bundles
from arena.pit.effects import CloseMatch, Effect, MatchEnded, OpenMatch, ReplyWithJournal
from arena.pit.events import ActionReceived, BundleReceived, JournalAsked, UnfinishedFound
from arena.pit.lanes import Lanes
from arena.pit.match_session import MatchSession, PitContext
from arena.pit.rationed_queue import RationedQueue
from arena.pit.register import Register
from arena.pit.seating import Pairing, Seating
from arena.pit.seats import Client, Seat, SeatBook, SlotId
from arena.protocol.bundles import read_bundle, read_seat_number
from arena.protocol.handshake import Caller, new_secret
from arena.protocol.messages import JoinRequest, Signed, Ticket
from arena.protocol.sealing import Opener
from arena.records.journal import NONCE_BYTES, Header

logger = logging.getLogger(__name__)

RECEIPTS_S = 2.0
"""How long a match that is over waits for its receipts."""
PATIENCE_S = 1.0
"""How long seats may take to get ready, while others wait for room."""
_LANES_APART = 3_000
"""Between the first lanes of two processes: more than a pit ever needs at once."""


@dataclass(frozen=True, slots=True)
class _Closing:
    """A match that is over and waits for its receipts."""

    session: MatchSession
    until_s: float


class Matches:
    """The matches of a pit, and who sits where."""

    def __init__(
        self, context: PitContext, ruleset: Ruleset, time_control: TimeControl, seating: Seating, register: Register
    ) -> None:
        self._context, self._ruleset, self._time_control = context, ruleset, time_control
        self._seating, self._register = seating, register
        first_lane = _LANES_APART * new_secret()[0]
        self._lanes = Lanes(first=first_lane)
        self.bundles = Bundles(Lanes(first=first_lane))
        """Whose lanes are set apart from those of matches by their keys."""
        self._by_lane: dict[int, MatchSession] = {}
        """Those that run, and those that wait for their receipts."""
        self._former_openers: dict[int, dict[Team, tuple[Opener, ...]]] = {}
        """By lane, of the match that was there last: a process that slept may say something yet."""
        self._running: dict[str, MatchSession] = {}
        self._closing: dict[str, _Closing] = {}
        self._seats = SeatBook()
        self._endings: OrderedDict[str, Signed] = OrderedDict()
        """Of matches that are over, the last ones: for a client that was away when the ending was sent."""
        self._archive = Archive(self._is_fixture_over)
        self.n_begun = 0

    @property
    def running(self) -> Collection[MatchSession]:
        """Those that are not over, in the order of their beginning."""
        return self._running.values()

    @property
    def journal_replies(self) -> RationedQueue[ReplyWithJournal]:
        """Pieces of journals that are to be sent."""
        return self._archive.replies

    @property
    def has_closing(self) -> bool:
        """Whether a match waits for its receipts."""
        return bool(self._closing)

    def begin(self, pairing: Pairing, now_s: float) -> tuple[str, list[Effect]]:
        """Begin a match, whose seats are held from now on; return what it is called on the network."""
        plan = pairing.plan
        header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=self._ruleset, keys=plan.keys)
        entries = {team: slot.entry for team, slot in pairing.slots.items()}
        session = self._add(Match(header, self._time_control, now_s), entries, secrets.token_bytes(NONCE_BYTES), now_s)
        for team, slot in pairing.slots.items():
            self._seats.take(Seat(session.id, team), slot)
        self.n_begun += 1
        logger.info("match %s begins: blue %s, red %s", header.identity, header.blue, header.red)
        return session.id, session.open()

    def resume(self, found: UnfinishedFound, now_s: float) -> list[Effect]:
        """Take up an unfinished match at its very tick; nothing is done if its journal does not hold."""
        match = Match(found.journal.header, self._time_control, now_s)
        try:
            match_effects = match.recover(found.journal)
        except JournalError as error:
            logger.warning("%s cannot be resumed: %s", found.name, error)
            return []
        session = self._add(match, found.entries, found.nonce, now_s)
        logger.info("resumed %s at tick %d", match.header.identity, match.tick)
        opened = OpenMatch(session.id, found.name, found.n_bytes, session.lane)
        return [opened, *self._settle(session, session.carry(match_effects), now_s)]

    def receive(self, event: ActionReceived, now_s: float) -> list[Effect]:
        """Take a message on a seat's key."""
        session = self._by_lane.get(event.lane)
        return [] if session is None else self._receive(session, event.team, event.payload, now_s, event.arrived_s)

    def receive_bundle(self, event: BundleReceived, now_s: float) -> list[Effect]:
        """Take messages of seats of one client; what is no bundle of its, or of another's seat, counts for nothing."""
        bundles = self.bundles.at(event.lane)
        if bundles is None:
            return []
        try:
            messages = read_bundle(event.payload)
        except ProtocolError:
            return []
        effects: list[Effect] = []
        for number, message in messages:
            lane, team = read_seat_number(number)
            session = self._by_lane.get(lane)
            if session is not None and session.seats[team].bundles is bundles:
                effects += self._receive(session, team, message, now_s, event.arrived_s)
        return effects

    def _receive(self, session: MatchSession, team: Team, payload: bytes, now_s: float, arrived_s: float | None) -> list[Effect]:
        if session.ending is None:
            return self._settle(session, session.receive(team, payload, now_s, arrived_s), now_s)
        effects = session.receive_receipt(team, payload)
        return effects + self._close(session.id, now_s) if session.has_receipts else effects

    def advance(self, now_s: float) -> list[Effect]:
        """Let time pass."""
        self.bundles.advance(
            now_s, lambda: {seat.bundles for session in self._by_lane.values() for seat in session.seats.values()}
        )
        effects: list[Effect] = []
        for session in list(self._running.values()):
            effects += self._settle(session, session.advance(now_s), now_s)
        for match in [match for match, closing in self._closing.items() if now_s >= closing.until_s]:
            effects += self._close(match, now_s)
        return effects

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

    def ask_for_journal(self, asked: JournalAsked) -> list[Effect]:
        """Answer a request for a piece of a journal, now or once the journal is whole."""
        return self._archive.answer(asked)

    def stop(self, now_s: float) -> list[Effect]:
        """Sign the journals of matches that are over, and leave the others as they stand."""
        effects = [effect for match in list(self._closing) for effect in self._close(match, now_s)]
        effects += [CloseMatch(match) for match in self._running]
        self._running.clear()
        return effects

    # Seats

    @property
    def holders(self) -> set[Client]:
        """The clients that hold seats."""
        return self._seats.holders

    def find_seat(self, slot: SlotId, request: JoinRequest) -> Seat | None:
        """Return the seat that a slot holds, or else one that the same entry has left, the slot's own first, if any."""
        held = self._seats.find(slot)
        return held or max(self._find_vacant(request), key=lambda seat: self._seats.was_held_by(seat, slot), default=None)

    def issue_ticket(self, seat: Seat, slot: SlotId, caller: Caller) -> Ticket:
        """Give a seat of a running match to who asks for it, under new keys."""
        self._seats.take(seat, slot)
        request = caller.request
        bundles = self.bundles.find(request) if isinstance(request, JoinRequest) else None
        return self._running[seat.match].issue_ticket(seat.team, caller, bundles)

    def seats_of(self, entry: bytes | None, name: str) -> list[Seat]:
        """Return the seats of running matches that belong to a public key, or to a name."""
        return [
            Seat(session.id, team)
            for session in self._running.values()
            for team, seat in session.seats.items()
            if seat.name == name or seat.entry == entry
        ]

    def entry_of(self, name: str) -> bytes | None:
        """Return the public key that plays under a name, if any."""
        seats = (seat for session in self._running.values() for seat in session.seats.values())
        return next((seat.entry for seat in seats if seat.name == name), None)

    def lose(self, client: str, now_s: float) -> list[Effect]:
        """Note that a client process is gone; its seats are vacant."""
        effects: list[Effect] = []
        for match, team in self._seats.leave_all(client):
            session = self._running[match]
            effects += self._settle(session, session.carry(session.match.leave(team, now_s)), now_s)
        return effects

    def find_ending(self, match: str) -> Signed | None:
        """Return how a match ended, if it was one of the last."""
        return self._endings.get(match)

    def _find_vacant(self, request: JoinRequest) -> Iterable[Seat]:
        return (
            seat
            for session in self._running.values()
            for team, one in session.seats.items()
            if one.entry == request.entry
            and one.name == request.name
            and request.team in ("any", team.name.lower())
            and not self._seats.is_held(seat := Seat(session.id, team))
        )

    # Endings

    def _settle(self, session: MatchSession, effects: list[Effect], now_s: float) -> list[Effect]:
        """Return the effects, and those of the match's ending if that has come."""
        if session.ending is None:
            return effects
        match, result = session.match, session.match.result
        assert result is not None
        self._endings[session.id] = session.ending
        if len(self._endings) > MOST_KEPT:
            self._endings.popitem(last=False)
        if match.tick and result.ending is not Termination.VOID:
            for seat in session.seats.values():
                self._register.claim(seat.name, seat.entry)
        del self._running[session.id]
        self._seats.forget(session.id)
        self._closing[session.id] = _Closing(session, now_s + RECEIPTS_S)
        self._archive.expect(session.id)
        logger.info("match %s: %s, winner %s", match.header.identity, result.ending.name.lower(), result.winner)
        records = {team: match.record(team) for team in Team}
        return [*effects, MatchEnded(header=match.header, result=result, seats=records, entries=session.entries)]

    def _add(self, match: Match, entries: dict[Team, bytes], nonce: bytes, now_s: float) -> MatchSession:
        lane = self._lanes.take(now_s)
        session = MatchSession(self._context, match, entries, nonce, lane, self._former_openers.pop(lane, {}))
        self._running[session.id] = self._by_lane[session.lane] = session
        return session

    def _close(self, match: str, now_s: float) -> list[Effect]:
        """Close the journal of a match that is over; it may be seen once its whole fixture is."""
        session = self._closing.pop(match).session
        del self._by_lane[session.lane]
        self._former_openers[session.lane] = session.openers
        self._lanes.give_back(session.lane, now_s)
        return [*session.close(), *self._archive.add(match, session.match.header if session.has_journal else None)]

    def _is_fixture_over(self, names: set[str]) -> bool:
        is_running = any(set(session.names) == names for session in self._running.values())
        return not is_running and not self._seating.is_planned(names)
