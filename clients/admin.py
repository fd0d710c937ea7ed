"""The operator's word to a running pit, under the pit's own key."""

import queue
from collections.abc import Callable

from arena.address import Address
from arena.errors import KeyFileError, LostPitError, RefusedError, UnreadableError
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt, check_challenge
from arena.protocol.identity import Identity, to_text
from arena.protocol.messages import AdminRequest, Challenge, Done, Hello, Refusal
from arena.transport import open_client

_ANSWER_S = 4.0


def command(address: Address, identity: Identity, name: str, target: str) -> str:
    """Have the pit do something, and return what it did.

    Raises
    ------
    KeyFileError
        The key is not the pit's.
    RefusedError
        The pit says no.
    LostPitError
        No pit answers.
    """
    with open_client(address.endpoint) as session:

        def ask(payload: bytes) -> bytes:
            answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
            session.ask(topics.join(address.pit), payload, answers.put, _ANSWER_S)
            answer = _wait(lambda: answers.get(timeout=_ANSWER_S))
            if not answer:
                raise LostPitError(f"no pit called {address.pit} answers at {address.endpoint}")
            return answer

        challenge = decode(ask(encode(Hello())))
        if not isinstance(challenge, Challenge):
            raise UnreadableError("the pit answers with something else than its keys")
        check_challenge(address.pit, challenge)
        if challenge.pit_key != identity.public:
            raise KeyFileError(
                f"the pit's key is {to_text(challenge.pit_key)}, and this is {identity.fingerprint}; name the --data of that pit"
            )
        attempt = Attempt(identity, address.pit, challenge, AdminRequest(command=name, target=target))
        answer = attempt.open(ask(attempt.knock))
    if isinstance(answer, Done):
        return answer.text
    raise RefusedError(f"the pit says no: {answer.reason if isinstance(answer, Refusal) else 'it answers something else'}")


def _wait(get: Callable[[], bytes]) -> bytes:
    try:
        return get()
    except queue.Empty:
        return b""
