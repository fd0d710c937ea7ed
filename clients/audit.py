"""What a client checks once a match is over: that the pit kept to its commitment, and that the journal is of the match it played.

Without the rules: whoever wants every tick played again asks `arena replay verify --transcript`.
"""

from collections.abc import Callable
from functools import partial

from arena.errors import JournalError, ProtocolError
from arena.network.session import Session
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.messages import JournalPiece, JournalRequest, Refusal, Wait
from arena.protocol.signed import check_journal, commit
from arena.records.journal import match_id, read_journal
from clients.seat import Seat

_ANSWER_S = 4.0
_MOST_BYTES = 1 << 24
Verdict = tuple[bool | None, str]
"""Whether the journal holds, None if it could not be had; and a sentence."""
Defer = Callable[[Callable[[bytes], None]], Callable[[bytes], None]]


def fetch(session: Session, pit: str, seat: Seat, pit_key: bytes, defer: Defer, on_end: Callable[[Verdict], None]) -> None:
    """Ask for the journal of a seat's match, and pass on what was found; `defer` moves an answer to the caller's thread."""
    fetch_journal(
        session,
        pit,
        seat.ticket.match,
        defer,
        on_whole=lambda data: on_end(audit(seat, data, pit_key)),
        on_none=lambda sentence: on_end((None, sentence)),
    )


def fetch_journal(
    session: Session,
    pit: str,
    match: str,
    defer: Defer,
    *,
    on_whole: Callable[[bytes], None],
    on_none: Callable[[str], None],
) -> None:
    """Ask for a match's journal, piece by piece, and pass on its bytes, or a sentence on why it cannot be had."""

    def ask(known: bytes) -> None:
        key = topics.journal(pit, match)
        session.ask(key, encode(JournalRequest(offset=len(known))), defer(partial(hear, known)), _ANSWER_S)

    def hear(known: bytes, payload: bytes) -> None:
        try:
            message = decode(payload) if payload else None
        except ProtocolError as error:
            on_none(f"the journal cannot be had: {error}")
            return
        if isinstance(message, Refusal | Wait):
            on_none(f"the journal is not to be seen {message.reason}")
        elif not isinstance(message, JournalPiece) or message.n_bytes > _MOST_BYTES or not message.data:
            on_none("the journal cannot be had: the pit is gone")
        elif len(known) + len(message.data) < message.n_bytes:
            ask(known + message.data)
        else:
            on_whole(known + message.data)

    ask(b"")


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
    match = match_id(journal.header.identity)
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
