"""The slots of a client as a state machine without I/O: it asks the pit for seats, plays in them, and audits what was played.

A slot is in one of these states, and moves on by what it receives:

    free -- asks for a seat --> asking -- Ticket --> playing -- Ended --> free, or done after the last match
                                  |  Wait: asks again at once              |
                                  |  nobody answers: asks again later      |  silence: asks whether the match still runs
                                  +- Closed: done                          +- Ticket (new keys), Signed (the ending), Wait (gone)

Every question is two queries: ChallengeRequest, answered by a Challenge, and SealedRequest, answered by one of the above. What
comes over the network counts only once the pit's signature or seal was checked.
"""

import logging
from collections.abc import Callable

from arena.errors import ArenaError, LostPitError, ProtocolError, RefusedError, UnreadableError, VersionError
from arena.game.types import RULES_VERSION
from arena.protocol import topics
from arena.protocol.codec import encode
from arena.protocol.handshake import Attempt, read_challenge
from arena.protocol.messages import ChallengeRequest, Closed, JoinRequest, Refusal, Signed, Ticket, Wait
from clients import events
from clients.audit import JournalDownload, audit
from clients.seat import Seat
from clients.seat_session import SeatSession, read_commitment
from clients.settings import ClientSettings
from clients.slot import Question, Slot

logger = logging.getLogger(__name__)

ANSWER_S = 8.0
"""A running pit answers a request for a seat within this time, if only with Wait."""
PROBE_S = 2.0
"""The same for the question whether a match still runs."""
SILENCE_S = 2.0
"""A seat that hears nothing for so long asks whether its match still runs."""
START_S = 30.0
"""The same for a seat whose policy has not started: the referee waits for it, unless the match is over."""
JOURNAL_S = 4.0
"""A running pit sends a piece of a journal within this time."""
MOST_UNANSWERED = 24
"""Questions in a row that nobody was there to answer: a pit that opens has its router before it answers queries."""

MakeSeat = Callable[[Ticket, bytes, bytes], Seat]
"""From a ticket, the pit's commitment to its match, and the pit's public key."""


