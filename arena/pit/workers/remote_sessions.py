"""The matches of a pit that its workers referee, as the pit knows them. Without I/O.

A match stays with its worker's number. When that process dies, another takes its place, and what was in its hands: each match at
the very tick where its journal stands, on the same lane, so that clients need no more than new keys.
"""

import logging
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from arena.game.types import Team, Termination
from arena.match.seat_record import SeatRecord
from arena.pit.authenticator import PendingRequest
from arena.pit.effects import Drop, Effect, MatchEnded, Reply, TellWorker
from arena.pit.events import ActionReceived, BundleReceived, QuestionId, UnfinishedFound, WorkerLost, WorkerReady, WorkerSaid
from arena.pit.lanes import Lanes
from arena.pit.match_session import PitContext
from arena.pit.match_sessions import PATIENCE_S, MatchClosed, MatchOver, NewMatch
from arena.pit.seats import Seat
from arena.pit.workers.messages import (
    ForfeitSeat,
    GiveSeat,
    Gone,
    LeaveSeat,
    Load,
    Order,
    Over,
    Progress,
    Room,
    SeatGiven,
    Shut,
    StopWork,
    TakeMatch,
    VoidMatch,
)
from arena.policy import MatchResult
from arena.protocol import topics
from arena.protocol.handshake import new_secret
from arena.protocol.messages import Ended
from arena.protocol.signed import sign_statement
from arena.records.plan import network_name

logger = logging.getLogger(__name__)

MOST_DEATHS = 3
"""Of workers in a row, each soon after it took up a match: after one more, the match is given up."""
YOUNG_S = 60.0
"""A worker that lived longer did not die of what it took up."""
_HOLD_S = 1.5
"""How long a question waits for a worker that is being replaced; whoever asked asks again."""


@dataclass(slots=True, kw_only=True)
class RemoteMatch:
    """A match that a worker referees."""

    id: str
    names: list[str]
    entries: dict[Team, bytes]
    new: NewMatch
    worker: int
    drawn_at_s: float
    taken_at_s: float
    """When its worker was given it last."""
    tick: int = 0
    is_waiting: bool = True
    """Whether its seats were not ready when its worker told last."""
    is_voided: bool = False
    """Whether its worker was told to end it."""
    counted: dict[str, int] = field(default_factory=dict)
    n_deaths: int = 0
    """Of workers, in a row."""
    rulings: list[Order] = field(default_factory=list)
    """What its worker was told to end it by."""

    def faults(self) -> dict[str, int]:
        """Return what was counted of both seats."""
        return self.counted


@dataclass(slots=True, kw_only=True)
class Worker:
    """One of the places that worker processes take."""

    number: int
    lanes: Lanes
    is_ready: bool = False
    n_begun: int = 0
    """Matches that this process was given."""
    room: Room = field(default_factory=lambda: Room(0, 0))
    load: Load = field(default_factory=Load)
    n_restarts: int = 0
    n_running: int = 0
    """Matches that are not over."""
    asked: set[QuestionId] = field(default_factory=set)
    """Questions that it has not answered."""
    held: list[tuple[GiveSeat, float]] = field(default_factory=list)
    """Questions that came while there was no process, and when."""

    @property
    def n_free(self) -> int:
        """Matches that it could begin now, as far as is known."""
        return self.room.n_free - (self.n_begun - self.room.n_taken) if self.is_ready else 0


