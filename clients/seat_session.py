"""A seat under the keys of one ticket: opens what the referee sends, and seals what goes back. Without I/O."""

from contextlib import suppress

from arena.errors import ForgedError, ProtocolError, RefusedError
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

    def listen(self) -> list[bytes]:
        """Return what the referee is told of a seat that was taken: nothing, while its policy still starts."""
        return self._seal_all(self.seat.listen())

    def receive(self, payload: bytes) -> list[bytes]:
        """Take a sealed message, and return what is to be sent.

        Raises
        ------
        ProtocolError
            The referee did not send this, or it cannot be read; nothing has changed.
        """
        message = decode(self._opener.open(payload))
        if type(message) is Signed:
            return [self.accept_ending(message)]
        if type(message) is Ended:
            raise ForgedError("the ending is not signed")
        return self._seal_all(self.seat.receive(message))

    def think(self) -> list[bytes]:
        """Go on where the policy needed longer, and return what is to be sent."""
        return self._seal_all(self.seat.think())

    def accept_ending(self, signed: Signed) -> bytes:
        """End the match, and return the receipt; `ProtocolError` unless the pit signed the ending of this match."""
        ended, seat = read_statement(signed, self.pit_key), self.seat
        if not isinstance(ended, Ended) or ended.match != seat.ticket.match:
            raise ForgedError("the ending is of another match")
        seat.receive(ended)
        return self._seal(sign_receipt(self._identity, seat.ticket.match, seat.team, seat.known_ticks, seat.head))

    def _seal_all(self, messages: list[Message]) -> list[bytes]:
        return [self._seal(message) for message in messages]

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
