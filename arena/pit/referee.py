"""A pit on the network: what its core is told of, beside the matches, and what of its effects is carried out here."""

import time
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import count
from pathlib import Path
from queue import Empty

from arena.game.ruleset import Ruleset
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.network.links import Kept
from arena.network.session import Query, Session
from arena.pit.core import PitCore
from arena.pit.effects import (
    Drop,
    MatchEnded,
    Reply,
    ReplyWithJournal,
    SaveRegister,
    TellWorker,
)
from arena.pit.events import (
    Event,
    JoinAsked,
    JournalAsked,
    JournalsReady,
    LobbyAsked,
    PresenceChanged,
    QuestionId,
    RequestOpened,
    RequestTurn,
    TimePassed,
)
from arena.pit.journal_files import find_unfinished, read_piece
from arena.pit.match_loop import MOST_WAITING, SWEEP_S, MatchLoop
from arena.pit.match_session import PitContext
from arena.pit.matches import RunningMatch
from arena.pit.register import Register
from arena.pit.seating import Seating
from arena.pit.workers.machines import Machine
from arena.pit.workers.messages import Order, WorkerSettings
from arena.pit.workers.processes import STOP_S, WorkerProcesses
from arena.pit.workers.remote_sessions import Worker
from arena.protocol import topics

_LOOK_S = 0.05


