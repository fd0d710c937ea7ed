"""What a pit answers to everyone who asks: its keys, its lobby, signed, and the journals of matches that are over."""

from arena.errors import UnreadableError
from arena.network.address import Address
from arena.network.asking import ask
from arena.network.session import Session
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import read_challenge
from arena.protocol.messages import Challenge, ChallengeRequest, Lobby, Signed
from arena.protocol.signed import read_statement
from clients.audit import JournalDownload


def ask_challenge(session: Session, address: Address, key: str = "") -> Challenge:
    """Return the pit's keys; that it holds them was checked, not who it is.

    `key` is where requests go that will answer the challenge; without it, where seats are asked for.
    """
    return read_challenge(address.pit, ask(session, address, key or topics.join(address.pit), encode(ChallengeRequest())))


def ask_lobby(session: Session, address: Address, pit_key: bytes) -> Lobby:
    """Return the public facts of the pit with this key; `ProtocolError` if another signed them."""
    message = decode(ask(session, address, topics.lobby(address.pit), b""))
    statement = read_statement(message, pit_key) if isinstance(message, Signed) else None
    if not isinstance(statement, Lobby):
        raise UnreadableError("the pit answers with something else than its lobby")
    return statement


def ask_journal(session: Session, address: Address, match: str) -> bytes:
    """Return the journal of a match that is over; `ArenaError` says why it cannot be had."""
    download, journal = JournalDownload(), None
    while journal is None:
        journal = download.receive(ask(session, address, topics.journal(address.pit, match), download.request()))
    return journal
