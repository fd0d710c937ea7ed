"""A pit on the network: the one thread that hands events to the core and carries its effects out.

Zenoh's callbacks put into bounded queues and do nothing else.
"""

import time
from collections.abc import Callable, Collection
from itertools import count
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from arena.errors import UnreadableError
from arena.folders import data_folder
from arena.game.ruleset import Ruleset
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.network.links import Kept
from arena.network.session import Put, Query, Sample, Session, read_key, read_payload
from arena.pit.channels import MatchChannels, open_lane
from arena.pit.core import PitCore
from arena.pit.effects import (
    Append,
    CloseMatch,
    Drop,
    Effect,
    MatchEnded,
    OpenMatch,
    PublishEnding,
    PublishTick,
    Reply,
    ReplyWithJournal,
    SaveRegister,
    Send,
    SendBundle,
)
from arena.pit.events import (
    ActionReceived,
    ActionsTaken,
    BundleReceived,
    Event,
    JoinAsked,
    JournalAsked,
    JournalsReady,
    LobbyAsked,
    PresenceChanged,
    QuestionId,
    RequestOpened,
    RequestTurn,
    Stopped,
    TimePassed,
)
from arena.pit.journal_files import JournalFile, SpareJournals, find_unfinished, read_piece
from arena.pit.match_session import PitContext
from arena.pit.register import Register
from arena.pit.seating import Seating
from arena.protocol import topics

MOST_WAITING = 10_000
"""Messages in a queue; what comes beyond is dropped, and asked for again."""
_MOST_JUNK = 256  # messages beyond two of each match that are handed in before something else is done
_MOST_AT_ONCE = 32
"""Actions that are handed in before what was gathered for clients is sent."""
_LEAST_MESSAGE_BYTES = 92
"""Of orders in a bundle."""
_SWEEP_S = 0.01
_IN_MATCH: dict[type[Effect], Callable[[MatchChannels, Any], None]] = {
    Append: MatchChannels.append,
    Send: MatchChannels.send,
    PublishTick: MatchChannels.publish_tick,
    PublishEnding: MatchChannels.publish_ending,
}


