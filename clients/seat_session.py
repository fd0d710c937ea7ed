"""A seat under the keys of one ticket: opens what the referee sends, and seals what goes back. Without I/O."""

from contextlib import suppress

from arena.errors import ForgedError, ProtocolError, RefusedError
from arena.policy import Thinking
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt
from arena.protocol.identity import Identity
from arena.protocol.messages import Commitment, Ended, Message, Orders, Signed, Ticket
from arena.protocol.signed import read_statement, sign_receipt
from clients.seat import Seat


class SeatSession:
    """Lives as long as the keys; a client that returns to its seat makes another for the same `Seat`."""

    def __init__(self, seat: Seat, secret: bytes, attempt: Attempt, identity: Identity) -> None:
        self.seat, self.pit_key = seat, attempt.pit_key
        self._identity = identity
        self._sealer, self._opener = attempt.sit(seat.ticket.match, seat.team, secret)
        self._sent: tuple[int, bytes] = (-1, b"")
        """Tick of the last orders, and their sealed bytes, for a resend."""
        self._pending: Message | None = None
        """What the policy still thinks about."""

    def ready(self) -> bytes:
        """Return the message by which the referee learns that the seat listens."""
        return self._seal(self.seat.ready())

    def receive(self, payload: bytes) -> bytes | None:
        """Return the sealed answer to a sealed message, or None if it wants none, or the policy needs longer.

        Raises
        ------
        ProtocolError
            The referee did not send this, or it cannot be read; nothing has changed.
        """
        message = decode(self._opener.open(payload))
        if type(message) is Signed:
            return self.accept_ending(message)
        if type(message) is Ended:
            raise ForgedError("the ending is not signed")
        return self._deliver(message)

    def ask_policy_again(self) -> bytes | None:
        """Return the answer that the policy needed longer for, once it has it."""
        return None if self._pending is None else self._deliver(self._pending)

    def accept_ending(self, signed: Signed) -> bytes:
        """End the match, and return the receipt; `ProtocolError` unless the pit signed the ending of this match."""
        ended, seat = read_statement(signed, self.pit_key), self.seat
        if not isinstance(ended, Ended) or ended.match != seat.ticket.match:
            raise ForgedError("the ending is of another match")
        seat.receive(ended)
        return self._seal(sign_receipt(self._identity, seat.ticket.match, seat.team, seat.known_ticks, seat.head))

    def _deliver(self, message: Message) -> bytes | None:
        self._pending = None
        try:
            answer = self.seat.receive(message)
        except Thinking:
            self._pending = message
            return None
        return None if answer is None else self._seal(answer)

    def _seal(self, message: Message) -> bytes:
        """Return the sealed message; orders that were sealed before keep their bytes."""
        if type(message) is not Orders:
            return self._sealer.close(encode(message), self.seat.known_ticks)
        if self._sent[0] != message.tick:
            self._sent = message.tick, self._sealer.close(encode(message), message.tick)
        return self._sent[1]


def read_commitment(ticket: Ticket, pit_key: bytes) -> Commitment:
    """Return the pit's commitment to the match of a ticket; `RefusedError` if the ticket holds none."""
    with suppress(ProtocolError):
        signed = decode(ticket.commitment)
        statement = read_statement(signed, pit_key) if isinstance(signed, Signed) else None
        if isinstance(statement, Commitment) and statement.match == ticket.match:
            return statement
    raise RefusedError(f"the ticket lacks the pit's commitment to match {ticket.match}")
