"""The referee on the network: one thread that owns every match, fed by bounded queues.

Zenoh's callbacks put into the queues and do nothing else. What a tick changes is handed to the system, as its journal's next
record, before anybody is told of it.
"""

import logging
import os
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from arena.errors import ForgedError, UnreadableError
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.match.effects import Ask, End, Event, Publish, Write
from arena.match.match import Match, SeatRecord
from arena.match.time_control import TimeControl
from arena.network.session import Query, Sample, read_key, read_payload
from arena.pit.admission import MOST_GUESTS, Admission
from arena.pit.archive import MOST_KEPT, Archive
from arena.pit.authenticator import Authenticator
from arena.pit.lobby_publisher import LobbyPublisher
from arena.pit.match_session import MatchSession, PitContext, SeatSession
from arena.pit.register import Register
from arena.pit.resume import resume_matches
from arena.pit.seating import Pairing, SeatId, Seating
from arena.policy import MatchResult
from arena.protocol import topics
from arena.protocol.codec import decode
from arena.protocol.messages import Orders, Ready, Receipt, Signed
from arena.protocol.signed import check_receipt
from arena.records.journal import Header, journal_name

logger = logging.getLogger(__name__)

MOST_WAITING = 10_000
"""Messages in a queue; what comes beyond is dropped, and asked for again."""
MOST_SUSPECT = 512
"""Messages of a seat that do not open, in a sweep; what comes beyond is not tried."""
FAREWELL_S = 2.0
"""How long a match that is over waits for its receipts."""
_MOST_JUNK = 256  # messages beyond one from each seat that are heard before something else is done
_SWEEP_S = 0.01
_MOST_ASKED = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """A match that ended on the network."""

    header: Header
    result: MatchResult
    """`score` is blue's."""
    seats: dict[Team, SeatRecord]
    entries: dict[Team, bytes]
    """Public keys of those who played."""


