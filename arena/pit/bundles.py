"""The clients whose seats' messages go in bundles, and what waits to be sent to each.

What the seats of a client are to be sent is gathered while one action after another is handed in, and sent at once when the shell
says that those were all, for now. The clocks of turns begin then, and not when the turns were made.
"""

from collections.abc import Callable, Collection

from arena.game.types import Team
from arena.match.match import Match
from arena.pit.effects import SendBundle
from arena.pit.lanes import Lanes
from arena.pit.seats import Client
from arena.protocol.bundles import BundleWriter
from arena.protocol.messages import JoinRequest

_LOOK_S = 5.0
"""Between two looks at which lanes are used; one that was not at either is given back."""


class BundleLane:
    """What waits for one client process, on a lane of its own."""

    def __init__(self, number: int, filled: list["BundleLane"]) -> None:
        self.number = number
        self._filled = filled
        self._writer = BundleWriter()
        self._begun: list[tuple[Match, Team]] = []
        self._is_filled = False

    def add(self, seat: int, message: bytes) -> None:
        """Have a sealed message of a seat sent with the others."""
        if not self._is_filled:
            self._is_filled = True
            self._filled.append(self)
        self._writer.add(seat, message)

    def begin_clock(self, match: Match, team: Team) -> None:
        """Let the clock of a turn that is added begin when it is sent."""
        self._begun.append((match, team))

    def take(self, now_s: float) -> list[SendBundle]:
        """Return what is to be sent now."""
        for match, team in self._begun:
            match.note_sent(team, now_s)
        self._begun.clear()
        self._is_filled = False
        return [SendBundle(self.number, data) for data in self._writer.take()]


class Bundles:
    """The lanes of bundles, one for each client process that asked for it and holds a seat."""

    def __init__(self, lanes: Lanes) -> None:
        self._lanes = lanes
        self._by_client: dict[Client, BundleLane] = {}
        self._by_number: dict[int, BundleLane] = {}
        self._filled: list[BundleLane] = []
        self._unused: set[Client] = set()
        """Clients whose lanes were not used at the last look."""
        self._now_s = self._looked_at_s = 0.0

    @property
    def wait(self) -> bool:
        """Whether anything waits to be sent."""
        return bool(self._filled)

    def at(self, number: int) -> BundleLane | None:
        """Return the lane of a number."""
        return self._by_number.get(number)

    def find(self, request: JoinRequest) -> BundleLane | None:
        """Return the lane of the client that sent a request; None if it does not want bundles."""
        if not request.bundles:
            return None
        client = request.entry, request.client
        self._unused.discard(client)
        lane = self._by_client.get(client)
        if lane is None:
            lane = BundleLane(self._lanes.take(self._now_s), self._filled)
            self._by_client[client] = self._by_number[lane.number] = lane
        return lane

    def take(self, now_s: float) -> list[SendBundle]:
        """Return all that is to be sent now."""
        effects = [effect for lane in self._filled for effect in lane.take(now_s)]
        self._filled.clear()
        return effects

    def advance(self, now_s: float, find_used: Callable[[], Collection[BundleLane | None]]) -> None:
        """Let time pass: give back the lanes of clients that hold no seat any more."""
        self._now_s = now_s
        if now_s - self._looked_at_s < _LOOK_S:
            return
        self._looked_at_s, used = now_s, find_used()
        unused = {client for client, lane in self._by_client.items() if lane not in used}
        for client in unused & self._unused:
            lane = self._by_client.pop(client)
            del self._by_number[lane.number]
            self._lanes.give_back(lane.number, now_s)
        self._unused = unused & self._by_client.keys()
