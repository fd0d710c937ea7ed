"""A client process: one connection, one thread, one or more seats that play match after match.

It loses nothing but time when the pit goes away: it connects anew, asks for the seats that it held, and answers again what it
has answered before.
"""

import logging
import math
import time
import uuid
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np

from arena.errors import LostPitError, RefusedError, UnreadableError
from arena.game.ruleset import load as load_rules
from arena.game.types import RULES_VERSION, Team
from arena.policy import BatchFactory, BatchPolicy
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.messages import Closed, JoinRequest, Message, Refusal, Ticket, Wait
from arena.protocol.sealing import OpenSeal
from arena.protocol.sight import Reader
from arena.transport import Collector, Put, Sample, Session, is_beat, open_client, read_payload
from clients.seat import Seat

logger = logging.getLogger(__name__)

ANSWER_S = 8.0
"""A pit that lives answers a question within this time, if only with Wait."""
SILENCE_S = 2.0
"""A seat that hears nothing for so long asks whether its match still runs."""
PROBE_S = 2.0
MOST_UNANSWERED = 12
"""Questions in a row to which nobody was there to answer, a quarter of a second apart."""
MOST_WAITING = 2_000
"""Messages in the queue."""
_TICK_S = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How a client plays."""

    endpoint: str
    pit: str
    name: str
    team: str
    make: BatchFactory
    n_matches: int | None
    """None plays until the pit has no more matches."""
    n_slots: int = 1
    """Seats that it may hold at once."""
    patience_s: float = 60.0
    """How long it tries to reach a pit that it has lost."""
    rules_hash: str = ""


class _Slot:
    """A place for one seat at a time."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.seat: Seat | None = None
        self.put: Put | None = None
        self.ears: Collector | None = None
        self.leave = ExitStack()
        self.seal = OpenSeal()
        self.is_done = False
        self.asked_at_s: float | None = None
        self.n_unanswered = 0
        self.ask_limit_s = ANSWER_S
        self.heard_at_s = 0.0

    def free(self) -> None:
        """Let go of the seat."""
        self.fall_silent()
        self.seat = None

    def fall_silent(self) -> None:
        """Leave the seat's keys; the seat itself may be taken up on another connection."""
        self.leave.close()
        self.put, self.ears = None, None


_Heard = tuple[Callable[[_Slot, Any], None], _Slot, Any]
"""What is to be done with it, whose it is, and what it is."""


def warm(make: BatchFactory) -> None:
    """Compile what one of our own fighters needs, before anybody waits for it. A stranger's bot is left alone."""
    if not (isinstance(make, type) and issubclass(make, BatchPolicy)):
        return
    ruleset = load_rules("paper")
    nothing = Reader(ruleset, Team.BLUE).blank()
    policy = make(ruleset, Team.BLUE, 1)
    policy.start(np.zeros(1, np.intp))
    policy.act(nothing, np.zeros(nothing.cell.shape, np.int8))


