"""A pit as one state machine without I/O: events and the time go in, effects come out.

    shell (`arena.pit.referee`)        PitCore
    Zenoh, files, clock  -- event -->  Authenticator, RationedQueue   who asks, and when it is opened
                                       Admission, Operator            who waits and is seated; the operator's commands
                                       Matches, Archive, SeatBook     what runs, who holds which seat, which journals may be seen
                        <-- effects -- LobbyPublisher

The effects are to be carried out in their order, before the next event is handed in. A tick's record stands before what is sent
of the next tick; if it cannot be written, the pit ends, and nobody has received anything.
"""

from collections.abc import Callable, Collection
from functools import partial
from itertools import islice
from typing import Any

from arena.errors import ProtocolError
from arena.game.ruleset import Ruleset, rules_values
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.pit.admission import MOST_QUEUED, Admission
from arena.pit.authenticator import Authenticator, PendingRequest
from arena.pit.effects import Drop, Effect, Reply, SaveRegister
from arena.pit.events import (
    MORE_MAY_FOLLOW,
    ActionReceived,
    ActionsTaken,
    BundleReceived,
    Event,
    JoinAsked,
    JournalAsked,
    JournalsReady,
    LobbyAsked,
    PresenceChanged,
    RequestOpened,
    RequestTurn,
    Stopped,
    TimePassed,
    UnfinishedFound,
    WorkerLost,
    WorkerReady,
    WorkerSaid,
)
from arena.pit.lobby_publisher import LobbyPublisher
from arena.pit.match_session import MatchSession, PitContext
from arena.pit.match_sessions import MatchSessions
from arena.pit.matches import Matches, RunningMatch
from arena.pit.operator import Operator
from arena.pit.rationed_queue import RationedQueue
from arena.pit.register import Register
from arena.pit.seating import Seating
from arena.pit.workers.remote_sessions import RemoteSessions, Worker
from arena.protocol import topics
from arena.protocol.codec import MOST_LISTED, decode, encode
from arena.protocol.messages import AdminRequest, ChallengeRequest, JoinRequest, Lobby, Refusal, SealedRequest

_SHARE = 0.3
"""Of the time that goes to requests for seats, while matches run."""
_MOST_LAST_REPLIES = 16
"""Pieces of journals that are sent before the pit closes."""
MOST_STANDINGS = 50
"""Of a ladder, its first; with all else that is listed, the lobby fits one message."""


