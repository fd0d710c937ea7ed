"""A place for one seat at a time: the seat, its keys on the network, and the way to the referee and back."""

from collections.abc import Callable
from contextlib import ExitStack, suppress

from arena.errors import ForgedError, ProtocolError, RefusedError
from arena.network.session import Collector, Put
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt
from arena.protocol.identity import Identity
from arena.protocol.messages import Commitment, Ended, Message, Orders, Signed, Ticket
from arena.protocol.sealing import Opener, Sealer
from arena.protocol.signed import read_statement, sign_receipt
from clients.seat import Seat, Thinking

ANSWER_S = 8.0
"""A pit that lives answers a question within this time, if only with Wait."""


class Slot:
    """One of the seats that a client may hold at once."""

    def __init__(self, number: int, identity: Identity) -> None:
        self.number = number
        self.seat: Seat | None = None
        self.put: Put | None = None
        self.ears: Collector | None = None
        self.leave = ExitStack()
        self.over = ""
        """The match that ended here last: a ticket for it that comes late is of no use."""
        self.is_done = False
        self.asked_at_s: float | None = None
        self.n_unanswered = 0
        self.ask_limit_s = ANSWER_S
        self.heard_at_s = 0.0
        self._identity = identity
        self._sealer: Sealer | None = None
        self._opener: Opener | None = None
        self._pit_key = b""
        self._sent: tuple[int, bytes] = (-1, b"")
        """The last orders as they were sealed."""
        self._unanswered: Message | None = None
        """What the policy still thinks about."""

    def free(self) -> None:
        """Let go of the seat."""
        self.fall_silent()
        if self.seat is not None and self.seat.ended is not None:
            self.over = self.seat.ticket.match
        self.seat = None

    def fall_silent(self) -> None:
        """Leave the seat's keys on the network; the seat itself may be taken up on another connection."""
        self.leave.close()
        self.put, self.ears, self._unanswered = None, None, None

    def take(self, ticket: Ticket, attempt: Attempt, make: Callable[[Ticket, Commitment], Seat]) -> bool:
        """Take a seat, or the same one again under new keys; return whether it is another.

        Raises
        ------
        RefusedError
            The pit does not commit itself to the match, or not to the one that it did before.
        """
        commitment = _read_commitment(ticket, attempt.pit_key)
        seat = self.seat
        is_new = seat is None or seat.ticket.match != ticket.match
        if is_new:
            self.free()
            seat = self.seat = make(ticket, commitment)
        elif seat is not None and seat.commitment != commitment.digest:
            raise RefusedError(f"the pit commits itself to match {ticket.match} anew: it is not the match that it was")
        assert seat is not None
        self._sealer, self._opener = attempt.sit(ticket.match, seat.team, ticket.secret)
        self._sent = (-1, b"")
        self._pit_key = attempt.pit_key
        return is_new

    def receive(self, payload: bytes) -> None:
        """Take what the referee sent, and answer it.

        Raises
        ------
        ProtocolError
            It was not the referee, or it sent what cannot be read; nothing has changed.
        """
        if self.seat is None or self._opener is None:
            return
        message = decode(self._opener.open(payload))
        if isinstance(message, Signed):
            self.accept(message)
            return
        if isinstance(message, Ended):
            raise ForgedError("the ending is not signed")
        self._deliver(self.seat, message)

    def ask_again(self) -> None:
        """Ask a policy that needed longer whether it has its answer now."""
        if self.seat is not None and self._unanswered is not None:
            self._deliver(self.seat, self._unanswered)

    def _deliver(self, seat: Seat, message: Message) -> None:
        self._unanswered = None
        try:
            answer = seat.receive(message)
        except Thinking:
            self._unanswered = message
            return
        if answer is not None:
            self.send(answer)

    def accept(self, signed: Signed) -> None:
        """Take how the match ended, and give a receipt; `ProtocolError` if the pit did not sign it, or it is of another match."""
        fact = read_statement(signed, self._pit_key)
        if self.seat is None or not isinstance(fact, Ended) or fact.match != self.seat.ticket.match:
            raise ForgedError("the ending is of another match")
        self.seat.receive(fact)
        self.send(self._sign_receipt(self.seat))

    def _sign_receipt(self, seat: Seat) -> Message:
        return sign_receipt(self._identity, seat.ticket.match, seat.team, seat.known_ticks, seat.head)

    def send(self, message: Message) -> None:
        """Seal and send; orders that were sent before go out as the very bytes that they were."""
        if self.seat is None or self.put is None or self._sealer is None:
            return
        if type(message) is not Orders:
            self.put(self._sealer.close(encode(message), self.seat.known_ticks))
            return
        if self._sent[0] != message.tick:
            self._sent = message.tick, self._sealer.close(encode(message), message.tick)
        self.put(self._sent[1])


def _read_commitment(ticket: Ticket, pit_key: bytes) -> Commitment:
    with suppress(ProtocolError):
        signed = decode(ticket.commitment)
        fact = read_statement(signed, pit_key) if isinstance(signed, Signed) else None
        if isinstance(fact, Commitment) and fact.match == ticket.match:
            return fact
    raise RefusedError(f"the ticket lacks the pit's commitment to match {ticket.match}")
