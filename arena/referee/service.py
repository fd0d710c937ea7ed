"""The referee on the network: one thread that owns every match, fed by a bounded queue.

Zenoh's callbacks put into the queue and do nothing else. What a tick changes is handed to the system, as its journal's next
record, before anybody is told of it.
"""

import logging
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from arena.errors import ArenaError, JournalError, UnreadableError
from arena.game.ruleset import Ruleset, to_dict
from arena.game.types import RULES_VERSION, Team
from arena.policy import MatchResult
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.messages import (
    PROTOCOL_VERSION,
    Closed,
    Ended,
    Facts,
    History,
    JoinRequest,
    Lobby,
    Message,
    Orders,
    Ready,
    Refusal,
    Ticket,
    Turn,
    Wait,
)  # fmt: skip
from arena.protocol.sealing import OpenSeal
from arena.referee.journal import Header, journal_name, read_journal, whole_part
from arena.referee.match import Ask, End, Event, Match, Publish, SeatRecord, Terms, Write
from arena.referee.seating import Pairing, SeatId, Seating
from arena.transport import Put, Question, Session

logger = logging.getLogger(__name__)

MOST_WAITING = 10_000
"""Messages in the queue; what comes beyond is dropped, and asked for again."""
HOLD_QUESTION_S = 4.0
"""How long a client that waits for a seat is kept without an answer."""
FORGET_WAITING_S = 15.0
"""How long a seat stays reserved for a client that does not ask again."""
MOST_SLOTS = 256
"""Seats that one client process may ask for at once."""
MOST_GUESTS = 4_096
"""Clients that may wait for a seat at once."""
MOST_RUNNING = 256
"""Matches at once; each costs an open file."""
_SWEEP_S = 0.01
_MOST_LISTED = 200
"""Matches, and guests, that the lobby names."""
_HISTORY_BYTES = 50_000


@dataclass(slots=True)
class _Chair:
    """A seat of a running match on the network."""

    name: str
    holder: SeatId | None
    """None after a restart of the pit, until somebody comes back."""
    put: Put
    end: Callable[[], None]
    seal: OpenSeal = field(default_factory=OpenSeal)
    has_left: bool = False
    """Its holder's process has vanished; another of the same name may take the seat."""


@dataclass(slots=True)
class _Table:
    """A running match, who sits at it, and its journal."""

    id: str
    match: Match
    chairs: dict[Team, _Chair]
    publish: Put
    end_publish: Callable[[], None]
    journal: int
    """File descriptor."""


@dataclass(slots=True)
class _Guest:
    """A client that waits for a seat."""

    request: JoinRequest
    question: Question | None
    asked_at_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """A match that ended on the network."""

    header: Header
    result: MatchResult
    """`score` is blue's."""
    seats: dict[Team, SeatRecord]


