"""Where authors submit to a season: a queryable on a router of the season's own, and the one thread that answers.

No match waits for it, and it waits for no match: what floods it slows down submitting alone.
"""

import logging
import time
from collections.abc import Callable
from queue import Empty, Full, Queue
from threading import Event, Thread
from types import TracebackType

from arena.errors import ArenaError, ForgedError, ProtocolError
from arena.network.links import Kept
from arena.network.session import Query, Session
from arena.pit.authenticator import Authenticator
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.identity import Identity
from arena.protocol.messages import ChallengeRequest, Message, Refusal, SealedRequest, SeasonRequest, Wait
from tournaments.season.owners import OwnerRequests

MOST_WAITING = 256
"""Questions; what comes beyond is dropped, and asked again. None is longer than a message."""
_LOOK_S = 0.1
_KNOWN_S = 60.0
"""How long a connection is kept before others after its last signed request."""
_MOST_KNOWN = 4_096
logger = logging.getLogger(__name__)


class Desk:
    """Answers the owners of a season's entries, from `__enter__` to `__exit__`.

    Parameters
    ----------
    session
        A router that lets clients do what `arena.network.access` allows them.
    season
        Its name, which is that of the pit in its address.
    identity
        The season's key.
    """

    def __init__(
        self,
        session: Session,
        season: str,
        identity: Identity,
        owners: OwnerRequests,
        *,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._session, self._key, self._owners, self._now = session, topics.submissions(season), owners, now
        self._authenticator = Authenticator(season, identity)
        self._inbox: Queue[Query] = Queue(MOST_WAITING)
        self._known: dict[str, float] = {}
        """When each connection last sent what was signed."""
        self._is_over = Event()
        self._thread = Thread(target=self._run, name="submissions", daemon=True)
        self.failure: BaseException | None = None
        """Why it answers no more."""

    def __enter__(self) -> "Desk":
        self._end_answers = self._session.answer(self._key, self._enqueue)
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._end_answers()
        self._is_over.set()
        self._thread.join()

    def _enqueue(self, query: Query) -> None:
        try:
            self._inbox.put_nowait(query)
        except Full:
            query.drop()

    def _run(self) -> None:
        try:
            while not self._is_over.is_set():
                try:
                    query = self._inbox.get(timeout=_LOOK_S)
                except Empty:
                    query = None
                if query is not None:
                    query.answer(self._answer(query))
                self._session.relieve(self._find_kept, self._now())
        except BaseException as error:
            self.failure = error
            raise

    def _answer(self, query: Query) -> bytes:
        """Return what a query is answered with; what nobody signed is answered by a bare refusal."""
        now_s = self._now()
        try:
            message = decode(query.payload)
            if isinstance(message, ChallengeRequest):
                return self._authenticator.challenge(now_s)
            if not isinstance(message, SealedRequest):
                return encode(Refusal(reason="this is no request to a season"))
            caller = self._authenticator.open(query.payload, now_s)
        except ProtocolError as error:
            return encode(Refusal(reason=f"the request is not taken: {error}"))
        self._know(query.sender, now_s)
        answer: Message
        if isinstance(caller.request, SeasonRequest):
            try:
                answer = self._owners.answer(caller.request, now_s)
            except ArenaError as error:
                logger.warning("an owner of an entry has to wait: %s", error)
                answer = Wait(reason="the season cannot do that now; its organiser was told")
        else:
            answer = Refusal(reason="a season takes submissions here; who plays from elsewhere joins its pit")
        try:
            return caller.answer(answer)
        except ForgedError as error:
            return encode(Refusal(reason=str(error)))

    def _know(self, sender: str, now_s: float) -> None:
        if sender:
            self._known.pop(sender, None)
            self._known[sender] = now_s
        if len(self._known) > _MOST_KNOWN:
            del self._known[next(iter(self._known))]

    def _find_kept(self) -> Kept:
        now_s = self._now()
        return Kept(longest=[sender for sender, at_s in self._known.items() if now_s - at_s < _KNOWN_S])
