"""All matches of a pit: who sits where in those that run, how those that are over ended, and the journals of those."""

import logging
import secrets
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable
from typing import Protocol

from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.pit.archive import MOST_KEPT, Archive
from arena.pit.authenticator import PendingRequest
from arena.pit.effects import Effect, ReplyWithJournal
from arena.pit.events import ActionReceived, BundleReceived, UnfinishedFound
from arena.pit.match_session import PitContext
from arena.pit.match_sessions import MatchClosed, MatchOver, NewMatch
from arena.pit.rationed_queue import RationedQueue
from arena.pit.register import Register
from arena.pit.seating import Pairing, Seating
from arena.pit.seats import Client, Seat, SeatBook, SlotId
from arena.protocol.messages import JoinRequest, Signed
from arena.records.journal import NONCE_BYTES, Header
from arena.records.plan import network_name

logger = logging.getLogger(__name__)


class RunningMatch(Protocol):
    """What a pit knows of a match that runs, in whatever process."""

    id: str
    names: list[str]
    """Blue's, and red's."""
    entries: dict[Team, bytes]
    """Public keys of those who play."""

    @property
    def tick(self) -> int:
        """Ticks played so far."""

    def faults(self) -> dict[str, int]:
        """Return what was counted of both seats."""


class Sessions(Protocol):
    """Who referees the matches of a pit: `MatchSessions`, in this process, or `RemoteSessions`, in workers."""

    @property
    def running(self) -> Collection[RunningMatch]:
        """Those that are not over, in the order of their beginning."""

    @property
    def has_closing(self) -> bool:
        """Whether a match waits for its receipts."""

    def take_lane(self, now_s: float) -> int:
        """Return a lane for the next match."""

    def begin(self, new: NewMatch, now_s: float) -> list[Effect]:
        """Begin a match."""

    def resume(self, found: UnfinishedFound, lane: int, now_s: float) -> list[Effect]:
        """Take up an unfinished match at its very tick; nothing is done if its journal does not hold."""

    def receive(self, event: ActionReceived, now_s: float) -> list[Effect]:
        """Take a message on a seat's key."""

    def receive_bundle(self, event: BundleReceived, now_s: float) -> list[Effect]:
        """Take messages of seats of one client."""

    @property
    def holds_bundles(self) -> bool:
        """Whether something was gathered for clients."""

    def take_bundles(self, now_s: float) -> list[Effect]:
        """Return all that was gathered, to be sent now."""

    def advance(self, now_s: float) -> list[Effect]:
        """Let time pass."""

    def issue_ticket(self, seat: Seat, pending: PendingRequest, now_s: float) -> list[Effect]:
        """Give a seat of a running match to who asks for it, under new keys."""

    def leave(self, seat: Seat, now_s: float) -> list[Effect]:
        """Note that the process which held a seat is gone."""

    def forfeit(self, seat: Seat, why: str, now_s: float) -> list[Effect]:
        """Have a seat forfeit its match, unless that is over."""

    def void(self, match: str, why: str, now_s: float) -> list[Effect]:
        """End a match by a fault that is no seat's; nothing is done if it does not run."""

    def give_up_unready(self, now_s: float) -> list[Effect]:
        """Void the match whose seats take longest to get ready, if that is too long: who never plays must not keep others out."""

    def stop(self, now_s: float) -> list[Effect]:
        """Sign the journals of matches that are over, and leave the others as they stand."""


MakeSessions = Callable[[Callable[[MatchOver], list[Effect]], Callable[[MatchClosed], list[Effect]]], Sessions]
"""From what is to be done once a match is over, and once its journal is closed."""