class Referee:
    """All matches of a pit."""

    def __init__(
        self,
        session: Session,
        pit: str,
        ruleset: Ruleset,
        seating: Seating,
        terms: Terms,
        journals: Path,
        *,
        on_end: Callable[[Played], None],
        fsync: bool = False,
    ) -> None:
        self._session, self._pit, self._ruleset = session, pit, ruleset
        self._seating, self._terms, self._journals = seating, terms, journals
        self._on_end, self._fsync = on_end, fsync
        self._inbox: SimpleQueue[tuple[Callable[..., None], tuple[Any, ...]]] = SimpleQueue()
        self._tables: dict[str, _Table] = {}
        self._held: dict[SeatId, tuple[str, Team]] = {}
        self._guests: dict[SeatId, _Guest] = {}
        self._is_stopping = False
        self.n_dropped = 0
        self._n_begun = 0
        journals.mkdir(parents=True, exist_ok=True)
        session.watch_presence(topics.all_presence(pit), self._enqueue(self._on_presence))
        session.subscribe(topics.all_actions(pit), self._enqueue(self._on_action))
        session.answer(topics.join(pit), self._enqueue(self._on_join))
        session.answer(topics.lobby(pit), self._enqueue(self._on_lobby))

    @property
    def n_running(self) -> int:
        """Matches that are not over."""
        return len(self._tables)

    @property
    def matches(self) -> list[Match]:
        """The matches that are not over, in the order of their beginning."""
        return [table.match for table in self._tables.values()]

    def _enqueue(self, handle: Callable[..., None]) -> Callable[..., None]:
        """Return a callback that leaves its arguments for the one thread."""
        inbox = self._inbox

        def on_any(*arguments: Any) -> None:
            if inbox.qsize() < MOST_WAITING:
                inbox.put((handle, arguments))
            else:
                self.n_dropped += 1

        return on_any

    def stop(self) -> None:
        """Leave `run` as soon as its thread notices; from any thread, or a signal."""
        self._is_stopping = True

    def run(self, until: Callable[[], bool]) -> None:
        """Referee until `until()`, asked every hundredth of a second, or until `stop`."""
        next_sweep_s = 0.0
        while not self._is_stopping:
            try:
                handle, arguments = self._inbox.get(timeout=_SWEEP_S)
                handle(*arguments)
            except Empty:
                pass
            now_s = time.monotonic()
            if now_s >= next_sweep_s:
                # What has come by now counts as come by now, however long the queue: the pit's own delay is charged to nobody.
                for _ in range(self._inbox.qsize()):
                    handle, arguments = self._inbox.get()
                    handle(*arguments)
                next_sweep_s = now_s + _SWEEP_S
                self._sweep(now_s)
                if until():
                    return

    def close(self) -> None:
        """Put every journal down as it stands: a later referee can resume the matches."""
        for table in self._tables.values():
            os.close(table.journal)
        self._tables.clear()

    def resume(self, wanted: Callable[[str], bool]) -> list[str]:
        """Take up the unfinished matches whose identity is wanted; return their identities."""
        resumed = []
        for path in sorted(self._journals.glob("*.journal")):
            try:
                data = path.read_bytes()
                if read_journal(data).ending is not None:
                    continue
            except JournalError:
                pass
            try:
                whole = whole_part(data)
                journal = read_journal(whole)
            except JournalError as error:
                logger.warning("%s cannot be resumed: %s", path.name, error)
                continue
            if not wanted(journal.header.identity):
                continue
            match = Match(journal.header, self._terms, time.monotonic())
            try:
                events = match.recover(journal)
            except JournalError as error:
                logger.warning("%s cannot be resumed: %s", path.name, error)
                continue
            descriptor = os.open(path, os.O_WRONLY | os.O_APPEND)
            os.ftruncate(descriptor, len(whole))
            table = self._seat(match, dict.fromkeys(Team), descriptor)
            self._carry_out(table, events)
            logger.info("resumed %s at tick %d", journal.header.identity, match.tick)
            resumed.append(journal.header.identity)
        return resumed

    # What is heard

    def _on_presence(self, key: str, is_there: bool) -> None:
        client = topics.read_presence(key)
        if is_there:
            return
        now_s = time.monotonic()
        for seat in [seat for seat in self._guests if seat[0] == client]:
            self._forget_guest(seat)
        for seat in [seat for seat in self._held if seat[0] == client]:
            match_id, team = self._held.pop(seat)
            table = self._tables[match_id]
            table.chairs[team].has_left = True
            self._carry_out(table, table.match.leave(team, now_s))

    def _on_action(self, key: str, payload: bytes) -> None:
        try:
            match_id, team = topics.read_action(key)
        except UnreadableError:
            return
        table = self._tables.get(match_id)
        if table is None:
            return
        chair = table.chairs[team]
        try:
            message = decode(chair.seal.open(payload))
        except UnreadableError:
            table.match.garble(team)
            return
        if type(message) is Orders:
            self._carry_out(table, table.match.submit(team, message.tick, message.actions, time.monotonic()))
        elif type(message) is Ready:
            self._send_history(table, team, message.known_ticks)
            self._carry_out(table, table.match.ready(team, time.monotonic()))
        else:
            table.match.garble(team)

    def _on_join(self, question: Question) -> None:
        try:
            request = decode(question.payload)
        except UnreadableError as error:
            question.answer(encode(Refusal(reason=f"the request cannot be read: {error}")))
            return
        refusal = self._object_to(request)
        if refusal or not isinstance(request, JoinRequest):
            question.answer(encode(Refusal(reason=refusal or "this is no request for a seat")))
            return
        seat = (request.client, request.slot)
        held = self._held.get(seat) or self._vacancy(seat, request)
        if held is not None:
            match_id, team = held
            if seat in self._guests:
                self._forget_guest(seat)
            self._take(self._tables[match_id], team, seat)
            question.answer(encode(self._ticket(self._tables[match_id], team)))
            return
        if request.match:
            question.answer(encode(Wait(reason="for another match, since that one is over")))
            return
        before = self._guests.get(seat)
        if before is not None and before.question is not None:
            before.question.answer(encode(Wait(reason="for an opponent")))
        if before is None and len(self._guests) >= MOST_GUESTS:
            question.answer(encode(Refusal(reason=f"{MOST_GUESTS} clients wait already; come again later")))
            return
        self._guests[seat] = _Guest(request, question, time.monotonic())
        if len(self._tables) >= MOST_RUNNING:
            return  # it hears Wait in time, and asks again
        answer = self._seating.place(seat, request)
        if isinstance(answer, Pairing):
            self._begin(answer)
        elif not isinstance(answer, Wait):
            self._forget_guest(seat)
            question.answer(encode(answer))

    def _on_lobby(self, question: Question) -> None:
        running = [
            {"match": table.id, "blue": table.match.header.blue, "red": table.match.header.red, "tick": table.match.tick}
            for table in self._tables.values()
        ]
        lobby = Lobby(
            pit=self._pit,
            rules=self._ruleset.name,
            rules_hash=self._ruleset.hash,
            n_begun=self._n_begun,
            running=running[:_MOST_LISTED],
            waiting=[guest.request.name for guest in self._guests.values()][:_MOST_LISTED],
        )
        question.answer(encode(lobby))

    def _object_to(self, request: Message) -> str:
        """Return why a request cannot be met whatever seats are free, or nothing."""
        if not isinstance(request, JoinRequest):
            return "this is no request for a seat"
        if request.version != PROTOCOL_VERSION:
            return f"the client speaks version {request.version} of the protocol, the pit {PROTOCOL_VERSION}; install the same"
        if request.rules_version != RULES_VERSION:
            return f"the client knows version {request.rules_version} of the rules, the pit {RULES_VERSION}; install the same"
        if request.rules_hash and request.rules_hash != self._ruleset.hash:
            ours, theirs = self._ruleset.hash[:12], request.rules_hash[:12]
            return f"the pit plays ruleset {self._ruleset.name} ({ours}), the client wants {theirs}"
        if request.team not in ("red", "blue", "any"):
            return f"there is no team {request.team!r}; red, blue or any"
        if not topics.is_chunk(request.name) or not topics.is_chunk(request.client):
            return "a name is 1 to 64 letters, digits, - or _"
        if not 0 <= request.slot < MOST_SLOTS:
            return f"there is no slot {request.slot}; a client has slots 0 to {MOST_SLOTS - 1}"
        return ""

    def _vacancy(self, seat: SeatId, request: JoinRequest) -> tuple[str, Team] | None:
        """Return the seat of a running match that the same entry has left, the asker's own first, if there is one."""
        vacant = [
            (table.id, team)
            for table in self._tables.values()
            for team, chair in table.chairs.items()
            if chair.name == request.name and request.team in ("any", team.name.lower()) and chair.holder not in self._held
        ]
        own = [place for place in vacant if self._tables[place[0]].chairs[place[1]].holder == seat]
        return next(iter(own + vacant), None)

    # What is done

    def _begin(self, pairing: Pairing) -> None:
        self._n_begun += 1
        plan = pairing.plan
        header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=self._ruleset, keys=plan.keys)
        match = Match(header, self._terms, time.monotonic())
        path = self._journals / journal_name(header.identity)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o600)
        _append(descriptor, match.start_record)
        table = self._seat(match, pairing.seats, descriptor)
        logger.info("match %s begins: blue %s, red %s", header.identity, header.blue, header.red)
        for team, seat in pairing.seats.items():
            guest = self._guests.pop(seat)
            if guest.question is not None:
                guest.question.answer(encode(self._ticket(table, team)))

    def _seat(self, match: Match, seats: Any, journal: int) -> _Table:
        """Set up the network side of a match."""
        header = match.header
        match_id = sha256(header.identity.encode()).hexdigest()[:16]
        chairs = {}
        for team, name in zip(Team, (header.blue, header.red), strict=True):
            put, end = self._session.publisher(topics.observation(self._pit, match_id, team))
            chairs[team] = _Chair(name, seats[team], put, end)
        publish, end_publish = self._session.publisher(topics.public(self._pit, match_id))
        table = _Table(match_id, match, chairs, publish, end_publish, journal)
        self._tables[match_id] = table
        for team, seat in seats.items():
            if seat is not None:
                self._held[seat] = (match_id, team)
        return table

    def _take(self, table: _Table, team: Team, seat: SeatId) -> None:
        """Give a seat to the client that asks for it, from whichever process held it before."""
        chair = table.chairs[team]
        if chair.holder is not None:
            self._held.pop(chair.holder, None)
        chair.holder, chair.has_left = seat, False
        self._held[seat] = (table.id, team)

    def _ticket(self, table: _Table, team: Team) -> Ticket:
        ruleset = table.match.header.ruleset
        rules = {"name": ruleset.name, **to_dict(ruleset)}
        return Ticket(
            match=table.id, team=int(team), ruleset=rules, opponent=table.chairs[team.other].name,
            turn_time_s=self._terms.turn_time_s, bank_s=self._terms.bank_s, tick=table.match.tick,
        )  # fmt: skip

    def _send(self, table: _Table, team: Team, message: Message) -> None:
        chair = table.chairs[team]
        chair.put(chair.seal.close(encode(message)))

    def _send_history(self, table: _Table, team: Team, known_ticks: int) -> None:
        """Send what a seat was shown before it came back, in pieces that fit a message."""
        observations, orders = table.match.history(team, max(known_ticks, 0))
        if not observations:
            return
        step = max(1, _HISTORY_BYTES // (len(observations[0]) + len(orders[0]) + 8))
        for first in range(0, len(observations), step):
            piece = slice(first, first + step)
            self._send(
                table,
                team,
                History(first_tick=max(known_ticks, 0) + first, observations=observations[piece], orders=orders[piece]),
            )

    def _carry_out(self, table: _Table, events: Iterable[Event]) -> None:
        for event in events:
            if type(event) is Ask:
                self._send(table, event.team, Turn(tick=event.tick, observation=event.observation))
            elif type(event) is Write:
                _append(table.journal, event.data)
                if self._fsync:
                    os.fdatasync(table.journal)
            elif type(event) is Publish:
                blue, red, score = table.match.facts
                table.publish(encode(Facts(tick=table.match.tick, living=[blue, red], score=score)))
            elif type(event) is End:
                self._finish(table, event.result)

    def _finish(self, table: _Table, result: MatchResult) -> None:
        match = table.match
        seats = {team: match.record(team) for team in Team}
        ended = Ended(
            ending=result.ending.name.lower(),
            winner=None if result.winner is None else result.winner.name.lower(),
            score=result.score,
            ticks=result.ticks,
            reason=result.reason,
            faults={team.name.lower(): seat.faults() for team, seat in seats.items()},
        )
        for team in Team:
            self._send(table, team, ended)
        table.publish(encode(ended))
        os.close(table.journal)
        for chair in table.chairs.values():
            if chair.holder is not None:
                self._held.pop(chair.holder, None)
            chair.end()
        table.end_publish()
        del self._tables[table.id]
        logger.info("match %s: %s, winner %s", match.header.identity, ended.ending, ended.winner)
        self._on_end(Played(header=match.header, result=result, seats=seats))

    def _sweep(self, now_s: float) -> None:
        """Let time pass for everyone."""
        for table in list(self._tables.values()):
            self._carry_out(table, table.match.advance(now_s))
        for seat, guest in list(self._guests.items()):
            waited_s = now_s - guest.asked_at_s
            if guest.question is not None and (waited_s >= HOLD_QUESTION_S or self._seating.is_done):
                answer = (
                    Closed(reason="the pit begins no more matches") if self._seating.is_done else Wait(reason="for an opponent")
                )
                guest.question.answer(encode(answer))
                guest.question = None
                if self._seating.is_done:
                    self._forget_guest(seat)
            elif waited_s >= FORGET_WAITING_S:
                self._forget_guest(seat)

    def _forget_guest(self, seat: SeatId) -> None:
        self._guests.pop(seat, None)
        self._seating.forget(seat)


def _append(journal: int, data: bytes) -> None:
    """Write to a journal all or nothing; what cannot be written ends the pit before anybody hears of it."""
    try:
        n_written = os.write(journal, data)
    except OSError as error:
        raise ArenaError(f"cannot write a journal: {error.strerror}") from error
    if n_written != len(data):
        raise ArenaError("cannot write a journal: the disk is full")
