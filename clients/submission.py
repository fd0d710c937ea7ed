"""An entry's owner at the desk of a season: uploads, and questions on how the entry stands, signed with its key."""

import time
from collections.abc import Callable, Iterator
from hashlib import sha256
from typing import Any

from arena.errors import LostPitError, RefusedError, UnreadableError
from arena.network.address import Address
from arena.network.asking import ask
from arena.network.session import Session
from arena.protocol import topics
from arena.protocol.codec import decode
from arena.protocol.handshake import Attempt
from arena.protocol.identity import Identity
from arena.protocol.messages import Challenge, Message, Refusal, SeasonAnswer, SeasonRequest, Wait
from arena.submission import PIECE_BYTES
from clients.lobby import ask_challenge

PATIENCE_S = 60.0
"""How long a season may say that one is to wait."""
_RETRY_S = 0.5
_CHALLENGE_S = 10.0
"""How long one challenge is used; a season takes it for longer."""
_TRIES = 3
"""For a request that is not taken: the season may have been opened anew, or have answered while we asked again."""


class SeasonClient:
    """A connection to a season, for one entry.

    Parameters
    ----------
    trust
        Raises if the season whose public key it is given is not the one that was meant.
    """

    def __init__(
        self, session: Session, address: Address, identity: Identity, name: str, invite: str, *, trust: Callable[[bytes], None]
    ) -> None:
        self._session, self._address, self._identity = session, address, identity
        self._name, self._invite, self._trust = name, invite, trust
        self._challenge: tuple[Challenge, float] | None = None

    def ask(self, command: str, **fields: Any) -> SeasonAnswer:
        """Have the season do something; fields are those of `SeasonRequest`.

        Raises
        ------
        RefusedError
            The season says no; or that one is to wait, and goes on saying so.
        LostPitError
            No season answers.
        """
        give_up_at_s = time.monotonic() + PATIENCE_S
        request = SeasonRequest(command=command, name=self._name, invite=self._invite, **fields)
        while True:
            answer = self._ask(request)
            if isinstance(answer, SeasonAnswer):
                return answer
            if isinstance(answer, Refusal):
                raise RefusedError(f"the season says no: {answer.reason}")
            if not isinstance(answer, Wait):
                raise UnreadableError("the season answers something else than it was asked")
            if time.monotonic() > give_up_at_s:
                raise RefusedError(f"the season lets us wait: {answer.reason}; try again later")
            time.sleep(_RETRY_S)

    def upload(self, packed: bytes, advance: Callable[[int], None] = lambda _: None) -> SeasonAnswer:
        """Submit what `arena.submission` packed; `advance` is told of bytes that have come."""
        digest, offset = sha256(packed).digest(), 0
        while True:
            piece = packed[offset : offset + PIECE_BYTES]
            answer = self.ask("upload", digest=digest, n_bytes=len(packed), offset=offset, piece=piece)
            if not 0 <= answer.offset <= len(packed):
                raise UnreadableError("the season has more of the submission than there is")
            advance(answer.offset - offset)
            offset = answer.offset
            if offset == len(packed):
                return answer

    def read_log(self) -> Iterator[bytes]:
        """Yield the end of the entry's log, in pieces."""
        offset = 0
        while (answer := self.ask("log", offset=offset)).data:
            yield answer.data
            offset = answer.offset

    def wait_for_check(self, id: int) -> dict[str, Any]:
        """Return what became of a submission, as the season tells its owner, and under `report` what its check found."""
        lost_at_s = None
        while True:
            try:
                facts, lost_at_s = self.ask("status").facts, None
            except LostPitError:
                lost_at_s = lost_at_s or time.monotonic()
                if time.monotonic() - lost_at_s > PATIENCE_S:
                    raise
                continue
            found = [one for one in facts.get("submissions", []) if one["id"] == id]
            if not found:
                raise UnreadableError("the season knows nothing of what was submitted")
            if found[0]["state"] != "waiting":
                return {**found[0], "report": facts.get("report")}
            time.sleep(_RETRY_S)

    def _ask(self, request: SeasonRequest) -> Message:
        key, refusal = topics.submissions(self._address.pit), ""
        for _ in range(_TRIES):
            attempt = Attempt(self._identity, self._address.pit, self._find_challenge(), request)
            payload = ask(self._session, self._address, key, attempt.sealed)
            bare = decode(payload)
            if not isinstance(bare, Refusal):
                return attempt.open(payload)
            self._challenge, refusal = None, bare.reason
        raise RefusedError(f"the season does not take what we ask: {refusal}")

    def _find_challenge(self) -> Challenge:
        now_s = time.monotonic()
        if self._challenge is None or now_s - self._challenge[1] > _CHALLENGE_S:
            challenge = ask_challenge(self._session, self._address, topics.submissions(self._address.pit))
            self._trust(challenge.pit_key)
            self._challenge = challenge, now_s
        return self._challenge[0]
