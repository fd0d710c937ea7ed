"""Where clients come in: who knocks is let in or refused, waits for an opponent, and is seated; the operator is obeyed.

Opening a request costs a good part of a turn, so that only a share of the time goes to them: a flood of strangers slows those who
want to come in, and no match.
"""

import time
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from arena.errors import ForgedError, ProtocolError
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.network.session import Query
from arena.pit.authenticator import Authenticator
from arena.pit.match_session import MatchSession
from arena.pit.register import Register
from arena.pit.seating import Pairing, SeatId, Seating, object_to
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Caller
from arena.protocol.messages import AdminRequest, Closed, Done, Hello, JoinRequest, Knock, Message, Refusal, Signed, Wait

HOLD_QUESTION_S = 4.0
"""How long a client that waits for a seat is kept without an answer."""
FORGET_WAITING_S = 15.0
"""How long a seat stays reserved for a client that does not ask again."""
MOST_GUESTS = 4_096
"""Clients that may wait for a seat at once."""
MOST_KNOCKS = 128
"""Requests that wait to be opened; what comes beyond is dropped, and asked again."""
MOST_RUNNING = 256
"""Matches at once; each costs an open file."""
PATIENCE_S = 1.0
"""How long seats may take to get ready, while others wait for room."""
_SHARE = 0.3
"""Of the time, while matches run."""
_MOST_SAVED_S = 0.02
"""As much of it can be saved up, or spent before it has come, as the beginning of a match does."""


@dataclass(slots=True)
class PendingRequest:
    """Somebody who knocked, and hears the answer."""

    caller: Caller
    question: Query

    def answer(self, message: Message) -> None:
        """Answer; nobody who gave no key to answer to is waited for."""
        try:
            self.question.answer(self.caller.answer(message))
        except ForgedError:
            self.question.drop()


@dataclass(slots=True)
class QueuedClient:
    """A client that waits for a seat."""

    request: JoinRequest
    visitor: PendingRequest | None
    """None once it was told to wait, until it asks again."""
    asked_at_s: float


class Floor(Protocol):
    """What the reception needs of the referee."""

    tables: dict[str, MatchSession]
    held: dict[SeatId, tuple[str, Team]]
    endings: OrderedDict[str, Signed]
    """Of matches that are over, the last ones: for a client that was away when it was told."""

    def hear_orders(self) -> None:
        """Take what the seats have said by now."""

    def begin(self, pairing: Pairing, entries: dict[Team, bytes]) -> MatchSession:
        """Begin a match."""

    def take_away(self, table: MatchSession, team: Team, why: str) -> None:
        """Have a seat forfeit its match."""

    def abort(self, table: MatchSession, why: str) -> None:
        """End a match by a fault that is no seat's."""