class Matches:
    """The matches of a pit, and who sits where."""

    def __init__(
        self, context: PitContext, ruleset: Ruleset, seating: Seating, register: Register, make_sessions: MakeSessions
    ) -> None:
        self._context, self._ruleset = context, ruleset
        self._seating, self._register = seating, register
        self._sessions = make_sessions(self._on_over, self._on_closed)
        self._seats = SeatBook()
        self._endings: OrderedDict[str, Signed] = OrderedDict()
        """Of matches that are over, the last ones: for a client that was away when the ending was sent."""
        self._archive = Archive(self._is_fixture_over)
        self.n_begun = 0

        self.receive, self.advance = self._sessions.receive, self._sessions.advance
        self.receive_bundle, self.take_bundles = self._sessions.receive_bundle, self._sessions.take_bundles
        self.forfeit, self.void = self._sessions.forfeit, self._sessions.void
        self.give_up_unready, self.stop = self._sessions.give_up_unready, self._sessions.stop
        self.ask_for_journal = self._archive.answer

    @property
    def running(self) -> Collection[RunningMatch]:
        """Those that are not over, in the order of their beginning."""
        return self._sessions.running

    @property
    def holds_bundles(self) -> bool:
        """Whether something was gathered for clients."""
        return self._sessions.holds_bundles

    @property
    def journal_replies(self) -> RationedQueue[ReplyWithJournal]:
        """Pieces of journals that are to be sent."""
        return self._archive.replies

    @property
    def has_closing(self) -> bool:
        """Whether a match waits for its receipts."""
        return self._sessions.has_closing

    def begin(self, pairing: Pairing, now_s: float) -> tuple[str, list[Effect]]:
        """Begin a match, whose seats are held from now on; return what it is called on the network."""
        plan = pairing.plan
        header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=self._ruleset, keys=plan.keys)
        entries = {team: slot.entry for team, slot in pairing.slots.items()}
        nonce, lane = secrets.token_bytes(NONCE_BYTES), self._sessions.take_lane(now_s)
        match = network_name(header.identity, self._context.identity.public, nonce)
        effects = self._sessions.begin(NewMatch(header=header, entries=entries, nonce=nonce, lane=lane), now_s)
        for team, slot in pairing.slots.items():
            self._seats.take(Seat(match, team), slot)
        self.n_begun += 1
        facts = {"event": "match begins", "match": match, "identity": plan.identity, "blue": plan.blue, "red": plan.red}
        logger.info("match %s begins: blue %s, red %s", header.identity, header.blue, header.red, extra={"facts": facts})
        return match, effects

    def resume(self, found: UnfinishedFound, now_s: float) -> list[Effect]:
        """Take up an unfinished match at its very tick; nothing is done if its journal does not hold."""
        return self._sessions.resume(found, self._sessions.take_lane(now_s), now_s)

    # Seats

    @property
    def holders(self) -> set[Client]:
        """The clients that hold seats."""
        return self._seats.holders

    def find_seat(self, slot: SlotId, request: JoinRequest) -> Seat | None:
        """Return the seat that a slot holds, or else one that the same entry has left, the slot's own first, if any."""
        held = self._seats.find(slot)
        return held or max(self._find_vacant(request), key=lambda seat: self._seats.was_held_by(seat, slot), default=None)

    def issue_ticket(self, seat: Seat, slot: SlotId, pending: PendingRequest, now_s: float) -> list[Effect]:
        """Give a seat of a running match to who asks for it, under new keys."""
        self._seats.take(seat, slot)
        return self._sessions.issue_ticket(seat, pending, now_s)

    def seats_of(self, entry: bytes | None, name: str) -> list[Seat]:
        """Return the seats of running matches that belong to a public key, or to a name."""
        return [
            Seat(one.id, team) for one in self.running for team in Team if one.names[team] == name or one.entries[team] == entry
        ]

    def entry_of(self, name: str) -> bytes | None:
        """Return the public key that plays under a name, if any."""
        return next((one.entries[team] for one in self.running for team in Team if one.names[team] == name), None)

    def lose(self, client: str, now_s: float) -> list[Effect]:
        """Note that a client process is gone; its seats are vacant."""
        return [effect for seat in self._seats.leave_all(client) for effect in self._sessions.leave(seat, now_s)]

    def find_ending(self, match: str) -> Signed | None:
        """Return how a match ended, if it was one of the last."""
        return self._endings.get(match)

    def _find_vacant(self, request: JoinRequest) -> Iterable[Seat]:
        if self._seats.n_held == len(Team) * len(self.running):
            return ()
        return (
            seat
            for one in self.running
            for team in Team
            if one.entries[team] == request.entry
            and one.names[team] == request.name
            and request.team in ("any", team.name.lower())
            and not self._seats.is_held(seat := Seat(one.id, team))
        )

    # Endings

    def _on_over(self, over: MatchOver) -> list[Effect]:
        """Note how a match ended; whoever played it to its end has a claim to its name."""
        header, result = over.ended.header, over.ended.result
        self._endings[over.match] = over.ending
        if len(self._endings) > MOST_KEPT:
            self._endings.popitem(last=False)
        if result.ticks and result.ending is not Termination.VOID:
            for team, name in zip(Team, (header.blue, header.red), strict=True):
                self._register.claim(name, over.ended.entries[team])
        self._seats.forget(over.match)
        self._archive.expect(over.match)
        return [over.ended]

    def _on_closed(self, closed: MatchClosed) -> list[Effect]:
        """Give out the journal of a match; it may be seen once its whole fixture is over."""
        return self._archive.add(closed.match, closed.header)

    def _is_fixture_over(self, names: set[str]) -> bool:
        is_running = any(set(one.names) == names for one in self.running)
        return not is_running and not self._seating.is_planned(names)