class Referee(MatchLoop):
    """All matches of a pit on the network.

    Parameters
    ----------
    most_matches
        At once; as many as `arena.pit.admission` has it without it.
    workers
        Where each other process runs that referees matches, if any do; then this one only admits those who play.
    workers_endpoint
        Where these connect to the router of `session`.
    """

    def __init__(
        self,
        session: Session,
        context: PitContext,
        ruleset: Ruleset,
        seating: Seating,
        time_control: TimeControl,
        journals: Path,
        *,
        register: Register | None = None,
        fsync: bool = False,
        most_matches: int | None = None,
        workers: Sequence[Machine] = (),
        workers_endpoint: str = "",
        on_end: Callable[[MatchEnded], None],
    ) -> None:
        self._register = register or Register()
        self._questions: dict[QuestionId, Query] = {}
        self._question_ids = count()
        self.n_dropped = 0
        core = self._pit_core = PitCore(
            context, ruleset, seating, time_control, self._register, n_workers=len(workers), most_matches=most_matches
        )
        heard = topics.beat(context.pit) if workers else topics.all_actions(context.pit)
        super().__init__(
            session,
            context.pit,
            core,
            session.collect(heard, MOST_WAITING),
            journals,
            beat=topics.beat(context.pit),
            fsync=fsync and not workers,
            is_delayed_public=context.public_delay > 0,
            carry_out={
                Reply: lambda effect: self._questions.pop(effect.question).answer(effect.payload),
                Drop: lambda effect: self._questions.pop(effect.question).drop(),
                ReplyWithJournal: self._reply_with_journal,
                SaveRegister: lambda effect: self._register.save(),
                MatchEnded: on_end,
                TellWorker: lambda effect: self._tell_worker(effect.worker, effect.order),
            },
        )
        self._workers: WorkerProcesses | None = None
        if not workers:
            self._refill_journals()
        pit = context.pit
        session.watch_presence(
            topics.all_presence(pit),
            lambda key, is_there: self._enqueue(lambda: PresenceChanged(topics.read_presence(key), is_there)),
        )
        self._end_beats = [session.heartbeat(topics.beat(pit), SWEEP_S)]
        session.answer(topics.join(pit), self._enqueue_question(lambda id, asked: JoinAsked(id, asked.payload, asked.sender)))
        session.answer(topics.lobby(pit), self._enqueue_question(lambda id, asked: LobbyAsked(id)))
        session.answer(
            topics.all_journals(pit),
            self._enqueue_question(lambda id, asked: JournalAsked(id, topics.read_journal(asked.key), asked.payload)),
        )
        if workers:
            settings = WorkerSettings(
                number=0,
                endpoint=workers_endpoint,
                pit=pit,
                private=context.identity.private.private_bytes_raw(),
                spectator_key=context.spectator_key,
                public_delay=context.public_delay,
                ruleset=ruleset,
                time_control=time_control,
                journals=journals,
                fsync=fsync,
            )
            self._hire([replace(settings, number=worker.number) for worker in core.workers], workers)

    @property
    def queues(self) -> dict[str, int]:
        """How many wait: what came over the network and was not taken up yet, and those of the core."""
        return {"inbox": self._inbox.qsize(), **self._pit_core.queues}

    @property
    def n_refused(self) -> int:
        """Requests that did not open, or were not signed by whom they name."""
        return self._pit_core.n_refused

    @property
    def is_deserted(self) -> bool:
        """Whether no client is present, as far as they declare it, and no match waits for its receipts."""
        return self._pit_core.is_deserted

    @property
    def workers(self) -> list[Worker]:
        """The workers that referee the matches; none where this process does."""
        return self._pit_core.workers

    @property
    def running(self) -> Collection[RunningMatch]:
        """The matches that are not over, in whatever process."""
        return self._pit_core.running

    @property
    def matches(self) -> list[Match]:
        """The matches of this process that are not over, in the order of their beginning."""
        return self._pit_core.matches

    def close(self) -> None:
        """Leave every match as it stands: a later referee can resume it."""
        try:
            super().close()
            if self._workers is not None:
                self._wait_for_workers(self._workers)
        finally:
            self._stop_beating()

    def _stop_beating(self) -> None:
        for end in self._end_beats:
            end()

    def resume(self, identities: Collection[str] | None = None) -> list[str]:
        """Take up the unfinished matches that an earlier referee left, or those of them with an identity; return whose were."""
        resumed = []
        for found in find_unfinished(self._journals, identities):
            identity = found.journal.header.identity
            if (identities is None or identity in identities) and self._hand_in(found):
                resumed.append(identity)
        return resumed

    # Events

    def _enqueue(self, make_event: Callable[[], Event]) -> None:
        """Leave an event for the one thread, which makes it; from a thread of Zenoh's."""
        if self._inbox.qsize() < MOST_WAITING:
            self._inbox.put(make_event)
        else:
            self.n_dropped += 1

    def _enqueue_question(self, make_event: Callable[[QuestionId, Query], Event]) -> Callable[[Query], None]:
        def register(question: Query) -> Event:
            id = next(self._question_ids)
            self._questions[id] = question
            return make_event(id, question)

        return lambda question: self._enqueue(lambda: register(question))

    # Workers

    def _hire(self, settings: list[WorkerSettings], machines: Sequence[Machine]) -> None:
        """Start workers, and wait until they take matches."""
        self._workers = WorkerProcesses(settings, self._inbox.put, machines=machines)
        self._end_beats.append(self._session.beat((topics.beat_of_worker(self._pit, one.number) for one in settings), SWEEP_S))
        try:
            self._workers.start()
            while not all(worker.is_ready for worker in self._pit_core.workers):
                self._workers.look()
                with suppress(Empty):
                    self._hand_in(self._inbox.get(timeout=_LOOK_S)())
        except BaseException:
            self._workers.close()
            self._stop_beating()  # nobody closes a referee that was never made
            raise

    def _tell_worker(self, worker: int, order: Order) -> None:
        assert self._workers is not None
        self._workers.tell(worker, order)

    def _wait_for_workers(self, workers: WorkerProcesses) -> None:
        """Take up the last that workers say, and end those that do not leave."""
        try:
            end_s = time.monotonic() + STOP_S
            while not self._has_failed and time.monotonic() < end_s and not (workers.has_ended and self._inbox.empty()):
                with suppress(Empty):
                    self._hand_in(self._inbox.get(timeout=_LOOK_S)())
        finally:
            workers.close()

    def _sweep(self, now_s: float) -> None:
        if self._workers is None:
            self._refill_journals()
        else:
            self._workers.look()
        self._session.relieve(self._find_kept, now_s)
        self._hand_in(TimePassed(now_s))
        self._open_requests()

    def _open_requests(self) -> None:
        while self._pit_core.may_open_request:
            self._take_actions()  # a turn waits for one request at most
            self._left_at_s = time.monotonic()
            if self._workers is None:
                self._refill_journals()
            begun_s = time.monotonic()
            self._hand_in(RequestTurn())
            self._hand_in(RequestOpened(time.monotonic() - begun_s))

    def _find_kept(self) -> Kept:
        return Kept(*self._pit_core.find_sessions(time.monotonic()))

    # Effects

    def _refill_journals(self) -> None:
        """Tell the core how many matches can begin, whenever that changes by more than the matches that began."""
        n_before = len(self._spare_journals)
        self._spare_journals.refill()
        n_ready = len(self._spare_journals)
        if n_ready != n_before or not n_ready:
            self._hand_in(JournalsReady(n_ready))

    def _reply_with_journal(self, effect: ReplyWithJournal) -> None:
        self._questions.pop(effect.question).answer(read_piece(self._journals / effect.journal, effect.offset))
