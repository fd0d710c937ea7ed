"""What a pit tells everyone who asks: its keys, and its lobby, signed."""

import queue
import time
from contextlib import suppress

from arena.errors import LostPitError, UnreadableError
from arena.network.address import Address
from arena.network.session import Session
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import check_challenge
from arena.protocol.messages import Challenge, ChallengeRequest, Lobby, Signed
from arena.protocol.signed import read_statement

_ANSWER_S = 5.0
_AGAIN_S = 0.25


def ask(session: Session, address: Address, key: str, payload: bytes) -> bytes:
    """Return a pit's answer; asked again for some seconds, since a pit that opens has its router before its ears."""
    answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    end_s = time.monotonic() + _ANSWER_S
    while (left_s := end_s - time.monotonic()) > 0:
        session.ask(key, payload, answers.put, left_s)
        with suppress(queue.Empty):
            answer = answers.get(timeout=left_s + _AGAIN_S)
            if answer:
                return answer
        time.sleep(_AGAIN_S)
    raise LostPitError(f"a router answers at {address.endpoint}, and no pit called {address.pit}")


def ask_challenge(session: Session, address: Address) -> Challenge:
    """Return the pit's keys; that it holds them was checked, not who it is."""
    challenge = decode(ask(session, address, topics.join(address.pit), encode(ChallengeRequest())))
    if not isinstance(challenge, Challenge):
        raise UnreadableError("the pit answers with something else than its keys")
    check_challenge(address.pit, challenge)
    return challenge


def ask_lobby(session: Session, address: Address, pit_key: bytes) -> Lobby:
    """Return the public facts of the pit with this key; `ProtocolError` if another signed them."""
    message = decode(ask(session, address, topics.lobby(address.pit), b""))
    fact = read_statement(message, pit_key) if isinstance(message, Signed) else None
    if not isinstance(fact, Lobby):
        raise UnreadableError("the pit answers with something else than its lobby")
    return fact
