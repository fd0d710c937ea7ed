"""A client process: one connection, one thread, one or more seats that play match after match.

It loses nothing but time when the pit goes away: it connects anew, asks for the seats that it held, and answers again what it
has answered before.
"""

import logging
import math
import time
import uuid
from collections.abc import Callable
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

from arena.errors import LostPitError, ProtocolError, RefusedError, UnreadableError, VersionError
from arena.game.types import RULES_VERSION
from arena.network.session import Sample, Session, is_beat, open_client, read_payload
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt, check_challenge
from arena.protocol.messages import Challenge, ChallengeRequest, Closed, Commitment, JoinRequest, Refusal, Signed, Ticket, Wait
from arena.records.transcript import TranscriptHeader, TranscriptWriter, transcript_name
from clients.audit import Verdict, fetch
from clients.precompile import warm
from clients.seat import Seat
from clients.settings import Settings
from clients.slot import ANSWER_S, Slot

logger = logging.getLogger(__name__)

SILENCE_S = 2.0
"""A seat that hears nothing for so long asks whether its match still runs."""
PROBE_S = 2.0
MOST_UNANSWERED = 24
"""Questions in a row, `TICK_S` apart, to which nobody was there to answer: a pit that opens has its router before its ears."""
MOST_WAITING = 2_000
"""Messages in the queue."""
TICK_S = 0.25


