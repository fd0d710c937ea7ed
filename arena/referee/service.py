"""The referee on the network: one thread that owns every match, fed by a bounded queue.

Zenoh's callbacks put into the queue and do nothing else. What a tick changes is handed to the system, as its journal's next
record, before anybody is told of it.
"""

import logging
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from arena.errors import UnreadableError
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.policy import MatchResult
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.messages import (
    Closed,
    JoinRequest,
    Lobby,
    Orders,
    Ready,
    Refusal,
    Wait,
)  # fmt: skip
from arena.referee.journal import Header, journal_name
from arena.referee.match import Ask, End, Event, Match, Publish, SeatRecord, Terms, Write
from arena.referee.resume import resume_matches
from arena.referee.seating import Pairing, SeatId, Seating, object_to
from arena.referee.table import Table
from arena.transport import Question, Sample, Session, read_key, read_payload

logger = logging.getLogger(__name__)

MOST_WAITING = 10_000
"""Messages in the queue; what comes beyond is dropped, and asked for again."""
HOLD_QUESTION_S = 4.0
"""How long a client that waits for a seat is kept without an answer."""
FORGET_WAITING_S = 15.0
"""How long a seat stays reserved for a client that does not ask again."""
MOST_GUESTS = 4_096
"""Clients that may wait for a seat at once."""
MOST_RUNNING = 256
"""Matches at once; each costs an open file."""
_SWEEP_S = 0.01
_MOST_LISTED = 200
"""Matches, and guests, that the lobby names."""


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
        self._tables: dict[str, Table] = {}
        self._held: dict[SeatId, tuple[str, Team]] = {}
        self._guests: dict[SeatId, _Guest] = {}
        self._present: set[str] = set()
        self._is_stopping = False
        self.n_dropped = 0
        self._n_begun = 0
        journals.mkdir(parents=True, exist_ok=True)
        session.watch_presence(topics.all_presence(pit), self._enqueue(self._on_presence))
        self._actions = session.collect(topics.all_actions(pit), MOST_WAITING)
        self._end_beat = session.beat(topics.beat(pit), _SWEEP_S)
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

    @property
    def is_deserted(self) -> bool:
        """Whether no client is there, as far as they say so."""
        return not self._present

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
            self._on_action(self._actions.wait())  # at the latest when the session's own beat comes
            now_s = time.monotonic()
            if now_s >= next_sweep_s:
                # What has come by now counts as come by now, however long the queue: the pit's own delay is charged to nobody.
                for _ in range(MOST_WAITING):
                    sample = self._actions.take()
                    if sample is None:
                        break
                    self._on_action(sample)
                for _ in range(self._inbox.qsize()):
                    handle, arguments = self._inbox.get()
                    handle(*arguments)
                next_sweep_s = now_s + _SWEEP_S
                self._sweep(now_s)
                if until():
                    return

    def close(self) -> None:
        """Put every match down as it stands: a later referee can resume it."""
        self._end_beat()
        for table in self._tables.values():
            table.put_down()
        self._tables.clear()

    def resume(self, wanted: Callable[[str], bool]) -> list[str]:
        """Take up the unfinished matches whose identity is wanted; return their identities."""
        resumed = []
        for match, events, journal in resume_matches(self._journals, self._terms, time.monotonic(), wanted):
            table = self._seat(match, dict.fromkeys(Team), journal)
            self._carry_out(table, events)
            resumed.append(match.header.identity)
        return resumed

    # What is heard

    def _on_presence(self, key: str, is_there: bool) -> None:
        client = topics.read_presence(key)
        if is_there:
            if len(self._present) < MOST_GUESTS:
                self._present.add(client)
            return
        self._present.discard(client)
        now_s = time.monotonic()
        for seat in [seat for seat in self._guests if seat[0] == client]:
            self._forget_guest(seat)
        for seat in [seat for seat in self._held if seat[0] == client]:
            match_id, team = self._held.pop(seat)
            table = self._tables[match_id]
            self._carry_out(table, table.match.leave(team, now_s))

    def _on_action(self, sample: Sample) -> None:
        try:
            match_id, team = topics.read_action(read_key(sample))
        except UnreadableError:
            return
        table = self._tables.get(match_id)
        if table is None:
            return
        chair = table.chairs[team]
        try:
            message = decode(chair.seal.open(read_payload(sample)))
        except UnreadableError:
            table.match.garble(team)
            return
        if type(message) is Orders:
            self._carry_out(table, table.match.submit(team, message.tick, message.actions, time.monotonic()))
        elif type(message) is Ready:
            table.send_history(team, message.known_ticks)
            self._carry_out(table, table.match.ready(team, time.monotonic()))
        else:
            table.match.garble(team)

    def _on_join(self, question: Question) -> None:
        try:
            request = decode(question.payload)
        except UnreadableError as error:
            question.answer(encode(Refusal(reason=f"the request cannot be read: {error}")))
            return
        refusal = object_to(request, self._ruleset)
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
            question.answer(encode(self._tables[match_id].ticket(team)))
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
        matches = [(table.id, table.match) for table in self._tables.values()]
        running = [{"match": id, "blue": m.header.blue, "red": m.header.red, "tick": m.tick} for id, m in matches]
        lobby = Lobby(
            pit=self._pit,
            rules=self._ruleset.name,
            rules_hash=self._ruleset.hash,
            n_begun=self._n_begun,
            running=running[:_MOST_LISTED],
            waiting=[guest.request.name for guest in self._guests.values()][:_MOST_LISTED],
        )
        question.answer(encode(lobby))

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
        table = self._seat(match, {team: pairing.seats[team] for team in Team}, descriptor)
        table.write(match.start_record)
        logger.info("match %s begins: blue %s, red %s", header.identity, header.blue, header.red)
        for team, seat in pairing.seats.items():
            guest = self._guests.pop(seat)
            if guest.question is not None:
                guest.question.answer(encode(table.ticket(team)))

    def _seat(self, match: Match, holders: dict[Team, SeatId | None], journal: int) -> Table:
        """Set up the network side of a match."""
        table = Table(self._session, self._pit, match, holders, journal, fsync=self._fsync)
        self._tables[table.id] = table
        self._held |= {seat: (table.id, team) for team, seat in holders.items() if seat is not None}
        return table

    def _take(self, table: Table, team: Team, seat: SeatId) -> None:
        """Give a seat to the client that asks for it, from whichever process held it before."""
        chair = table.chairs[team]
        if chair.holder is not None:
            self._held.pop(chair.holder, None)
        chair.holder = seat
        self._held[seat] = (table.id, team)

    def _carry_out(self, table: Table, events: Iterable[Event]) -> None:
        for event in events:
            if type(event) is Ask:
                table.ask(event)
            elif type(event) is Write:
                table.write(event.data)
            elif type(event) is Publish:
                table.publish_facts()
            elif type(event) is End:
                self._finish(table, event.result)

    def _finish(self, table: Table, result: MatchResult) -> None:
        match = table.match
        table.end(result)
        for chair in table.chairs.values():
            if chair.holder is not None:
                self._held.pop(chair.holder, None)
        del self._tables[table.id]
        logger.info("match %s: %s, winner %s", match.header.identity, result.ending.name.lower(), result.winner)
        self._on_end(Played(header=match.header, result=result, seats={team: match.record(team) for team in Team}))

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