class Referee:
    """All matches of a pit."""

    def __init__(
        self,
        house: PitContext,
        ruleset: Ruleset,
        seating: Seating,
        time_control: TimeControl,
        journals: Path,
        *,
        register: Register | None = None,
        on_end: Callable[[Played], None],
    ) -> None:
        self._house, self._ruleset = house, ruleset
        self._seating, self._terms, self._journals = seating, time_control, journals
        self._on_end = on_end
        self._inbox: SimpleQueue[tuple[Callable[..., None], tuple[Any, ...]]] = SimpleQueue()
        self.tables: dict[str, MatchSession] = {}
        self.held: dict[SeatId, tuple[str, Team]] = {}
        self.endings: OrderedDict[str, Signed] = OrderedDict()
        self._leaving: dict[str, tuple[MatchSession, float]] = {}
        """Matches that are over, and when they stop to wait for receipts."""
        self._asked: dict[str, list[Query]] = {}
        """Questions for the journals of those."""
        self._present: set[str] = set()
        self._is_stopping = False
        self.n_dropped = 0
        journals.mkdir(parents=True, exist_ok=True)
        self._register = register or Register()
        self._reception = Admission(self, Authenticator(house.pit, house.identity), self._register, ruleset, seating)
        self._notice = LobbyPublisher(house, ruleset, self._reception, seating, self.tables)
        self._archive = Archive(journals)
        session, pit = house.session, house.pit
        session.watch_presence(topics.all_presence(pit), self._enqueue(self._on_presence))
        self._actions = session.collect(topics.all_actions(pit), MOST_WAITING)
        self._end_heartbeat = session.heartbeat(topics.beat(pit), _SWEEP_S)
        session.answer(topics.join(pit), self._enqueue(self._reception.hear))
        session.answer(topics.lobby(pit), self._enqueue(self._on_lobby))
        session.answer(topics.all_journals(pit), self._enqueue(self._on_journal))

    @property
    def n_running(self) -> int:
        """Matches that are not over."""
        return len(self.tables)

    @property
    def is_deserted(self) -> bool:
        """Whether no client is there, as far as they say so, and no match waits for its receipts."""
        return not self._present and not self._leaving

    @property
    def matches(self) -> list[Match]:
        """The matches that are not over, in the order of their beginning."""
        return [table.match for table in self.tables.values()]

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
                self.hear_orders()
                for _ in range(self._inbox.qsize()):
                    handle, arguments = self._inbox.get()
                    handle(*arguments)
                next_sweep_s = now_s + _SWEEP_S
                self._sweep(now_s)
                if until():
                    return

    def close(self) -> None:
        """Put every match down as it stands: a later referee can resume it."""
        self._end_heartbeat()
        for match in list(self._leaving):
            self._part(match)
        for table in self.tables.values():
            table.put_down()
        self.tables.clear()

    def resume(self, wanted: Callable[[str], bool]) -> list[str]:
        """Take up the unfinished matches whose identity is wanted; return their identities."""
        resumed = []
        for match, entries, events, journal in resume_matches(self._journals, self._terms, time.monotonic(), wanted):
            table = MatchSession(self._house, match, entries, journal)
            self.tables[table.id] = table
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
        self._reception.lose(client)
        now_s = time.monotonic()
        for seat in [seat for seat in self.held if seat.client == client]:
            match_id, team = self.held.pop(seat)
            table = self.tables[match_id]
            self._carry_out(table, table.match.leave(team, now_s))

    def hear_orders(self) -> None:
        """Take what the seats have said by now; not what they answer to that, or it would never end where all are quick."""
        for _ in range(2 * len(self.tables) + _MOST_JUNK):
            sample = self._actions.take()
            if sample is None:
                return
            self._on_action(sample)

    def _on_action(self, sample: Sample) -> None:
        try:
            match_id, team = topics.read_action(read_key(sample))
        except UnreadableError:
            return
        table = self.tables.get(match_id)
        if table is None:
            if match_id in self._leaving:
                self._on_receipt(self._leaving[match_id][0], team, sample)
            return
        message = self._open(table, table.chairs[team], team, sample)
        if type(message) is Orders:
            self._carry_out(table, table.match.submit(team, message.tick, message.actions, time.monotonic()))
        elif type(message) is Ready:
            table.send_history(team, message.known_ticks)
            self._carry_out(table, table.match.ready(team, time.monotonic()))
        elif message is not None:
            table.match.garble(team)

    def _open(self, table: MatchSession, chair: SeatSession, team: Team, sample: Sample) -> Any:
        """Return the message of a seat, or None: junk on its key is counted, and uses up nothing of the seat's."""
        if chair.opener is None or chair.n_suspect >= MOST_SUSPECT:
            table.match.suspect(team)
            return None
        try:
            opened = chair.opener.open(read_payload(sample))
        except ForgedError:
            chair.n_suspect += 1
            table.match.suspect(team)
            return None
        try:
            return decode(opened)
        except UnreadableError:
            table.match.garble(team)
            return None

    def _on_receipt(self, table: MatchSession, team: Team, sample: Sample) -> None:
        chair = table.chairs[team]
        message = self._open(table, chair, team, sample)
        if isinstance(message, Receipt):
            try:
                check_receipt(chair.entry, table.id, team, message)
            except ForgedError:
                return
            table.accept(team, message)
            if table.has_receipts:
                self._part(table.id)

    def _on_lobby(self, question: Query) -> None:
        question.answer(self._notice.read(time.monotonic()))

    def _on_journal(self, question: Query) -> None:
        match = topics.read_journal(question.key)
        if match in self._leaving and len(self._asked.setdefault(match, [])) < _MOST_ASKED:
            self._asked[match].append(question)  # it is whole in a moment
        else:
            question.answer(self._archive.answer(match, question.payload))

    # What is done

    def begin(self, pairing: Pairing, entries: dict[Team, bytes]) -> MatchSession:
        """Begin a match of two entries, whose public keys are given."""
        self._notice.count_match()
        plan = pairing.plan
        header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=self._ruleset, keys=plan.keys)
        match = Match(header, self._terms, time.monotonic())
        path = self._journals / journal_name(header.identity)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o600)
        table = MatchSession(self._house, match, entries, descriptor)
        table.write(match.start_record + table.seats_record)
        self.tables[table.id] = table
        for team, seat in pairing.seats.items():
            table.chairs[team].holder = seat
            self.held[seat] = (table.id, team)
        logger.info("match %s begins: blue %s, red %s", header.identity, header.blue, header.red)
        return table

    def take_away(self, table: MatchSession, team: Team, why: str) -> None:
        """Have a seat forfeit its match."""
        self._carry_out(table, table.match.forfeit(team, why))

    def abort(self, table: MatchSession, why: str) -> None:
        """End a match by a fault that is no seat's."""
        self._carry_out(table, table.match.void(why))

    def _carry_out(self, table: MatchSession, events: Iterable[Event]) -> None:
        for event in events:
            if type(event) is Ask:
                table.ask(event)
            elif type(event) is Write:
                table.write(event.data)
            elif type(event) is Publish:
                table.publish()
            elif type(event) is End:
                self._finish(table, event.result)

    def _finish(self, table: MatchSession, result: MatchResult) -> None:
        match = table.match
        self.endings[table.id] = table.end(result)
        if len(self.endings) > MOST_KEPT:
            self.endings.popitem(last=False)
        for chair in table.chairs.values():
            if chair.holder is not None:
                self.held.pop(chair.holder, None)
            if match.tick and result.ending is not Termination.VOID:
                self._register.claim(chair.name, chair.entry)
        del self.tables[table.id]
        self._leaving[table.id] = (table, time.monotonic() + FAREWELL_S)
        logger.info("match %s: %s, winner %s", match.header.identity, result.ending.name.lower(), result.winner)
        seats = {team: match.record(team) for team in Team}
        entries = {team: chair.entry for team, chair in table.chairs.items()}
        self._on_end(Played(header=match.header, result=result, seats=seats, entries=entries))

    def _part(self, match: str) -> None:
        """Close the journal of a match that is over; it may be seen once its whole fixture is."""
        table, _ = self._leaving.pop(match)
        table.close()
        header = table.match.header
        self._archive.add(table.id, header, is_open=lambda: self._is_fixture_over({header.blue, header.red}))
        for question in self._asked.pop(match, []):
            question.answer(self._archive.answer(match, question.payload))

    def _is_fixture_over(self, names: set[str]) -> bool:
        is_running = any({table.match.header.blue, table.match.header.red} == names for table in self.tables.values())
        return not is_running and not self._seating.is_planned(names)

    def _sweep(self, now_s: float) -> None:
        self._reception.serve()
        for table in list(self.tables.values()):
            for chair in table.chairs.values():
                chair.n_suspect = 0
            self._carry_out(table, table.match.advance(now_s))
        for match, (_, end_s) in list(self._leaving.items()):
            if now_s >= end_s:
                self._part(match)
        self._reception.sweep(now_s)
