"""What the pit tells everyone who asks: the lobby, signed, and made anew twice a second at most."""

from arena.game.ruleset import Ruleset
from arena.pit.admission import Admission
from arena.pit.match_session import MatchSession, PitContext
from arena.pit.seating import Seating
from arena.protocol.codec import encode
from arena.protocol.messages import Lobby
from arena.protocol.signed import sign_statement
from arena.records.framing import rules_values

_FRESH_S = 0.5
_MOST_LISTED = 150
"""Matches, and guests, that the lobby names."""
MOST_STANDINGS = 50
"""Of a ladder, its first; with all else that is listed, the lobby fits one message."""


class LobbyPublisher:
    """The lobby as it was signed last."""

    def __init__(
        self, house: PitContext, ruleset: Ruleset, reception: Admission, seating: Seating, tables: dict[str, MatchSession]
    ) -> None:
        self._house, self._ruleset = house, ruleset
        self._reception, self._seating, self._tables = reception, seating, tables
        self._n_begun = 0
        self._signed, self._ends_s = b"", 0.0

    def count_match(self) -> None:
        """Note that a match has begun: the lobby as it was signed lacks it."""
        self._n_begun += 1
        self._ends_s = 0.0

    def read(self, now_s: float) -> bytes:
        """Return the lobby as bytes, under the pit's signature."""
        if now_s >= self._ends_s:
            self._signed, self._ends_s = encode(sign_statement(self._house.identity, self._describe())), now_s + _FRESH_S
        return self._signed

    def _describe(self) -> Lobby:
        matches = [(table.id, table.match) for table in self._tables.values()]
        return Lobby(
            pit=self._house.pit,
            rules=self._ruleset.name,
            rules_hash=self._ruleset.hash,
            ruleset=rules_values(self._ruleset),
            needs_invite=self._reception.register.needs_invite,
            n_begun=self._n_begun,
            running=[
                {"match": id, "blue": match.header.blue, "red": match.header.red, "tick": match.tick}
                for id, match in matches[:_MOST_LISTED]
            ],
            waiting=[guest.request.name for guest in self._reception.guests.values()][:_MOST_LISTED],
            standings=self._seating.standings()[:MOST_STANDINGS],
        )