class ClientCore:
    """Plays until there is nothing more to play. The caller carries the effects out, in their order.

    Parameters
    ----------
    client
        Unique to this process, by which the pit tells it from others of its name.
    """

    def __init__(self, settings: ClientSettings, client: str, make_seat: MakeSeat) -> None:
        self._settings, self._client, self._make_seat = settings, client, make_seat
        self._slots = [Slot(number) for number in range(settings.n_slots)]
        self._n_left = settings.n_slots
        """Slots that are not done."""
        self._audits: dict[int, tuple[SeatSession, JournalDownload]] = {}
        """Running downloads by their query."""
        self._effects: list[events.Effect] = []
        self._n_queries = self._n_begun = 0
        """Questions so far; matches so far, without those that were gone before they ended."""
        self.n_ended = 0
        """Matches that were played to their end."""
        self._connected_at_s: float | None = None  # when the last connection was opened
        self._lost_at_s: float | None = None  # when the pit was last there; None until it has answered
        self._has_answered = False
        """Whether the pit has answered over this connection."""

    @property
    def is_done(self) -> bool:
        """Whether all is played and audited."""
        return not self._n_left and not self._audits

    def receive(self, event: events.Event, now_s: float) -> list[events.Effect]:
        """Take an event, and return what is to be done.

        Raises
        ------
        RefusedError
            The pit does not let this client play, or cannot be understood.
        LostPitError
            The pit was away for longer than `patience_s`.
        """
        self._effects = []
        match event:
            case events.MessageReceived():
                self._on_delivery(self._slots[event.slot], event.payload, now_s)
            case events.TimePassed():
                self._on_clock(now_s)
            case events.ReplyReceived():
                self._on_reply(event.query, event.payload, now_s)
            case events.Woken():
                self._think()
            case events.Connected():
                self._connected_at_s = now_s
            case events.Disconnected():
                self._on_disconnect(event.failure, now_s)
        return self._effects

    # A seat's messages

    def _on_delivery(self, slot: Slot, payload: bytes, now_s: float) -> None:
        if slot.session is None or not slot.is_open:
            return
        try:
            said = slot.session.receive(payload)
        except ProtocolError as error:
            logger.info("dropped a message on the seat's key that the referee did not send: %s", error)
            return
        slot.has_heard = True
        self._publish(slot, said)
        if slot.session.seat.ended is not None:
            self._end(slot, slot.session, now_s)

    def _think(self) -> None:
        """Go on with every policy that needed longer."""
        for slot in self._slots:
            if slot.session is not None and slot.is_open:
                self._publish(slot, slot.session.think())

    def _publish(self, slot: Slot, said: list[bytes]) -> None:
        self._effects += [events.Publish(slot.number, payload) for payload in said]

    def _end(self, slot: Slot, session: SeatSession, now_s: float) -> None:
        """Leave a match that is over, and go on to the next."""
        self.n_ended += 1
        self._effects.append(events.MatchEnded(session.seat))
        if self._settings.on_audit is not None:
            self._download(session, JournalDownload())
        self._free(slot)
        self._ask(slot, now_s)

    def _free(self, slot: Slot) -> None:
        if slot.session is not None and slot.session.seat.ended is not None:
            slot.last_match = slot.session.seat.ticket.match
        if slot.is_open:
            self._effects.append(events.CloseSeat(slot.number))
        if slot.session is not None:
            slot.session.seat.abandon()
        slot.session, slot.is_open = None, False

    def _finish(self, slot: Slot) -> None:
        self._n_left -= not slot.is_done
        slot.is_done = True

    # Questions

    def _on_clock(self, now_s: float) -> None:
        for slot in self._slots:
            seat = None if slot.session is None else slot.session.seat
            is_starting = seat is not None and seat.is_starting
            if slot.has_heard or (seat is not None and seat.owes_ready and not is_starting):
                slot.has_heard, slot.heard_at_s = False, now_s  # silence begins now, however long the policy thought
            if slot.is_done:
                continue
            if slot.n_unanswered >= MOST_UNANSWERED or (
                slot.question is not None and now_s - slot.question.asked_at_s > slot.question.limit_s
            ):
                self._effects.append(events.Reconnect())
                return
            is_behind = seat is not None and seat.is_behind
            silence_s = START_S if is_starting else SILENCE_S
            if slot.question is None and (not slot.is_open or is_behind or now_s - slot.heard_at_s > silence_s):
                self._ask(slot, now_s)
        self._think()

    def _ask(self, slot: Slot, now_s: float) -> None:
        """Ask for a seat if the policy could take one, or whether the match of its own still runs; once at a time."""
        n_matches = self._settings.n_matches
        n_asked = sum(one.session is None and one.question is not None for one in self._slots)
        n_others = sum(other.session is None and not other.is_done for other in self._slots if other is not slot)
        if slot.session is None and n_matches is not None and self._n_begun + n_others >= n_matches:
            self._finish(slot)  # what is left to play is the other slots', which ask already
        elif slot.question is None and (slot.session is not None or n_asked < self._settings.count_ready()):
            limit_s = ANSWER_S if slot.session is None else PROBE_S
            query = self._query(topics.join(self._settings.pit), encode(ChallengeRequest()), limit_s)
            slot.question = Question(query, now_s, limit_s)

    def _query(self, key: str, payload: bytes, timeout_s: float) -> int:
        self._n_queries += 1
        self._effects.append(events.Query(self._n_queries, key, payload, timeout_s))
        return self._n_queries

    def _on_reply(self, query: int, payload: bytes, now_s: float) -> None:
        if query in self._audits:
            self._on_piece(*self._audits.pop(query), payload)
            return
        for slot in self._slots:
            if (question := slot.question) is not None and question.query == query:
                slot.question = None
                if not payload:
                    is_answered = False
                elif question.attempt is None:
                    is_answered = self._on_challenge(slot, question.limit_s, payload, now_s)
                else:
                    is_answered = self._on_answer(slot, question.attempt, payload, now_s)
                if not is_answered:
                    slot.n_unanswered += 1  # asked again at the next `TimePassed`

    def _on_challenge(self, slot: Slot, limit_s: float, payload: bytes, now_s: float) -> bool:
        """Send the request, if the pit is the one that was meant; return whether a pit made the challenge."""
        settings = self._settings
        try:
            challenge = read_challenge(settings.pit, payload)
        except VersionError as error:
            raise RefusedError(f"the pit cannot be understood: {error}") from error
        except ProtocolError as error:  # of somebody in between; perhaps not the next time
            logger.info("dropped a challenge that no pit made: %s", error)
            return False
        settings.trust(challenge.pit_key)
        seat = None if slot.session is None else slot.session.seat
        request = JoinRequest(
            rules_version=RULES_VERSION,
            name=settings.name,
            team=settings.team if seat is None else seat.team.name.lower(),
            client=self._client,
            slot=slot.number,
            rules_hash=settings.rules_hash,
            match="" if seat is None else seat.ticket.match,
            invite=settings.invite,
            # A pit that knew no versions or bundles yet does not read a request with them: whoever got no answer asks without.
            version="" if seat is not None or slot.n_unanswered % 2 else settings.version,
            bundles=settings.n_slots > 1 and not slot.n_unanswered % 2,
        )
        attempt = Attempt(settings.identity, settings.pit, challenge, request)
        query = self._query(topics.join(settings.pit), attempt.sealed, limit_s)
        slot.question = Question(query, now_s, limit_s, attempt)
        return True

    def _on_answer(self, slot: Slot, attempt: Attempt, payload: bytes, now_s: float) -> bool:
        """Act on the answer to a request; return whether the pit gave it."""
        try:
            message = attempt.open(payload)
        except ProtocolError as error:  # anybody can refuse in the pit's name; only the pit can seal it
            logger.info("dropped an answer that the pit did not seal: %s", error)
            return False
        slot.n_unanswered, slot.heard_at_s, self._has_answered = 0, now_s, True
        match message:
            case Ticket():
                self._take(slot, attempt, message)
            case Refusal():
                self._on_refusal(slot, message)
            case Closed():
                self._effects.append(events.Waiting(f"no more: {message.reason}"))
                self._free(slot)
                self._finish(slot)
            case Signed() if slot.session is not None:  # else the ending came on the seat's key a moment ago
                self._on_late_ending(slot, slot.session, message, now_s)
            case Wait():
                if slot.session is not None:
                    logger.warning("match %s is gone", slot.session.seat.ticket.match)
                    self._n_begun -= 1
                    self._free(slot)
                self._effects.append(events.Waiting(message.reason))
        if slot.session is None and not slot.is_done:
            self._ask(slot, now_s)
        return True

    def _on_refusal(self, slot: Slot, refusal: Refusal) -> None:
        """Give up, or, while another slot is seated, give up this slot alone: its match is played to its end."""
        if all(other.session is None for other in self._slots if other is not slot):
            raise RefusedError(f"the pit says no: {refusal.reason}")
        self._effects.append(events.Waiting(f"no more with slot {slot.number + 1}: {refusal.reason}"))
        self._free(slot)
        self._finish(slot)

    def _take(self, slot: Slot, attempt: Attempt, ticket: Ticket) -> None:
        """Take a seat, or the same one again under new keys."""
        if ticket.match == slot.last_match:
            return
        commitment = read_commitment(ticket, attempt.pit_key).digest
        seat = slot.session.seat if slot.session is not None and slot.session.seat.ticket.match == ticket.match else None
        if seat is None:
            self._n_begun += slot.session is None  # the match that it had is gone
            self._free(slot)
            try:
                seat = self._make_seat(ticket, commitment, attempt.pit_key)
            except UnreadableError as error:
                raise RefusedError(f"the pit cannot be understood: {error}") from error
            self._effects.append(events.MatchBegun(seat))
        elif seat.commitment != commitment:
            raise RefusedError(f"the pit commits itself to match {ticket.match} anew: it is not the match that it was")
        slot.session = SeatSession(seat, ticket.secret, attempt, self._settings.identity)
        self._effects.append(events.OpenSeat(slot.number, ticket.lane, seat.team, ticket.bundle_lane))
        slot.is_open = True
        self._publish(slot, slot.session.listen())

    def _on_late_ending(self, slot: Slot, session: SeatSession, signed: Signed, now_s: float) -> None:
        """Learn how the match ended while this client was away."""
        try:
            receipt = session.accept_ending(signed)
        except ProtocolError as error:
            raise RefusedError(f"the pit cannot be understood: {error}") from error
        if slot.is_open:
            self._effects.append(events.Publish(slot.number, receipt))
        self._end(slot, session, now_s)

    # Audits

    def _download(self, session: SeatSession, download: JournalDownload) -> None:
        key = topics.journal(self._settings.pit, session.seat.ticket.match)
        self._audits[self._query(key, download.request(), JOURNAL_S)] = session, download

    def _on_piece(self, session: SeatSession, download: JournalDownload, payload: bytes) -> None:
        try:
            journal = download.receive(payload)
        except ArenaError as error:
            self._effects.append(events.Audited(session.seat, (None, str(error))))
            return
        if journal is None:
            self._download(session, download)
        else:
            self._effects.append(events.Audited(session.seat, audit(session.seat, journal, session.pit_key)))

    # Connections

    def _on_disconnect(self, failure: LostPitError, now_s: float) -> None:
        """Keep the seats for another connection; give up once the pit was away for too long."""
        if self._connected_at_s is None:
            self._on_failed_attempt(failure, now_s)
            return
        has_asked = any(slot.question is not None or slot.n_unanswered >= MOST_UNANSWERED for slot in self._slots)
        if self._has_answered:
            self._lost_at_s = now_s
        elif self._lost_at_s is None and not has_asked:
            self._lost_at_s = self._connected_at_s  # the pit was opening, or closing: it was asked nothing that it could answer
        self._has_answered = False
        self._audits.clear()
        for slot in self._slots:
            slot.is_open, slot.question, slot.n_unanswered = False, None, 0
        if self.is_done:
            return
        if self._lost_at_s is None or now_s - self._lost_at_s > self._settings.patience_s:
            raise failure
        self._effects.append(events.Waiting("for the pit to come back"))

    def _on_failed_attempt(self, failure: LostPitError, now_s: float) -> None:
        """Look for a pit that has never been there, and may open yet."""
        if self._lost_at_s is None:
            self._lost_at_s = now_s
            if self._settings.patience_s:
                self._effects.append(events.Waiting(f"for the pit at {self._settings.endpoint}"))
        if now_s - self._lost_at_s >= self._settings.patience_s:
            raise failure