class Admission:
    """All who are not seated yet."""

    def __init__(self, floor: Floor, door: Authenticator, register: Register, ruleset: Ruleset, seating: Seating) -> None:
        self._floor, self._door, self.register = floor, door, register
        self._ruleset, self._seating = ruleset, seating
        self._knocks: deque[tuple[Query, bytes]] = deque()
        self.guests: dict[SeatId, QueuedClient] = {}
        self._served_at_s, self._saved_s = time.monotonic(), 0.0
        self.n_refused = 0
        """Requests that were not opened, or not signed by whom they name."""

    def hear(self, question: Query) -> None:
        """Take a question; what costs nothing is answered at once."""
        try:
            message = decode(question.payload)
        except ProtocolError as error:
            question.answer(encode(Refusal(reason=f"the request cannot be read: {error}")))
            return
        if isinstance(message, Hello):
            question.answer(self._door.challenge(time.monotonic()))
        elif not isinstance(message, Knock):
            question.answer(encode(Refusal(reason="this is no request for a seat")))
        elif len(self._knocks) < MOST_KNOCKS:
            self._knocks.append((question, question.payload))
        else:
            question.drop()

    def serve(self) -> None:
        """Open requests that wait, for a share of the time that has passed."""
        now_s = time.monotonic()
        self._saved_s = min(self._saved_s + _SHARE * (now_s - self._served_at_s), _MOST_SAVED_S)
        self._served_at_s = now_s
        while self._knocks and (self._saved_s > 0 or not self._floor.tables):
            self._floor.hear_orders()  # a turn waits for one request at most
            begun_s = time.monotonic()
            self._open(*self._knocks.popleft())
            self._saved_s = max(self._saved_s - (time.monotonic() - begun_s), -_MOST_SAVED_S)

    def _open(self, question: Query, payload: bytes) -> None:
        try:
            caller = self._door.open(payload, time.monotonic())
        except ProtocolError as error:
            self.n_refused += 1
            question.answer(encode(Refusal(reason=str(error))))
            return
        visitor = PendingRequest(caller, question)
        if isinstance(caller.request, AdminRequest):
            visitor.answer(self._obey(caller.request))
        else:
            self._receive(visitor, caller.request)

    def _receive(self, visitor: PendingRequest, request: JoinRequest) -> None:
        """Seat an entry, or have it wait, or refuse it."""
        refusal = object_to(request, self._ruleset) or self.register.object_to(request)
        if refusal:
            visitor.answer(Refusal(reason=refusal))
            return
        self.register.admit(request)
        seat = SeatId(request.entry, request.client, request.slot)
        held = self._floor.held.get(seat) or self._vacancy(seat, request)
        if held is not None:
            self._forget(seat)
            match, team = held
            self._sit(self._floor.tables[match], team, seat, visitor)
        elif request.match:
            ending = self._floor.endings.get(request.match)
            visitor.answer(ending or Wait(reason="for another match, since that one is over"))
        else:
            self._place(seat, visitor, request)

    def _place(self, seat: SeatId, visitor: PendingRequest, request: JoinRequest) -> None:
        before = self.guests.get(seat)
        if before is not None and before.visitor is not None:
            before.visitor.answer(Wait(reason="for an opponent"))
        if before is None and len(self.guests) >= MOST_GUESTS:
            visitor.answer(Refusal(reason=f"{MOST_GUESTS} clients wait already; come again later"))
            return
        self.guests[seat] = QueuedClient(request, visitor, time.monotonic())
        if len(self._floor.tables) >= MOST_RUNNING and not self._make_room():
            return  # it hears Wait in time, and asks again
        answer = self._seating.place(seat, request)
        if isinstance(answer, Pairing):
            self._begin(answer)
        elif not isinstance(answer, Wait):
            self._forget(seat)
            visitor.answer(answer)

    def _begin(self, pairing: Pairing) -> None:
        """Begin a match, and seat those of its guests who are asking just now; the others ask again in a moment."""
        entries = {team: guest.request.entry for team, at in pairing.seats.items() if (guest := self.guests.get(at))}
        table = self._floor.begin(pairing, entries)
        for team, at in pairing.seats.items():
            guest = self.guests.pop(at)
            if guest.visitor is not None:
                self._sit(table, team, at, guest.visitor)

    def _make_room(self) -> bool:
        """Give up the match whose seats have taken longest to get ready: strangers who never play must not keep others out."""
        oldest = max(self._floor.tables.values(), key=lambda table: table.match.unready_s(time.monotonic()))
        if oldest.match.unready_s(time.monotonic()) < PATIENCE_S:
            return False
        self._floor.abort(oldest, "was not ready while others waited for room")
        return True

    def _sit(self, table: MatchSession, team: Team, seat: SeatId, visitor: PendingRequest) -> None:
        """Give a seat to whoever asks for it, with new keys."""
        before = table.chairs[team].holder
        if before is not None:
            self._floor.held.pop(before, None)
        self._floor.held[seat] = (table.id, team)
        visitor.answer(table.seat(team, visitor.caller, seat))

    def _vacancy(self, seat: SeatId, request: JoinRequest) -> tuple[str, Team] | None:
        """Return the seat of a running match that the same entry has left, the asker's own first, if there is one."""
        vacant = [
            (table.id, team)
            for table in self._floor.tables.values()
            for team, chair in table.chairs.items()
            if chair.entry == request.entry
            and chair.name == request.name
            and request.team in ("any", team.name.lower())
            and chair.holder not in self._floor.held
        ]
        own = [place for place in vacant if self._floor.tables[place[0]].chairs[place[1]].holder == seat]
        return next(iter(own + vacant), None)

    def lose(self, client: str) -> None:
        """Forget who waited, since its process is gone."""
        for seat in [seat for seat in self.guests if seat.client == client]:
            self._forget(seat)

    def sweep(self, now_s: float) -> None:
        """Begin what can begin; tell those who have waited for long that they still wait, or that it is of no use."""
        while len(self._floor.tables) < MOST_RUNNING and (pairing := self._seating.pair_up(now_s)) is not None:
            self._begin(pairing)
        for seat, guest in list(self.guests.items()):
            waited_s = now_s - guest.asked_at_s
            if guest.visitor is not None and (waited_s >= HOLD_QUESTION_S or self._seating.is_done):
                is_done = self._seating.is_done
                guest.visitor.answer(
                    Closed(reason="the pit begins no more matches") if is_done else Wait(reason="for an opponent")
                )
                guest.visitor = None
                if is_done:
                    self._forget(seat)
            elif waited_s >= FORGET_WAITING_S:
                self._forget(seat)

    def _forget(self, seat: SeatId) -> None:
        if self.guests.pop(seat, None) is not None:
            self._seating.forget(seat)

    # The operator

    def _obey(self, request: AdminRequest) -> Message:
        """Do what the holder of the pit's key asks for."""
        if request.entry != self._door.identity.public:
            return Refusal(reason="only the holder of the pit's key is obeyed")
        commands: dict[str, Callable[[str], str]] = {
            "kick": self._kick,
            "ban": self._ban,
            "close": self._close,
            "abort": self._abort,
            "release-name": self._release,
        }
        obey = commands.get(request.command)
        if obey is None:
            return Refusal(reason=f"there is no command {request.command!r}; it is one of {', '.join(commands)}")
        text = obey(request.target)
        return Done(text=text) if text else Refusal(reason=f"{request.target} is not here")

    def _kick(self, target: str) -> str:
        """Have an entry forfeit what it plays, and forget that it waits."""
        key = self.register.find(target)

        def is_meant(name: str, entry: bytes) -> bool:
            return target == name or key == entry

        seats = [
            (table, team)
            for table in self._floor.tables.values()
            for team, chair in table.chairs.items()
            if is_meant(chair.name, chair.entry)
        ]
        for table, team in seats:
            if table.id in self._floor.tables:
                self._floor.take_away(table, team, "was removed by the operator")
        waiting = [seat for seat, guest in self.guests.items() if is_meant(guest.request.name, seat.entry)]
        for seat in waiting:
            visitor = self.guests[seat].visitor
            if visitor is not None:
                visitor.answer(Refusal(reason="the operator sent this client away"))
            self._forget(seat)
        return f"{target}: {len(seats)} seats forfeited, {len(waiting)} sent away" if seats or waiting else ""

    def _ban(self, target: str) -> str:
        here = {chair.name: chair.entry for table in self._floor.tables.values() for chair in table.chairs.values()}
        here |= {guest.request.name: seat.entry for seat, guest in self.guests.items()}
        key = here.get(target) or self.register.find(target)
        if key is None:
            return ""
        self.register.ban(target, key)
        return f"{target} is banned; {self._kick(target) or 'it was not here'}"

    def _close(self, target: str) -> str:
        self._seating.close()
        return "the pit begins no more matches"

    def _abort(self, target: str) -> str:
        table = self._floor.tables.get(target)
        if table is None:
            return ""
        self._floor.abort(table, "was ended by the operator")
        return f"match {target} is void"

    def _release(self, target: str) -> str:
        return f"the name {target} is free" if self.register.release(target) else ""
