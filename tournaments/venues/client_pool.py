"""Which entries of a pit have a process: those that play, then those of the first matches on the plan, and no more than may live.

A client never leaves by being ended while a match of its may begin: the referee is told to dismiss it, and it goes as soon as it
is told so.
"""

import logging
import time
from collections import Counter
from collections.abc import Callable, Collection, Container, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum, auto

from arena.network.address import Address
from arena.records.plan import MatchPlan
from tournaments.venues.fork_server import ForkServer
from tournaments.venues.processes import ClientProcess
from tournaments.venues.referee_process import Call, Dismissal
from tournaments.venues.setting import Fighter, VenueSetting

IDLE_S = 20.0
"""A client that has had nothing to play for so long is dismissed; at once, if others wait for its place."""
_LEAVE_S = 15.0
"""One that was dismissed and is still there is ended by then: it asks for its seats more often."""
logger = logging.getLogger(__name__)


class _State(Enum):
    AWAY = auto()
    CALLED = auto()
    """It starts as soon as the referee knows that it comes."""
    PRESENT = auto()
    LEAVING = auto()


@dataclass(slots=True)
class _Client:
    process: ClientProcess
    state: _State = _State.AWAY
    since_s: float = 0.0
    """When it was last of use, or when it was dismissed."""


class ClientPool:
    """The clients of a pit.

    Parameters
    ----------
    tell
        Tells the referee something; `on_call` is to be called once it has done what a `Call` wants.
    fork_server
        Starts the clients of our own fighters; None where nothing can be forked.
    """

    def __init__(
        self,
        setting: VenueSetting,
        address: Address,
        tell: Callable[[Call | Dismissal], None],
        fork_server: ForkServer | None = None,
    ) -> None:
        if setting.most_clients < 2:
            raise ValueError(f"a match takes two clients, not {setting.most_clients}")
        self._setting, self._address, self._tell, self._fork_server = setting, address, tell, fork_server
        self._clients: dict[str, _Client] = {}

    def __enter__(self) -> "ClientPool":
        return self

    def __exit__(self, *_: object) -> None:
        for client in self._clients.values():
            client.process.terminate()
        for client in self._clients.values():
            client.process.end()

    def add(self, name: str, fighter: Fighter) -> None:
        """Take an entry in; it has no process yet."""
        self._clients[name] = _Client(ClientProcess(self._setting, self._address, name, fighter, self._fork_server))

    @property
    def leaving(self) -> list[str]:
        """Those who were dismissed and have not gone yet."""
        return [name for name, client in self._clients.items() if client.state is _State.LEAVING]

    @property
    def failing(self) -> frozenset[str]:
        """Those that die again and again, or were given up."""
        return frozenset(name for name, client in self._clients.items() if client.process.is_failing)

    def take_limits_met(self, name: str) -> Counter[str]:
        """Return how often the fighter of an entry met each of its limits since the last call."""
        client = self._clients.get(name)
        return Counter() if client is None else client.process.take_limits_met()

    def on_call(self, name: str) -> None:
        """Start a client that the referee is ready for."""
        client = self._clients[name]
        if client.state is _State.CALLED:
            client.state, client.since_s = _State.PRESENT, time.monotonic()
            client.process.start()

    def on_new_referee(self) -> None:
        """Take note that a referee was started who knows of all that was called."""
        for name in self._clients:
            self.on_call(name)

    def tend(
        self,
        running: Collection[MatchPlan],
        left: Iterable[MatchPlan],
        n_left: Counter[str],
        n_ended: Counter[str],
        waiting: Container[str],
    ) -> Iterator[tuple[str, str]]:
        """Start and dismiss clients as the matches want it; yield who could not be kept alive, and why.

        Parameters
        ----------
        running, left
            The matches that have begun, and all that have not ended, in the order in which they are to be played.
        n_left, n_ended
            How many, by entry.
        waiting
            Those who join by themselves and are there.
        """
        now_s = time.monotonic()
        busy = {name for plan in running for name in (plan.blue, plan.red)}
        most = min(self._setting.most_clients, sum(n_left[name] > 0 for name in self._clients))
        wanted = choose(running, left, self._clients, lambda name: name in waiting or name in busy, most)
        for name, client in self._clients.items():
            if name in wanted or name in busy:
                client.since_s = now_s if client.state is not _State.LEAVING else client.since_s
            why = self._look_after(name, client, n_ended[name], is_busy=name in busy, is_wanted=name in wanted, now_s=now_s)
            if why:
                client.state = _State.AWAY
                wanted.pop(name, None)
                yield name, why
        self._call(wanted)
        self._dismiss(wanted, busy, now_s)

    def _look_after(self, name: str, client: _Client, n_ended: int, *, is_busy: bool, is_wanted: bool, now_s: float) -> str:
        process = client.process
        if client.state is _State.LEAVING:
            if process.is_running and (is_busy or now_s - client.since_s < _LEAVE_S):
                return ""
            process.end(0)
            client.state = _State.AWAY
        elif client.state is _State.PRESENT:
            if is_busy or is_wanted:
                return process.keep_alive(n_ended)
            if not process.is_running:
                process.end(0)
                client.state = _State.AWAY
        return ""

    def _call(self, wanted: Iterable[str]) -> None:
        n_free = self._setting.most_clients - sum(client.state is not _State.AWAY for client in self._clients.values())
        for name in wanted:
            if n_free > 0 and self._clients[name].state is _State.AWAY:
                n_free -= 1
                self._clients[name].state = _State.CALLED
                self._tell(Call(name))

    def _dismiss(self, wanted: Collection[str], busy: Container[str], now_s: float) -> None:
        n_to_go = sum(self._clients[name].state is _State.AWAY for name in wanted) - len(self.leaving)
        idle = [
            (client.since_s, name)
            for name, client in self._clients.items()
            if client.state is _State.PRESENT and name not in wanted and name not in busy
        ]
        for since_s, name in sorted(idle):
            if n_to_go > 0 or now_s - since_s > IDLE_S:
                n_to_go -= 1
                self._clients[name].state, self._clients[name].since_s = _State.LEAVING, now_s
                self._tell(Dismissal(name))


def choose(
    running: Iterable[MatchPlan],
    left: Iterable[MatchPlan],
    ours: Collection[str],
    is_there: Callable[[str], bool],
    most: int,
) -> dict[str, None]:
    """Return the entries that are to have a process, those that play first, then in the order of the plan.

    Parameters
    ----------
    ours
        The entries that have one if they are chosen; the others join by themselves.
    is_there
        Whether one of those others has joined: who waits for one that has not is not chosen by that.
    """
    chosen = {name: None for plan in running for name in (plan.blue, plan.red) if name in ours}
    for plan in left:
        if len(chosen) >= most:
            break
        names = (plan.blue, plan.red)
        if all(name in ours or is_there(name) for name in names):
            more = dict.fromkeys(name for name in names if name in ours and name not in chosen)
            if len(chosen) + len(more) > most:
                break
            chosen |= more
    return chosen