class Referee:
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
        self._session, self._pit, self._journals, self._fsync = session, context.pit, journals, fsync
        self._register = register or Register()
        self._is_delayed_public = context.public_delay > 0
        self._core = PitCore(context, ruleset, seating, time_control, self._register)
        self._inbox: SimpleQueue[Callable[[], Event]] = SimpleQueue()
        self._questions: dict[QuestionId, Query] = {}
        self._question_ids = count()
        self._channels: dict[str, MatchChannels] = {}
        self._lanes: dict[int, list[Put]] = {}
        self._bundle_lanes: dict[int, Put] = {}
        self._is_stopping, self._has_failed = False, False
        self.n_dropped = 0
        self._empty_at_s = 0.0
        """When no action waited."""
        self._left_at_s = 0.0
        """When this thread last left the actions for something else."""
        self._carry_out: dict[type[Effect], Callable[[Any], None]] = {
            OpenMatch: self._open_match,
            CloseMatch: lambda effect: self._channels.pop(effect.match).close(),
            Reply: lambda effect: self._questions.pop(effect.question).answer(effect.payload),
            Drop: lambda effect: self._questions.pop(effect.question).drop(),
            SendBundle: self._send_bundle,
            ReplyWithJournal: self._reply_with_journal,
            SaveRegister: lambda effect: self._register.save(),
            MatchEnded: on_end,
        }
        data_folder(journals)
        self._spare_journals = SpareJournals(journals, fsync=fsync)
        self._refill_journals()
        pit = context.pit
        session.watch_presence(
            topics.all_presence(pit),
            lambda key, is_there: self._enqueue(lambda: PresenceChanged(topics.read_presence(key), is_there)),
        )
        self._actions = session.collect(topics.all_actions(pit), MOST_WAITING)
        self._end_heartbeat = session.heartbeat(topics.beat(pit), _SWEEP_S)
        session.answer(topics.join(pit), self._enqueue_question(lambda id, asked: JoinAsked(id, asked.payload, asked.sender)))
        session.answer(topics.lobby(pit), self._enqueue_question(lambda id, asked: LobbyAsked(id)))
        session.answer(
            topics.all_journals(pit),
            self._enqueue_question(lambda id, asked: JournalAsked(id, topics.read_journal(asked.key), asked.payload)),
        )

    @property
    def n_running(self) -> int:
        """Matches that are not over."""
        return self._core.n_running

    @property
    def queues(self) -> dict[str, int]:
        """How many wait: what came over the network and was not taken up yet, and those of the core."""
        return {"inbox": self._inbox.qsize(), **self._core.queues}

    @property
    def n_refused(self) -> int:
        """Requests that did not open, or were not signed by whom they name."""
        return self._core.n_refused

    @property
    def is_deserted(self) -> bool:
        """Whether no client is present, as far as they declare it, and no match waits for its receipts."""
        return self._core.is_deserted

    @property
    def matches(self) -> list[Match]:
        """The matches that are not over, in the order of their beginning."""
        return self._core.matches

    def stop(self) -> None:
        """Leave `run` as soon as its thread notices; from any thread, or a signal."""
        self._is_stopping = True

    def run(self, until: Callable[[], bool]) -> None:
        """Referee until `until()`, asked every hundredth of a second, or until `stop`."""
        next_sweep_s = 0.0
        while not self._is_stopping:
            if not self._take_actions(_MOST_AT_ONCE):
                sample = self._actions.wait()  # at the latest when the session's own beat comes
                self._empty_at_s = time.monotonic()
                self._take_action(sample, None)
            now_s = time.monotonic()
            if now_s >= next_sweep_s:
                self._take_actions()
                self._left_at_s = time.monotonic()
                for _ in range(self._inbox.qsize()):
                    self._hand_in(self._inbox.get()())
                next_sweep_s = now_s + _SWEEP_S
                self._refill_journals()
                self._session.relieve(self._find_kept, now_s)
                self._hand_in(TimePassed(now_s))
                self._open_requests()
                if until():
                    return

    def close(self) -> None:
        """Leave every match as it stands: a later referee can resume it."""
        self._end_heartbeat()
        self._spare_journals.close()
        if not self._has_failed:  # else the core takes for done what was not
            self._hand_in(Stopped())

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

    def _hand_in(self, event: Event) -> list[Effect]:
        """Hand an event to the core and carry out what it wants done."""
        effects: list[Any] = self._core.receive(event, time.monotonic())
        try:
            effect: Any  # of one of two kinds, told by its type, which a dictionary knows and a type checker does not
            for effect in effects:
                in_match = _IN_MATCH.get(type(effect))
                if in_match is not None:
                    in_match(self._channels[effect.match], effect)
                else:
                    self._carry_out[type(effect)](effect)
        except BaseException:
            self._has_failed = True
            raise
        return effects

    def _take_action(self, sample: Sample, arrived_s: float | None) -> int:
        """Hand in an action, or several in a bundle; return about how many."""
        try:
            lane, team = topics.read_action(read_key(sample))
        except UnreadableError:
            return 1  # as of every beat
        payload = read_payload(sample)
        if team is not None:
            self._hand_in(ActionReceived(lane, team, payload, arrived_s))
            return 1
        self._hand_in(BundleReceived(lane, payload, arrived_s))
        return 1 + len(payload) // _LEAST_MESSAGE_BYTES

    def _take_actions(self, most: int | None = None) -> bool:
        """Hand in the actions that have come, and return whether any had.

        Not the answers to what follows, or it would never end where all are quick. They came while this thread did something
        else, which no seat is charged for: their clocks stop when the queue was seen empty last, or when this thread left it.
        """
        n_taken, n_since_sent, most = 0, 0, most or 2 * self._core.n_running + _MOST_JUNK
        while n_taken < most and (sample := self._actions.take()) is not None:
            n_actions = self._take_action(sample, max(self._empty_at_s, self._left_at_s))
            n_taken, n_since_sent = n_taken + n_actions, n_since_sent + n_actions
            if n_since_sent >= _MOST_AT_ONCE:
                n_since_sent = 0
                self._send_bundles()
        if n_taken < most:
            self._empty_at_s = time.monotonic()
        self._send_bundles()
        return n_taken > 0

    def _send_bundles(self) -> None:
        if self._core.holds_bundles:
            self._hand_in(ActionsTaken())

    def _open_requests(self) -> None:
        while self._core.may_open_request:
            self._take_actions()  # a turn waits for one request at most
            self._left_at_s = time.monotonic()
            self._refill_journals()
            begun_s = time.monotonic()
            self._hand_in(RequestTurn())
            self._hand_in(RequestOpened(time.monotonic() - begun_s))

    def _find_kept(self) -> Kept:
        return Kept(*self._core.find_sessions(time.monotonic()))

    # Effects

    def _open_match(self, effect: OpenMatch) -> None:
        if effect.n_bytes:
            journal = JournalFile(self._journals / effect.journal, effect.n_bytes, fsync=self._fsync)
        else:
            journal = self._spare_journals.take(effect.journal)
        puts = self._lanes.get(effect.lane)
        if puts is None:
            puts = self._lanes[effect.lane] = open_lane(self._session, self._pit, effect.lane)
        self._channels[effect.match] = MatchChannels(
            self._session, self._pit, journal, effect.match, puts, self._is_delayed_public
        )

    def _send_bundle(self, effect: SendBundle) -> None:
        put = self._bundle_lanes.get(effect.lane)
        if put is None:
            put, _ = self._session.publisher(topics.observation(self._pit, effect.lane, None))
            self._bundle_lanes[effect.lane] = put
        put(effect.payload)

    def _refill_journals(self) -> None:
        """Tell the core how many matches can begin, whenever that changes by more than the matches that began."""
        n_before = len(self._spare_journals)
        self._spare_journals.refill()
        n_ready = len(self._spare_journals)
        if n_ready != n_before or not n_ready:
            self._hand_in(JournalsReady(n_ready))

    def _reply_with_journal(self, effect: ReplyWithJournal) -> None:
        self._questions.pop(effect.question).answer(read_piece(self._journals / effect.journal, effect.offset))
