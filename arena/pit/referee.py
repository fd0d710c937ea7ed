"""A pit on the network: what its core is told of, beside the matches, and what of its effects is carried out here."""

import time
from collections.abc import Callable, Collection
from itertools import count
from pathlib import Path

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
from arena.pit.register import Register
from arena.pit.seating import Seating
from arena.protocol import topics


class Referee(MatchLoop):
    """All matches of a pit on the network."""

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
        on_end: Callable[[MatchEnded], None],
    ) -> None:
        self._register = register or Register()
        self._questions: dict[QuestionId, Query] = {}
        self._question_ids = count()
        self.n_dropped = 0
        core = self._pit_core = PitCore(context, ruleset, seating, time_control, self._register)
        super().__init__(
            session,
            context.pit,
            core,
            session.collect(topics.all_actions(context.pit), MOST_WAITING),
            journals,
            fsync=fsync,
            is_delayed_public=context.public_delay > 0,
            carry_out={
                Reply: lambda effect: self._questions.pop(effect.question).answer(effect.payload),
                Drop: lambda effect: self._questions.pop(effect.question).drop(),
                ReplyWithJournal: self._reply_with_journal,
                SaveRegister: lambda effect: self._register.save(),
                MatchEnded: on_end,
            },
        )
        self._refill_journals()
        pit = context.pit
        session.watch_presence(
            topics.all_presence(pit),
            lambda key, is_there: self._enqueue(lambda: PresenceChanged(topics.read_presence(key), is_there)),
        )
        self._end_heartbeat = session.heartbeat(topics.beat(pit), SWEEP_S)
        session.answer(topics.join(pit), self._enqueue_question(lambda id, asked: JoinAsked(id, asked.payload, asked.sender)))
        session.answer(topics.lobby(pit), self._enqueue_question(lambda id, asked: LobbyAsked(id)))
        session.answer(
            topics.all_journals(pit),
            self._enqueue_question(lambda id, asked: JournalAsked(id, topics.read_journal(asked.key), asked.payload)),
        )

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
    def matches(self) -> list[Match]:
        """The matches that are not over, in the order of their beginning."""
        return self._pit_core.matches

    def close(self) -> None:
        """Leave every match as it stands: a later referee can resume it."""
        self._end_heartbeat()
        super().close()

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

    def _sweep(self, now_s: float) -> None:
        self._refill_journals()
        self._session.relieve(self._find_kept, now_s)
        self._hand_in(TimePassed(now_s))
        self._open_requests()

    def _open_requests(self) -> None:
        while self._pit_core.may_open_request:
            self._take_actions()  # a turn waits for one request at most
            self._left_at_s = time.monotonic()
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
