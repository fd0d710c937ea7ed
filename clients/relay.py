"""A relay for spectators: it hears a pit once, and tells any number of them. To the pit, they are one.

It needs no trust, since what a pit says is signed or sealed. Nobody can play through it.
"""

import math
import time
from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event

from arena.errors import LostPitError, UnreadableError
from arena.network.address import Address
from arena.network.asking import ANSWER_S, RETRY_S
from arena.network.links import Kept
from arena.network.session import Query, Sample, Session, open_client, read_key, read_payload
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.messages import ChallengeRequest, Refusal
from clients.lobby import ask_challenge

MOST_WAITING = 10_000
"""Messages and questions; what comes beyond is dropped."""
_MOST_ASKED, _MOST_KEPT = 64, 64
"""Questions that the pit is asked at a time, and answers that are kept."""
_MOST_WHO_WAIT = 10_000
"""For answers of the pit; whoever comes beyond asks again."""
_FRESH_S = 1.0
"""An answer is given for so long to whoever else asks the same."""
_LOOK_S = 0.2
_NO_SEATS = encode(Refusal(reason="this is a relay for spectators; join at the pit itself"))
_Question = tuple[str, bytes]
"""Its key, and what is asked."""


class Relay:
    """A relay of one pit; `run` works until `stop`.

    Parameters
    ----------
    router
        Where spectators are, opened by `open_router` for them alone.
    trust
        Raises if the pit whose public key it is given is not the one that was meant.
    on_change
        Told in words when the pit was found, and when it was lost.
    """

    def __init__(
        self,
        address: Address,
        authority: Path | None,
        router: Session,
        trust: Callable[[bytes], None],
        on_change: Callable[[str], None],
    ) -> None:
        self._address, self._authority, self._router, self._trust, self._on_change = address, authority, router, trust, on_change
        self._stopped = Event()
        self._inbox: SimpleQueue[Callable[[Session], None]] = SimpleQueue()
        self._asked: dict[_Question, list[Query]] = {}
        """Questions that wait for the pit's answer, and who asked each."""
        self._n_who_wait = 0
        self._answers: OrderedDict[_Question, tuple[float, bytes]] = OrderedDict()
        pit = address.pit
        self._boards = [router.broadcast(key) for key in (topics.all_truths(pit), topics.all_delayed(pit))]
        """What the pit makes only for whoever wants it, so it is heard only while somebody here does."""
        self._board_keys = [topics.all_truths(pit), topics.all_delayed(pit)]
        for key in (topics.join(pit), topics.lobby(pit), topics.all_journals(pit)):
            router.answer(key, self._take_question)

    def stop(self) -> None:
        """Leave `run` soon; from any thread, or a signal."""
        self._stopped.set()

    def run(self) -> None:
        """Relay until stopped; a pit that is away is looked for until it is back.

        Raises
        ------
        ArenaError
            What answers there is another pit.
        """
        trouble = ""
        while not self._stopped.is_set():
            try:
                with open_client(self._address.endpoint, self._authority) as pit:
                    self._trust(ask_challenge(pit, self._address).pit_key)
                    trouble = ""
                    self._on_change(f"hears {self._address.pit} at {self._address.endpoint}")
                    self._serve(pit)
            except LostPitError as error:
                if str(error) != trouble:
                    trouble = str(error)
                    self._on_change(f"{trouble}; looking for it")
            self._stopped.wait(RETRY_S)

    def _serve(self, pit: Session) -> None:
        """Relay as long as the pit is there."""
        self._forget()
        heard: list[Callable[[], None] | None] = [None] * len(self._boards)
        pit.subscribe(topics.all_public(self._address.pit), self._take_sample)
        next_s = 0.0
        while not self._stopped.is_set():
            now_s = time.monotonic()
            if now_s >= next_s:
                next_s = now_s + _LOOK_S
                if not pit.is_connected():
                    return
                self._router.relieve(Kept, now_s)
                self._follow(pit, heard)
            try:
                self._inbox.get(timeout=_LOOK_S)(pit)
            except Empty:
                continue

    def _forget(self) -> None:
        """Drop what was asked while the pit was away: who asked has given up, or asks again."""
        for queries in self._asked.values():
            for query in queries:
                query.drop()
        self._asked.clear()
        self._n_who_wait = 0
        self._answers.clear()

    def _follow(self, pit: Session, heard: list[Callable[[], None] | None]) -> None:
        """Hear the boards while there is somebody who wants them."""
        for number, (board, key) in enumerate(zip(self._boards, self._board_keys, strict=True)):
            end = heard[number]
            if board.has_subscribers and end is None:
                heard[number] = pit.subscribe(key, self._take_sample)
            elif not board.has_subscribers and end is not None:
                end()
                heard[number] = None

    # From threads of Zenoh's

    def _take_sample(self, sample: Sample) -> None:
        if self._inbox.qsize() < MOST_WAITING:
            self._inbox.put(lambda _: self._router.spread(read_key(sample), read_payload(sample)))

    def _take_question(self, query: Query) -> None:
        if self._inbox.qsize() < MOST_WAITING:
            self._inbox.put(partial(self._ask, query))
        else:
            query.drop()

    def _take_answer(self, question: _Question, payload: bytes) -> None:
        self._inbox.put(lambda _: self._answer(question, payload))

    # From the one that runs

    def _ask(self, query: Query, pit: Session) -> None:
        question, now_s = (query.key, query.payload), time.monotonic()
        answered_s, answer = self._answers.get(question, (-math.inf, b""))
        if query.key == topics.join(self._address.pit) and not _is_challenge(query.payload):
            query.answer(_NO_SEATS)
        elif now_s - answered_s < _FRESH_S:
            query.answer(answer)
        elif self._n_who_wait >= _MOST_WHO_WAIT:
            query.drop()
        elif question in self._asked:
            self._wait(query, question)
        elif "*" in query.key or len(self._asked) >= _MOST_ASKED:
            query.drop()
        else:
            self._asked[question] = []
            self._wait(query, question)
            pit.ask(*question, partial(self._take_answer, question), ANSWER_S)

    def _wait(self, query: Query, question: _Question) -> None:
        self._asked[question].append(query)
        self._n_who_wait += 1

    def _answer(self, question: _Question, payload: bytes) -> None:
        queries = self._asked.pop(question, [])
        self._n_who_wait -= len(queries)
        for query in queries:
            if payload:
                query.answer(payload)
            else:
                query.drop()
        if payload:
            self._answers[question] = time.monotonic(), payload
            self._answers.move_to_end(question)
            while len(self._answers) > _MOST_KEPT:
                self._answers.popitem(last=False)


def _is_challenge(payload: bytes) -> bool:
    try:
        return isinstance(decode(payload), ChallengeRequest)
    except UnreadableError:
        return False