class PitCore:
    """All of a pit but its network, its files and its clock."""

    def __init__(
        self,
        context: PitContext,
        ruleset: Ruleset,
        seating: Seating,
        time_control: TimeControl,
        register: Register,
        *,
        n_workers: int = 0,
        most_matches: int | None = None,
    ) -> None:
        if context.public_delay and not seating.plays_maps_once:
            raise ValueError("a board may be shown with a delay only where its map is never played again")
        self._context, self._ruleset, self._seating, self._register = context, ruleset, seating, register
        self._authenticator = Authenticator(context.pit, context.identity)
        self._requests: RationedQueue[tuple[JoinAsked, float]] = RationedQueue(share=_SHARE)
        make_sessions = partial(self._hire, n_workers) if n_workers else partial(MatchSessions, context, time_control)
        self._remote: RemoteSessions | None = None
        """Where matches are refereed by workers."""
        self._matches = Matches(context, ruleset, seating, register, make_sessions)
        self._admission = Admission(ruleset, seating, register, self._matches, most_matches)
        self._taken_last: RationedQueue[Any] = self._requests
        self._operator = Operator(context.identity.public, register, seating, self._matches, self._admission)
        self._lobby = LobbyPublisher(context.identity, self._describe)
        self._present: set[str] = set()
        self.n_refused = 0
        """Requests that did not open, or were not signed by whom they name."""
        self._handlers: dict[type[Event], Callable[[Any, float], list[Effect]]] = {
            ActionReceived: self._matches.receive,
            BundleReceived: self._matches.receive_bundle,
            ActionsTaken: lambda event, now_s: [],
            JoinAsked: self._on_join,
            LobbyAsked: self._on_lobby,
            JournalAsked: self._on_journal,
            PresenceChanged: self._on_presence,
            TimePassed: self._on_time,
            RequestTurn: self._on_request_turn,
            RequestOpened: self._on_request_opened,
            JournalsReady: self._on_journals_ready,
            UnfinishedFound: self._on_unfinished,
            Stopped: self._on_stopped,
            WorkerReady: self._on_worker,
            WorkerLost: self._on_worker,
            WorkerSaid: self._on_worker,
        }

    def receive(self, event: Event, now_s: float) -> list[Effect]:
        """Take an event; return what is to be done.

        Parameters
        ----------
        event
            What happened. Whatever a client sent may be junk, and raises nothing.
        now_s
            The time by one clock that never goes back.
        """
        effects = self._handlers[type(event)](event, now_s)
        if type(event) not in MORE_MAY_FOLLOW and self._matches.holds_bundles:
            effects = [*effects, *self._matches.take_bundles(now_s)]
        return [SaveRegister(), *effects] if self._register.is_changed else effects

    @property
    def holds_bundles(self) -> bool:
        """Whether something was gathered for clients, and waits for the next event that is no action."""
        return self._matches.holds_bundles

    @property
    def may_open_request(self) -> bool:
        """Whether a request waits, and the ration of time allows to open it: then a `RequestTurn` opens it."""
        return self._next_queue() is not None

    def _next_queue(self) -> RationedQueue[Any] | None:
        """Return the queue whose turn it is: that of requests for seats, or that of journals."""
        queues: list[RationedQueue[Any]] = [self._requests, self._matches.journal_replies]
        if self._taken_last is self._requests:
            queues.reverse()
        return next((queue for queue in queues if queue.may_take(is_rationed=bool(self._matches.running))), None)

    def find_sessions(self, now_s: float) -> tuple[set[str], set[str]]:
        """Return the connections of those who hold seats, and of those whose requests were accepted lately."""
        return self._admission.find_sessions(now_s)

    @property
    def matches(self) -> list[Match]:
        """The matches that are not over, in the order of their beginning; of this process alone."""
        return [one.match for one in self._matches.running if isinstance(one, MatchSession)]

    @property
    def running(self) -> Collection[RunningMatch]:
        """The same, in whatever process they are."""
        return self._matches.running

    @property
    def workers(self) -> list[Worker]:
        """The workers that referee the matches; none where this process does."""
        return [] if self._remote is None else list(self._remote.workers.values())

    @property
    def queues(self) -> dict[str, int]:
        """How many wait: requests to be opened, pieces of journals to be sent, and clients for a seat."""
        return {
            "requests": len(self._requests),
            "journals": len(self._matches.journal_replies),
            "clients": self._admission.n_waiting,
        }

    @property
    def n_running(self) -> int:
        """Matches that are not over."""
        return len(self._matches.running)

    @property
    def is_deserted(self) -> bool:
        """Whether no client is present, as far as they declare it, and no match waits for its receipts."""
        return not self._present and not self._matches.has_closing

    def _on_join(self, event: JoinAsked, now_s: float) -> list[Effect]:
        """Answer at once what costs nothing; let a sealed request wait."""
        try:
            message = decode(event.payload)
        except ProtocolError as error:
            return [Reply(event.question, encode(Refusal(reason=f"the request cannot be read: {error}")))]
        if isinstance(message, ChallengeRequest):
            return [Reply(event.question, self._authenticator.challenge(now_s))]
        if not isinstance(message, SealedRequest):
            return [Reply(event.question, encode(Refusal(reason="this is no request for a seat")))]
        return [] if self._requests.put((event, now_s)) else [Drop(event.question)]

    def _on_request_turn(self, event: RequestTurn, now_s: float) -> list[Effect]:
        queue = self._next_queue()
        if queue is None:
            return []
        self._taken_last = queue
        if queue is not self._requests:
            return [queue.take()]
        asked, asked_at_s = self._requests.take()
        try:
            caller = self._authenticator.open(asked.payload, now_s)
        except ProtocolError as error:
            self.n_refused += 1
            return [Reply(asked.question, encode(Refusal(reason=str(error))))]
        pending = PendingRequest(caller, asked.question, asked.session, asked_at_s)
        if isinstance(caller.request, AdminRequest):
            answer, effects = self._operator.obey(caller.request, now_s)
            return [*effects, pending.reply(answer)]
        if not isinstance(caller.request, JoinRequest):
            return [pending.reply(Refusal(reason="this is no request for a seat"))]
        return self._admission.receive(pending, caller.request, now_s)

    def _on_request_opened(self, event: RequestOpened, now_s: float) -> list[Effect]:
        self._taken_last.spend(event.took_s)
        return []

    def _on_time(self, event: TimePassed, now_s: float) -> list[Effect]:
        for queue in (self._requests, self._matches.journal_replies):
            queue.save(now_s)
        return self._matches.advance(event.received_until_s) + self._admission.advance(now_s)

    def _on_presence(self, event: PresenceChanged, now_s: float) -> list[Effect]:
        if not topics.is_chunk(event.client):
            return []  # who asks for a seat is called otherwise
        if event.is_present:
            self._admission.welcome(event.client)
            if len(self._present) < MOST_QUEUED:
                self._present.add(event.client)
            return []
        self._present.discard(event.client)
        self._admission.lose(event.client, now_s)
        return self._matches.lose(event.client, now_s)

    def _on_lobby(self, event: LobbyAsked, now_s: float) -> list[Effect]:
        return [Reply(event.question, self._lobby.read(self._matches.n_begun, now_s))]

    def _on_journal(self, event: JournalAsked, now_s: float) -> list[Effect]:
        return self._matches.ask_for_journal(event)

    def _on_journals_ready(self, event: JournalsReady, now_s: float) -> list[Effect]:
        self._admission.n_journals = event.n
        return []

    def _hire(self, n_workers: int, *callbacks: Any) -> RemoteSessions:
        self._remote = RemoteSessions(n_workers, self._context, *callbacks)
        return self._remote

    def _on_worker(self, event: WorkerReady | WorkerLost | WorkerSaid, now_s: float) -> list[Effect]:
        assert self._remote is not None
        effects = self._remote.hear(event, now_s)
        self._admission.n_journals = self._remote.n_free
        return effects

    def _on_unfinished(self, event: UnfinishedFound, now_s: float) -> list[Effect]:
        return self._matches.resume(event, now_s)

    def _on_stopped(self, event: Stopped, now_s: float) -> list[Effect]:
        effects, replies = self._matches.stop(now_s), self._matches.journal_replies
        for _ in range(_MOST_LAST_REPLIES):
            if replies.may_take(is_rationed=False):
                effects.append(replies.take())
        return effects

    def _describe(self) -> Lobby:
        running = [
            {"match": one.id, "blue": one.names[0], "red": one.names[1], "tick": one.tick}
            for one in islice(self._matches.running, MOST_LISTED)
        ]
        return Lobby(
            pit=self._context.pit,
            rules=self._ruleset.name,
            rules_hash=self._ruleset.hash,
            ruleset=rules_values(self._ruleset),
            needs_invite=self._register.needs_invite,
            n_begun=self._matches.n_begun,
            running=running,
            waiting=self._admission.names[:MOST_LISTED],
            standings=self._seating.standings()[:MOST_STANDINGS],
            public_delay=self._context.public_delay,
        )
