"""What the pit answers everyone who asks for its lobby: signed, and made anew twice a second at most."""

from collections.abc import Callable

from arena.protocol.codec import encode
from arena.protocol.identity import Identity
from arena.protocol.messages import Lobby
from arena.protocol.signed import sign_statement

_FRESH_S = 0.5


class LobbyPublisher:
    """The lobby as it was signed last."""

    def __init__(self, identity: Identity, describe: Callable[[], Lobby]) -> None:
        self._identity, self._describe = identity, describe
        self._signed, self._ends_s = b"", 0.0
        self._n_begun = 0

    def read(self, n_begun: int, now_s: float) -> bytes:
        """Return the lobby as bytes, under the pit's signature; it never lacks the match that began last."""
        if now_s >= self._ends_s or n_begun != self._n_begun:
            self._signed = encode(sign_statement(self._identity, self._describe()))
            self._ends_s, self._n_begun = now_s + _FRESH_S, n_begun
        return self._signed
