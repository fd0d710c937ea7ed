"""What a client checks once a match is over: that the pit kept to its commitment, and that the journal is of the match it played.

Without the rules: whoever wants every tick played again asks `arena replay verify --transcript`.
"""

from arena.errors import JournalError, LostPitError, ProtocolError, RefusedError, UnreadableError
from arena.protocol.codec import decode, encode
from arena.protocol.messages import JournalPiece, JournalRequest, Refusal, Wait
from arena.protocol.signed import check_journal, commit
from arena.records.journal import read_journal
from clients.seat import Seat

_MOST_BYTES = 1 << 24
Verdict = tuple[bool | None, str]
"""Whether the journal holds, None if it could not be had; and a sentence."""


class JournalDownload:
    """A match's journal, which a pit gives out piece by piece. Without I/O."""

    def __init__(self) -> None:
        self._known = b""

    def request(self) -> bytes:
        """Return what asks for the next piece."""
        return encode(JournalRequest(offset=len(self._known)))

    def receive(self, payload: bytes) -> bytes | None:
        """Take the answer to a request, and return the whole journal, or None if there is more to ask for.

        Raises
        ------
        RefusedError
            The pit does not show the journal, or not yet.
        LostPitError
            Nobody answered, or it was no piece of a journal.
        UnreadableError
            The answer is no message.
        """
        try:
            message = decode(payload) if payload else None
        except ProtocolError as error:
            raise UnreadableError(f"the journal cannot be had: {error}") from error
        if isinstance(message, Refusal):
            raise RefusedError(f"the journal cannot be had: {message.reason}")
        if isinstance(message, Wait):
            raise RefusedError(f"the journal is not to be seen {message.reason}")
        if not isinstance(message, JournalPiece) or message.n_bytes > _MOST_BYTES or not message.data:
            raise LostPitError("the journal cannot be had: the pit is gone")
        self._known += message.data
        return self._known if len(self._known) >= message.n_bytes else None


def audit(seat: Seat, data: bytes, pit_key: bytes) -> Verdict:
    """Return whether a journal is of the match that a seat played, under the keys that the pit committed itself to."""
    try:
        journal = read_journal(data)
        seals = journal.seals
        if seals is None or seals.pit_key != pit_key:
            return False, "the journal is not signed by this pit"
        check_journal(pit_key, journal.ending_chain or b"", seals.signature)
    except (JournalError, ProtocolError) as error:
        return False, str(error)
    match = journal.name
    if match != seat.ticket.match:
        return False, f"the journal is of match {match}"
    if commit(match, journal.header.keys) != seat.commitment:
        return False, "the journal's keys are not those that the pit committed itself to"
    receipt = seals.receipts.get(seat.team)
    if receipt is not None and receipt.head != seat.head:
        return False, "the journal has another receipt than this seat gave"
    for tick, answer in enumerate(seat.answers):
        if not journal.keeps(tick, seat.team, answer):
            return False, f"at tick {tick} the journal has other orders than this seat gave"
    if len(seat.answers) > len(journal.ticks) + 1:
        return False, "the journal lacks ticks that this seat played"
    if seat.ended and journal.ending != seat.result().seen_by(seat.team):
        return False, "the journal ends otherwise than the pit told this seat"
    return True, "the journal is of this match, under the keys that the pit committed itself to"
