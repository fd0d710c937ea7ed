"""Who sends a request: whether it is signed by whom it names, recent, and sent for the first time. Without I/O."""

from dataclasses import dataclass

from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey

from arena.errors import ForgedError
from arena.pit.effects import Drop, Effect, Reply
from arena.pit.events import QuestionId
from arena.protocol.codec import encode
from arena.protocol.handshake import Caller, new_secret, open_request, sign_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import Message

EPOCH_S = 15.0
"""How long a challenge is given out; it is taken for as long again."""
MOST_USED = 100_000
"""Requests that are remembered of an epoch; beyond, none is taken until the next."""


@dataclass(frozen=True, slots=True)
class PendingRequest:
    """A request that was opened, and waits for its answer."""

    caller: Caller
    question: QuestionId
    session: str = ""
    """The connection that it says to come from."""
    asked_at_s: float = 0.0
    """When it came, by the clock of the pit's core."""

    def reply(self, message: Message) -> Effect:
        """Answer; a request whose key nothing can be sealed to gets no answer."""
        try:
            return Reply(self.question, self.caller.answer(message))
        except ForgedError:
            return Drop(self.question)


class Authenticator:
    """Opens requests. What they are sealed to lives as long as this process."""

    def __init__(self, pit: str, identity: Identity) -> None:
        self.pit, self.identity = pit, identity
        self._private = X25519PrivateKey.generate()
        self._sealing_key = self._private.public_key().public_bytes_raw()
        self._used: dict[bytes, set[bytes]] = {}
        """By challenge: the keys that answers went to, this epoch's last."""
        self._ends_s = -EPOCH_S

    def challenge(self, now_s: float) -> bytes:
        """Return the answer to every ChallengeRequest of this epoch: it costs nothing to give."""
        if now_s >= self._ends_s:
            self._turn_over(now_s)
        return self._challenge

    def _turn_over(self, now_s: float) -> None:
        number = new_secret()
        kept = list(self._used.items())[-1:] if now_s < self._ends_s + EPOCH_S else []
        self._used = {**dict(kept), number: set()}
        self._ends_s = now_s + EPOCH_S
        self._challenge = encode(sign_challenge(self.pit, self.identity, self._sealing_key, number))

    def open(self, payload: bytes, now_s: float) -> Caller:
        """Return who sends a request, once for each request.

        Raises
        ------
        ProtocolError
            The request does not open, see `open_request`; or it was made too long ago, or was seen before.
        """
        self.challenge(now_s)
        caller = open_request(payload, self.pit, self.identity.public, self._private)
        used = self._used.get(caller.request.challenge)
        if used is None:
            raise ForgedError("a request answers no challenge of the last seconds")
        if caller.request.ephemeral in used:
            raise ForgedError("a request comes a second time")
        if len(used) >= MOST_USED:
            raise ForgedError("too many requests in these seconds")
        used.add(caller.request.ephemeral)
        return caller