class RemoteSessions:
    """Hands matches to workers; see `arena.pit.matches.Sessions`."""

    def __init__(
        self,
        n_workers: int,
        context: PitContext,
        on_over: Callable[[MatchOver], list[Effect]],
        on_closed: Callable[[MatchClosed], list[Effect]],
    ) -> None:
        self._context, self._on_over, self._on_closed = context, on_over, on_closed
        self.workers = {number: _make_worker(number) for number in range(1, n_workers + 1)}
        self._running: dict[str, RemoteMatch] = {}
        self._closing: dict[str, RemoteMatch] = {}

    @property
    def running(self) -> Collection[RemoteMatch]:
        """Those that are not over, in the order of their beginning."""
        return self._running.values()

    @property
    def has_closing(self) -> bool:
        """Whether a match waits for its receipts."""
        return bool(self._closing)

    @property
    def n_free(self) -> int:
        """Matches that may begin before more journals can be opened."""
        return sum(max(worker.n_free, 0) for worker in self.workers.values())

    def take_lane(self, now_s: float) -> int:
        """Return a lane of the worker that has the least to do, of those that have room."""
        chosen = min(self.workers.values(), key=lambda worker: (worker.n_free <= 0, worker.n_running))
        return chosen.lanes.take(now_s)

    def begin(self, new: NewMatch, now_s: float) -> list[Effect]:
        """Begin a match."""
        return self._give(new, now_s)

    def resume(self, found: UnfinishedFound, lane: int, now_s: float) -> list[Effect]:
        """Have an unfinished match taken up at its very tick."""
        new = NewMatch(header=found.journal.header, entries=found.entries, nonce=found.nonce, lane=lane)
        return self._give(new, now_s, is_resumed=True)

    def receive(self, event: ActionReceived, now_s: float) -> list[Effect]:
        """Do nothing: workers hear the seats themselves."""
        return []

    def receive_bundle(self, event: BundleReceived, now_s: float) -> list[Effect]:
        """Do nothing, as with what comes one by one."""
        return []

    holds_bundles = False

    def take_bundles(self, now_s: float) -> list[Effect]:
        """Return nothing: workers send what they gather."""
        return []

    def advance(self, now_s: float) -> list[Effect]:
        """Leave questions unanswered that have waited too long for a worker to be replaced."""
        effects: list[Effect] = []
        for worker in self.workers.values():
            while worker.held and now_s - worker.held[0][1] > _HOLD_S:
                effects.append(Drop(worker.held.pop(0)[0].question))
        return effects

    def issue_ticket(self, seat: Seat, pending: PendingRequest, now_s: float) -> list[Effect]:
        """Have a seat of a running match given to who asks for it."""
        worker = self.workers[self._running[seat.match].worker]
        order = GiveSeat(seat, pending.caller, pending.question)
        if not worker.is_ready:
            worker.held.append((order, now_s))
            return []
        worker.asked.add(order.question)
        return [TellWorker(worker.number, order)]

    def leave(self, seat: Seat, now_s: float) -> list[Effect]:
        """Note that the process which held a seat is gone."""
        one = self._running.get(seat.match)
        if one is None or not self.workers[one.worker].is_ready:
            return []  # all seats of a match that is taken up are empty at first
        return [TellWorker(one.worker, LeaveSeat(seat))]

    def forfeit(self, seat: Seat, why: str, now_s: float) -> list[Effect]:
        """Have a seat forfeit its match, unless that is over."""
        one = self._running.get(seat.match)
        return [] if one is None else self._rule(one, ForfeitSeat(seat, why))

    def void(self, match: str, why: str, now_s: float) -> list[Effect]:
        """End a match by a fault that is no seat's; nothing is done if it does not run."""
        one = self._running.get(match)
        return [] if one is None else self._rule(one, VoidMatch(match, why))

    def give_up_unready(self, now_s: float) -> list[Effect]:
        """Void the match whose seats take longest to get ready, if that is too long: who never plays must not keep others out."""
        if self.n_free <= 0:
            return []  # until the workers have opened the next journals, in a moment
        one = next((one for one in self._running.values() if one.is_waiting and not one.is_voided), None)
        if one is None or now_s - one.drawn_at_s < PATIENCE_S:
            return []
        one.is_voided = True
        why = "was not ready while others waited for room"
        return self._rule(one, VoidMatch(one.id, why, only_unready=True))

    def stop(self, now_s: float) -> list[Effect]:
        """Have every worker leave its matches as they stand, and end."""
        return [TellWorker(worker.number, StopWork()) for worker in self.workers.values() if worker.is_ready]

    # Workers

    def hear(self, event: WorkerReady | WorkerLost | WorkerSaid, now_s: float) -> list[Effect]:
        """Take up what happened to a worker, or what one reports."""
        worker = self.workers[event.worker]
        match event:
            case WorkerReady():
                return self._on_ready(worker, now_s)
            case WorkerLost():
                return self._on_lost(worker, event, now_s)
            case WorkerSaid():
                return self._on_report(worker, event, now_s)

    def _on_ready(self, worker: Worker, now_s: float) -> list[Effect]:
        worker.is_ready, worker.n_begun, worker.room = True, 0, Room(0, 0)
        effects: list[Effect] = []
        for one in [*self._running.values(), *self._closing.values()]:
            if one.worker == worker.number:
                effects += self._hand(one, now_s, is_resumed=True)
                effects += [TellWorker(worker.number, order) for order in one.rulings]
        if worker.n_restarts:
            logger.warning("worker %d was replaced, and takes its matches up", worker.number)
        held, worker.held = worker.held, []
        worker.asked.update(order.question for order, _ in held)
        return effects + [TellWorker(worker.number, order) for order, _ in held]

    def _on_lost(self, worker: Worker, event: WorkerLost, now_s: float) -> list[Effect]:
        worker.is_ready, worker.load = False, Load()
        worker.n_restarts += 1
        its = [one for one in self._running.values() if one.worker == worker.number]
        blamed = [one for one in its if one.new.lane == event.lane] or its
        for one in [] if event.is_cut_off else blamed:
            one.n_deaths = 1 if now_s - one.taken_at_s > YOUNG_S else one.n_deaths + 1
        logger.warning("worker %d has ended; %d matches wait for another in its place", worker.number, len(its))
        effects: list[Effect] = [Drop(question) for question in worker.asked]
        worker.asked.clear()
        return effects

    def _on_report(self, worker: Worker, event: WorkerSaid, now_s: float) -> list[Effect]:
        match event.report:
            case Room():
                worker.room = event.report
            case SeatGiven(question, payload):
                if question in worker.asked:
                    worker.asked.discard(question)
                    return [Drop(question) if payload is None else Reply(question, payload)]
            case Progress(matches, load):
                worker.load = load
                for id, progress in matches.items():
                    if (one := self._running.get(id)) is not None:
                        one.tick, one.is_waiting, one.counted = progress.tick, progress.is_waiting, dict(progress.faults)
            case Over(id, result, seats, ending):
                if (one := self._running.pop(id, None)) is not None:
                    worker.n_running -= 1
                    self._closing[id] = one
                    ended = MatchEnded(header=one.new.header, result=result, seats=dict(seats), entries=one.entries)
                    return self._on_over(MatchOver(id, ended, ending))
            case Shut(id, has_journal):
                if (one := self._closing.pop(id, None)) is not None:
                    worker.lanes.give_back(one.new.lane, now_s)
                    return self._on_closed(MatchClosed(id, one.new.header if has_journal else None))
            case Gone(id, why):
                if (one := self._running.pop(id, None)) is not None:
                    worker.n_running -= 1
                    logger.warning("%s cannot be taken up: %s", one.new.header.identity, why)
                    worker.lanes.give_back(one.new.lane, now_s)
                    return [*self._on_over(self._void(one, why)), *self._on_closed(MatchClosed(id, None))]
                if (one := self._closing.pop(id, None)) is not None:
                    worker.lanes.give_back(one.new.lane, now_s)
                    return self._on_closed(MatchClosed(id, None))
        return []

    def _void(self, one: RemoteMatch, why: str) -> MatchOver:
        """Return the ending of a match that no worker can end."""
        result = MatchResult(ending=Termination.VOID, winner=None, score=0, ticks=0, reason=why)
        records = {team: SeatRecord() for team in Team}
        faults = {team.name.lower(): records[team].faults() for team in Team}
        ending = sign_statement(self._context.identity, Ended(match=one.id, **result.to_dict(), faults=faults))
        return MatchOver(one.id, MatchEnded(header=one.new.header, result=result, seats=records, entries=one.entries), ending)

    def _give(self, new: NewMatch, now_s: float, *, is_resumed: bool = False) -> list[Effect]:
        header = new.header
        one = RemoteMatch(
            id=network_name(header.identity, self._context.identity.public, new.nonce),
            names=[header.blue, header.red],
            entries=new.entries,
            new=new,
            worker=(new.lane - topics.lanes_of_worker(1).start) // topics.LANES_OF_WORKER + 1,
            drawn_at_s=now_s,
            taken_at_s=now_s,
        )
        self._running[one.id] = one
        self.workers[one.worker].n_running += 1
        return self._hand(one, now_s, is_resumed=is_resumed)

    def _hand(self, one: RemoteMatch, now_s: float, *, is_resumed: bool) -> list[Effect]:
        """Hand a match to its worker."""
        one.taken_at_s = now_s
        self.workers[one.worker].n_begun += 1
        given_up = f"its worker died {one.n_deaths} times in a row" if one.n_deaths > MOST_DEATHS else ""
        if given_up:
            logger.warning("match %s is given up: %s", one.new.header.identity, given_up)
        order = TakeMatch(match=one.id, new=one.new, is_resumed=is_resumed, given_up=given_up)
        return [TellWorker(one.worker, order)]

    def _rule(self, one: RemoteMatch, order: Order) -> list[Effect]:
        """Have a match ended; a worker that takes the place of this one is told so as well."""
        one.rulings.append(order)
        return [TellWorker(one.worker, order)]


def _make_worker(number: int) -> Worker:
    lanes = topics.lanes_of_worker(number)
    offset = int.from_bytes(new_secret()[:4], "big") % len(lanes)
    return Worker(number=number, lanes=Lanes(lanes.start + offset, lanes))