class Runner:
    """Plays until there is nothing more to play."""

    def __init__(
        self,
        settings: Settings,
        *,
        on_seat: Callable[[Seat], None],
        on_end: Callable[[Seat], None],
        on_wait: Callable[[str], None],
    ) -> None:
        self._settings = settings
        self._on_seat, self._on_end, self._on_wait = on_seat, on_end, on_wait
        self._client = uuid.uuid4().hex
        self._slots = [_Slot(number) for number in range(settings.n_slots)]
        self._inbox: SimpleQueue[_Heard] = SimpleQueue()
        self._n_begun = self._n_ended = self._n_heard = 0
        self._is_stopping = False

    def stop(self) -> None:
        """Leave `run` soon; from a signal."""
        self._is_stopping = True

    def run(self) -> int:
        """Play, and return how many matches ended.

        Raises
        ------
        LostPitError
            The pit could not be reached for `patience_s`.
        RefusedError
            The pit does not let this client play.
        """
        warm(self._settings.make)
        settings = self._settings
        lost_at_s: float | None = None
        begun_at_s = time.monotonic()
        while not self._is_done():
            failure = LostPitError(f"no pit called {settings.pit} answers at {settings.endpoint}")
            heard_before = self._n_heard
            try:
                with open_client(settings.endpoint) as session:
                    self._serve(session)
                if lost_at_s is None and not any(slot.asked_at_s for slot in self._slots):
                    lost_at_s = begun_at_s  # the pit was opening, or closing: nothing was asked that it could have answered
            except LostPitError as error:
                failure = error
            if self._is_done():
                break
            if self._n_heard > heard_before:
                lost_at_s = time.monotonic()
            if lost_at_s is None or time.monotonic() - lost_at_s > settings.patience_s:
                raise failure
            self._on_wait("for the pit to come back")
        return self._n_ended

    def _has_begun_all(self) -> bool:
        return self._settings.n_matches is not None and self._n_begun >= self._settings.n_matches

    def _is_done(self) -> bool:
        return self._is_stopping or all(slot.is_done for slot in self._slots)

    def _serve(self, session: Session) -> None:
        """Play over one connection, until all is played or the pit is lost."""
        settings = self._settings
        session.declare_presence(topics.presence(settings.pit, settings.name, self._client))
        for slot in self._slots:
            slot.fall_silent()
            slot.asked_at_s = None
        checked_at_s = 0.0
        try:
            while not self._is_done():
                now_s = time.monotonic()
                if now_s - checked_at_s > _TICK_S:
                    checked_at_s = now_s
                    if not session.is_connected() or not self._keep_asking(session, now_s):
                        return
                try:
                    handle, slot, heard = self._wait()
                except Empty:
                    continue
                handle(slot, heard)
                if slot.seat is None:
                    checked_at_s = 0.0  # ask again at once
        finally:
            for slot in self._slots:
                slot.fall_silent()

    def _wait(self) -> _Heard:
        """Return what is heard next; raise `Empty` after about `_TICK_S`."""
        slot = self._slots[0]
        if slot.ears is None:
            return self._inbox.get(timeout=_TICK_S)
        sample = slot.ears.wait()
        return self._inbox.get_nowait() if is_beat(sample) else (self._on_turn, slot, sample)

    def _enqueue(self, handle: Callable[[_Slot, Any], None], slot: _Slot, heard: Any) -> None:
        """Leave what was heard for the one thread, on one of Zenoh's; what comes beyond the bound is asked for again."""
        if self._inbox.qsize() < MOST_WAITING:
            self._inbox.put((handle, slot, heard))

    def _on_silence(self, slot: _Slot) -> None:
        """Ask again a little later: a pit that opens has its router before its ears. In the end, give the pit up."""
        slot.n_unanswered += 1
        slot.asked_at_s = None if slot.n_unanswered < MOST_UNANSWERED else -math.inf

    def _keep_asking(self, session: Session, now_s: float) -> bool:
        """Ask for what is missing; False if the pit does not answer any more."""
        for slot in self._slots:
            if slot.is_done:
                continue
            if slot.asked_at_s is not None:
                if now_s - slot.asked_at_s > slot.ask_limit_s:
                    return False
            elif slot.seat is None or slot.put is None or now_s - slot.heard_at_s > SILENCE_S:
                self._ask(session, slot, now_s)
        return True

    def _ask(self, session: Session, slot: _Slot, now_s: float) -> None:
        """Ask for a seat, or, with one, whether the match still runs."""
        settings = self._settings
        if slot.seat is None and self._has_begun_all():
            slot.is_done = True
            return
        team = settings.team if slot.seat is None else slot.seat.team.name.lower()
        request = JoinRequest(
            rules_version=RULES_VERSION, name=settings.name, team=team, client=self._client, slot=slot.number,
            rules_hash=settings.rules_hash, match="" if slot.seat is None else slot.seat.ticket.match,
        )  # fmt: skip
        slot.asked_at_s, slot.ask_limit_s = now_s, ANSWER_S if slot.seat is None else PROBE_S
        answered = partial(self._enqueue, partial(self._on_answer, session), slot)
        session.ask(topics.join(settings.pit), encode(request), answered, slot.ask_limit_s)

    def _on_answer(self, session: Session, slot: _Slot, payload: bytes) -> None:
        if not payload:
            self._on_silence(slot)
            return
        slot.asked_at_s, slot.n_unanswered = None, 0
        slot.heard_at_s = time.monotonic()
        self._n_heard += 1
        try:
            message: Message = decode(payload)
        except UnreadableError as error:
            raise RefusedError(f"the pit cannot be understood: {error}") from error
        if isinstance(message, Ticket):
            self._sit_down(session, slot, message)
        elif isinstance(message, Refusal):
            raise RefusedError(f"the pit says no: {message.reason}")
        elif isinstance(message, Closed):
            self._on_wait(f"no more: {message.reason}")
            slot.free()
            slot.is_done = True
        elif isinstance(message, Wait):
            if slot.seat is not None:
                logger.warning("match %s is gone", slot.seat.ticket.match)
                slot.free()
            self._on_wait(message.reason)

    def _sit_down(self, session: Session, slot: _Slot, ticket: Ticket) -> None:
        """Take a seat, or the same one again, and say so to the referee."""
        if slot.seat is None or slot.seat.ticket.match != ticket.match:
            slot.free()
            slot.seat = Seat(ticket, self._settings.make)
            self._n_begun += 1
            self._on_seat(slot.seat)
        if slot.put is None:
            pit, team = self._settings.pit, slot.seat.team
            slot.put, end = session.publisher(topics.action(pit, ticket.match, team))
            slot.leave.callback(end)
            self._listen(session, slot, topics.observation(pit, ticket.match, team))
        slot.put(slot.seal.close(encode(slot.seat.ready())))

    def _listen(self, session: Session, slot: _Slot, key: str) -> None:
        """Hear the referee: a single seat outside Python, which spares each turn a tenth of its time; several by callbacks."""
        if len(self._slots) > 1:
            slot.leave.callback(session.subscribe(key, partial(self._enqueue, self._on_turn, slot)))
            return
        slot.ears = session.collect(key, MOST_WAITING)
        slot.leave.callback(slot.ears.end)
        slot.leave.callback(session.beat(key, _TICK_S))

    def _on_turn(self, slot: _Slot, sample: Sample) -> None:
        payload = read_payload(sample)
        if slot.seat is None or slot.put is None:
            return
        try:
            answer = slot.seat.receive(decode(slot.seal.open(payload)))
        except UnreadableError as error:
            logger.warning("the referee sent what cannot be read: %s", error)
            return
        slot.heard_at_s = time.monotonic()
        if answer is not None:
            slot.put(slot.seal.close(encode(answer)))
        if slot.seat.ended is not None:
            self._n_ended += 1
            self._on_end(slot.seat)
            slot.free()
            slot.is_done = self._has_begun_all()  # now: the pit may be gone the next moment