_Heard = tuple[Callable[[Slot, Any], None], Slot, Any]
"""What is to be done with it, whose it is, and what it is."""


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
        self._slots = [Slot(number, settings.identity) for number in range(settings.n_slots)]
        self._inbox: SimpleQueue[_Heard] = SimpleQueue()
        self._n_begun = self._n_ended = self._n_heard = 0
        self._is_stopping = False
        self._pit_key = b""
        self._session: Session | None = None
        self._n_auditing = 0

    def stop(self) -> None:
        """Leave `run` soon; from a signal."""
        self._is_stopping = True

    def wake(self) -> None:
        """Ask policies that needed longer at once; from any thread, and of use with `is_patient`."""
        for slot in self._slots:
            self._enqueue(_ask_again, slot, None)

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
                with open_client(settings.endpoint, settings.authority) as session:
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
        return self._is_stopping or (all(slot.is_done for slot in self._slots) and not self._n_auditing)

    def _serve(self, session: Session) -> None:
        """Play over one connection, until all is played or the pit is lost."""
        settings, self._session = self._settings, session
        self._inbox = SimpleQueue()  # what came over another connection, or when it closed, answers nothing any more
        session.declare_presence(topics.presence(settings.pit, settings.name, self._client))
        for slot in self._slots:
            slot.fall_silent()
            slot.asked_at_s = None
        checked_at_s = 0.0
        try:
            while not self._is_done():
                now_s = time.monotonic()
                if now_s - checked_at_s > TICK_S:
                    checked_at_s = now_s
                    if not session.is_connected() or not self._keep_asking(session, now_s):
                        return
                    for slot in self._slots:
                        slot.ask_again()
                try:
                    handle, slot, heard = self._wait()
                except Empty:
                    continue
                handle(slot, heard)
                if slot.seat is None and not slot.n_unanswered:
                    checked_at_s = 0.0  # ask again at once
        finally:
            self._n_auditing = 0  # what was asked over this connection is not answered any more
            for slot in self._slots:
                slot.fall_silent()

    def _wait(self) -> _Heard:
        """Return what is heard next; raise `Empty` after about `TICK_S`."""
        slot = self._slots[0]
        if slot.ears is None:
            return self._inbox.get(timeout=TICK_S)
        sample = slot.ears.wait()
        return self._inbox.get_nowait() if is_beat(sample) else (self._on_turn, slot, sample)

    def _enqueue(self, handle: Callable[[Slot, Any], None], slot: Slot, heard: Any) -> None:
        """Leave what was heard for the one thread, on one of Zenoh's; what comes beyond the bound is asked for again."""
        if self._inbox.qsize() < MOST_WAITING:
            self._inbox.put((handle, slot, heard))

    def _on_silence(self, slot: Slot) -> None:
        """Ask again a little later; in the end, give the pit up."""
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

    def _ask(self, session: Session, slot: Slot, now_s: float) -> None:
        """Ask for a seat, or, with one, whether the match still runs."""
        if slot.seat is None and self._has_begun_all():
            slot.is_done = True
            return
        slot.asked_at_s, slot.ask_limit_s = now_s, ANSWER_S if slot.seat is None else PROBE_S
        self._question(session, slot, encode(ChallengeRequest()), partial(self._on_challenge, session))

    def _question(self, session: Session, slot: Slot, payload: bytes, handle: Callable[[Slot, bytes], None]) -> None:
        session.ask(topics.join(self._settings.pit), payload, partial(self._enqueue, handle, slot), slot.ask_limit_s)

    def _on_challenge(self, session: Session, slot: Slot, payload: bytes) -> None:
        """Send the request, if it is the right pit."""
        settings = self._settings
        if not payload:
            self._on_silence(slot)
            return
        try:
            challenge = decode(payload)
            if not isinstance(challenge, Challenge):
                raise UnreadableError("it answers with something else than its keys")
            check_challenge(settings.pit, challenge)
        except VersionError as error:
            raise RefusedError(f"the pit cannot be understood: {error}") from error
        except ProtocolError as error:  # somebody in between; perhaps not the next time
            logger.info("this is no word of a pit: %s", error)
            self._on_silence(slot)
            return
        settings.trust(challenge.pit_key)
        self._pit_key = challenge.pit_key
        request = JoinRequest(
            rules_version=RULES_VERSION,
            name=settings.name,
            team=settings.team if slot.seat is None else slot.seat.team.name.lower(),
            client=self._client,
            slot=slot.number,
            rules_hash=settings.rules_hash,
            match="" if slot.seat is None else slot.seat.ticket.match,
            invite=settings.invite,
        )
        attempt = Attempt(settings.identity, settings.pit, challenge, request)
        slot.asked_at_s = time.monotonic()
        self._question(session, slot, attempt.sealed, partial(self._on_answer, session, attempt))

    def _on_answer(self, session: Session, attempt: Attempt, slot: Slot, payload: bytes) -> None:
        try:
            message = attempt.open(payload) if payload else None
        except ProtocolError as error:  # anybody can say no in the pit's name; only the pit can seal it
            logger.info("the pit's answer counts for nothing: %s", error)
            message = None
        if message is None:
            self._on_silence(slot)
            return
        slot.asked_at_s, slot.n_unanswered = None, 0
        slot.heard_at_s = time.monotonic()
        self._n_heard += 1
        if isinstance(message, Ticket):
            self._sit_down(session, slot, attempt, message)
        elif isinstance(message, Refusal):
            raise RefusedError(f"the pit says no: {message.reason}")
        elif isinstance(message, Closed):
            self._on_wait(f"no more: {message.reason}")
            slot.free()
            slot.is_done = True
        elif isinstance(message, Signed):
            self._on_late_ending(slot, message)
        elif isinstance(message, Wait):
            if slot.seat is not None:
                logger.warning("match %s is gone", slot.seat.ticket.match)
                slot.free()
            self._on_wait(message.reason)

    def _sit_down(self, session: Session, slot: Slot, attempt: Attempt, ticket: Ticket) -> None:
        """Take a seat, or the same one again, and say so to the referee."""
        if ticket.match == slot.over:
            return
        try:
            is_new = slot.take(ticket, attempt, self._make_seat)
        except UnreadableError as error:
            raise RefusedError(f"the pit cannot be understood: {error}") from error
        if slot.seat is None:
            return
        if is_new:
            self._n_begun += 1
            self._on_seat(slot.seat)
        if slot.put is None:
            pit, team = self._settings.pit, slot.seat.team
            slot.put, end = session.publisher(topics.action(pit, ticket.match, team))
            slot.leave.callback(end)
            self._listen(session, slot, topics.observation(pit, ticket.match, team))
        slot.send(slot.seat.ready())

    def _make_seat(self, ticket: Ticket, commitment: Commitment) -> Seat:
        settings = self._settings
        seat = Seat(ticket, commitment.digest, settings.make)
        if settings.transcripts is not None:
            header = TranscriptHeader(
                match=ticket.match,
                pit=settings.pit,
                pit_key=self._pit_key,
                entry_key=settings.identity.public,
                name=settings.name,
                opponent=ticket.opponent,
                team=seat.team,
                ruleset=seat.ruleset,
                commitment=commitment.digest,
            )
            name = transcript_name(settings.pit, ticket.match, seat.team)
            seat.keep(TranscriptWriter(settings.transcripts / name, header))
        return seat

    def _listen(self, session: Session, slot: Slot, key: str) -> None:
        """Hear the referee: a single seat outside Python, which spares each turn a tenth of its time; several by callbacks.

        By callbacks as well for a policy that takes its time, since it may have its answer when nothing is heard.
        """
        if len(self._slots) > 1 or self._settings.is_patient:
            slot.leave.callback(session.subscribe(key, partial(self._enqueue, self._on_turn, slot)))
            return
        slot.ears = session.collect(key, MOST_WAITING)
        slot.leave.callback(slot.ears.end)
        slot.leave.callback(session.beat(key, TICK_S))

    def _on_turn(self, slot: Slot, sample: Sample) -> None:
        if slot.seat is None or slot.put is None:
            return
        try:
            slot.receive(read_payload(sample))
        except ProtocolError as error:
            logger.info("heard on the seat's key, and not from the referee: %s", error)
            return
        slot.heard_at_s = time.monotonic()
        self._after(slot)

    def _after(self, slot: Slot) -> None:
        """Go on to the next match, if one has ended."""
        if slot.seat is not None and slot.seat.ended is not None:
            self._n_ended += 1
            self._on_end(slot.seat)
            if self._settings.on_audit is not None:
                self._begin_audit(slot, slot.seat, self._settings.on_audit)
            slot.free()
            slot.is_done = self._has_begun_all()  # now: the pit may be gone the next moment

    def _on_late_ending(self, slot: Slot, signed: Signed) -> None:
        """Hear how a match ended while this client was away."""
        if slot.seat is None:
            return  # it was told on the seat's own key a moment ago
        try:
            slot.accept(signed)
        except ProtocolError as error:
            raise RefusedError(f"the pit cannot be understood: {error}") from error
        self._after(slot)

    def _begin_audit(self, slot: Slot, seat: Seat, on_audit: Callable[[Seat, Verdict], None]) -> None:
        """Ask for the journal of a match that is over, and go on."""

        def on_end(verdict: Verdict) -> None:
            self._n_auditing -= 1
            on_audit(seat, verdict)

        def defer(handle: Callable[[bytes], None]) -> Callable[[bytes], None]:
            return partial(self._enqueue, lambda _, payload: handle(payload), slot)

        if self._session is not None:
            self._n_auditing += 1
            fetch(self._session, self._settings.pit, seat, self._pit_key, defer, on_end)


def _ask_again(slot: Slot, _: None) -> None:
    slot.ask_again()
