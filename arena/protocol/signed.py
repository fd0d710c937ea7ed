"""What is said so that nobody can take it back: commitments, endings and the lobby by the pit, receipts by the entries."""

from hashlib import sha256

from arena.errors import ForgedError
from arena.game.keys import MatchKeys
from arena.game.types import Team
from arena.protocol.codec import decode, encode
from arena.protocol.identity import Identity, verify
from arena.protocol.messages import Commitment, Ended, Lobby, PastTruth, Receipt, Signed

STATEMENT_VERSION = 3
"""Rises when a statement changes, and not with the protocol: a journal holds the signature of one, which is to hold for good."""
_FACT, _RECEIPT, _JOURNAL = "fact", "receipt", "journal"
HEAD_BYTES = 32
"""Of a transcript."""
Statement = Commitment | Ended | Lobby | PastTruth


def commit(match: str, keys: MatchKeys) -> bytes:
    """Return what ties a pit to the keys of a match, and tells nothing of them."""
    return sha256(b"arena commitment\0" + match.encode() + b"\0" + keys.map_key + keys.match_key).digest()


def sign_statement(identity: Identity, fact: Statement) -> Signed:
    """Return a fact under the pit's signature."""
    data = encode(fact, STATEMENT_VERSION)
    return Signed(data=data, signature=identity.sign(_FACT, data))


def read_statement(signed: Signed, pit_key: bytes) -> Statement:
    """Return what the pit signed; `ProtocolError` if it did not."""
    verify(pit_key, _FACT, signed.data, signed.signature)
    fact = decode(signed.data, STATEMENT_VERSION)
    if not isinstance(fact, Statement):
        raise ForgedError("what was signed is no fact")
    return fact


def sign_receipt(identity: Identity, match: str, team: Team, n_shown: int, head: bytes) -> Receipt:
    """Return an entry's word on what its seat was shown."""
    return Receipt(n_shown=n_shown, head=head, signature=identity.sign(_RECEIPT, _receipted(match, team, n_shown, head)))


def check_receipt(entry: bytes, match: str, team: Team, receipt: Receipt) -> None:
    """Check who gave a receipt, and that it fits a journal; whether its head is true, the journal tells."""
    if len(receipt.head) != HEAD_BYTES or not 0 <= receipt.n_shown < 1 << 32:
        raise ForgedError("a receipt is of no transcript")
    verify(entry, _RECEIPT, _receipted(match, team, receipt.n_shown, receipt.head), receipt.signature)


def sign_journal(identity: Identity, last_link: bytes) -> bytes:
    """Return the pit's signature of a whole journal, by the last link of its chain."""
    return identity.sign(_JOURNAL, last_link)


def check_journal(pit_key: bytes, last_link: bytes, signature: bytes) -> None:
    """Check what `sign_journal` gave."""
    verify(pit_key, _JOURNAL, last_link, signature)


def _receipted(match: str, team: Team, n_shown: int, head: bytes) -> bytes:
    return b"\0".join((match.encode(), team.name.encode(), str(n_shown).encode(), head))
