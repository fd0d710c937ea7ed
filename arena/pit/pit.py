"""An open pit: a router, a referee, and whoever connects."""

import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

from filelock import FileLock, Timeout

from arena.errors import InputError
from arena.folders import data_folder
from arena.game.engine import warm
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.match.time_control import TimeControl
from arena.network.access import WORKERS_PROTOCOL, Certificate
from arena.network.address import Address
from arena.network.session import open_router
from arena.pit.effects import MatchEnded
from arena.pit.ladder import Ladder, LadderMatch, LadderSeating, find_uncounted, is_of_ladder
from arena.pit.match_session import PitContext
from arena.pit.monitor import PitMonitor
from arena.pit.referee import Referee
from arena.pit.register import Register
from arena.pit.seating import OpenSeating, Seating
from arena.pit.workers.machines import Machine
from arena.protocol.identity import Identity
from arena.records.journal import identity_of
from arena.records.plan import MatchPlan, PitMatchId

_DRAIN_S = 8.0
"""How long running matches may go on after `stop`; what is left then can be resumed."""

_FAREWELL_S = 6.0
"""How long the pit stays after its last match for clients that are there still: who missed the ending asks for it when it has
heard nothing for a while (`clients.core.SILENCE_S`), and again if nobody answers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PitSettings:
    """The settings of `arena serve`."""

    address: Address
    """Where to listen, and the pit's name and key."""
    identity: Identity
    spectator_key: bytes
    public_delay: int = 0
    """See `PitContext`."""
    register: Register
    ruleset: Ruleset
    secret: bytes
    time_control: TimeControl
    journals: Path
    n_matches: int | None = None
    fsync: bool = False
    certificate: Certificate | None = None
    most_matches: int | None = None
    """At once; see `arena.pit.admission`."""
    workers: tuple[Machine, ...] = ()
    """Where each process runs that referees matches; this one alone does without any."""
    ladder: Ladder | None = None
    """None seats whoever comes, and rates nobody."""
    monitor: PitMonitor | None = None
    """What is told to whoever watches over the pit."""


class Pit:
    """An open pit; `stop` ends it from a signal."""

    def __init__(self, settings: PitSettings) -> None:
        self._settings = settings
        self._stopped_at_s: float | None = None
        self._done_at_s: float | None = None
        self._referee: Referee | None = None
        self._seating: Seating
        if settings.ladder is None:
            self._seating = OpenSeating(self._make_plan, settings.n_matches)
        else:
            self._seating = LadderSeating(settings.ladder, self._make_plan, settings.n_matches, settings.register.owner_of)

    def stop(self) -> None:
        """Begin no more matches; a second call does not wait for those that run."""
        if self._stopped_at_s is None:
            self._stopped_at_s = time.monotonic()
            self._seating.close()
        elif self._referee is not None:
            self._referee.stop()

    def run(self, on_open: Callable[[int], None], on_end: Callable[[MatchEnded], None]) -> int:
        """Serve until stopped, or until the last match is over; return how many matches were left to be resumed."""
        settings = self._settings
        warm(settings.ruleset)  # before anybody can ask: a client that gets no answer goes away
        with (
            _alone_in(settings.journals),
            _workers_endpoint(bool(settings.workers)) as workers_endpoint,
            open_router(
                settings.address.endpoint, settings.address.pit, settings.certificate, workers_endpoint=workers_endpoint
            ) as session,
        ):
            counted = self._catch_up()
            self._numbers = count(
                _next_number(settings.journals, settings.address.pit, counted, is_rated=settings.ladder is not None)
            )
            context = PitContext(
                pit=settings.address.pit,
                identity=settings.identity,
                spectator_key=settings.spectator_key,
                public_delay=settings.public_delay,
            )
            referee = Referee(
                session,
                context,
                settings.ruleset,
                self._seating,
                settings.time_control,
                settings.journals,
                register=settings.register,
                fsync=settings.fsync,
                most_matches=settings.most_matches,
                workers=settings.workers,
                workers_endpoint=workers_endpoint,
                on_end=lambda ended: self._report(ended, on_end),
            )
            self._referee = referee
            on_open(len(referee.resume()))
            try:
                referee.run(lambda: self._is_over(referee))
                return referee.n_running
            finally:
                referee.close()

    def _is_over(self, referee: Referee) -> bool:
        if self._settings.monitor is not None:
            self._settings.monitor.answer(referee, self._settings.ladder)
        now_s = time.monotonic()
        if not self._seating.is_done or referee.n_running:
            return self._stopped_at_s is not None and now_s - self._stopped_at_s > _DRAIN_S
        self._done_at_s = self._done_at_s or now_s
        return referee.is_deserted or now_s - self._done_at_s > _FAREWELL_S

    def _catch_up(self) -> Collection[str]:
        """Count what ended on the ladder and was not counted before the pit was killed; return all that has been counted."""
        ladder, settings = self._settings.ladder, self._settings
        if ladder is None:
            return ()
        counted = ladder.identities()
        for match in find_uncounted(settings.journals, settings.address.pit, counted):
            ladder.count(match)
        return counted

    def _report(self, ended: MatchEnded, on_end: Callable[[MatchEnded], None]) -> None:
        """Count a match of the ladder; one that an earlier pit began without it is none."""
        header = ended.header
        if self._settings.ladder is not None and is_of_ladder(header.identity, self._settings.address.pit):
            names = {Team.BLUE: header.blue, Team.RED: header.red}
            match = LadderMatch(
                identity=header.identity,
                names=names,
                entries=ended.entries,
                rules_hash=header.ruleset.hash,
                result=ended.result,
            )
            self._settings.ladder.count(match)
        if self._settings.monitor is not None:
            self._settings.monitor.count(ended)
        on_end(ended)

    def _make_plan(self, blue: str, red: str) -> MatchPlan:
        """Plan a match of its own: no map is played twice here, since whoever comes may remember."""
        settings = self._settings
        match = PitMatchId(
            pit=settings.address.pit, is_rated=settings.ladder is not None, number=next(self._numbers), blue=blue, red=red
        )
        identity, secret = str(match), settings.secret
        keys = MatchKeys(map_key=derive_map_key(secret, identity, 0), match_key=derive_match_key(secret, identity))
        return MatchPlan(identity=identity, blue=blue, red=red, keys=keys)


def _next_number(journals: Path, pit: str, counted: Collection[str], *, is_rated: bool) -> int:
    """Return the first number beyond those of a pit's matches that have a journal, or were counted: none is played twice."""
    first = 0
    for identity in (*(identity_of(path.name) for path in journals.glob("*.journal")), *counted):
        with suppress(ValueError):  # another's match
            match = PitMatchId.parse(identity)
            if (match.pit, match.is_rated) == (pit, is_rated):
                first = max(first, match.number + 1)
    return first


@contextmanager
def _workers_endpoint(has_workers: bool) -> Iterator[str]:
    """Yield where workers connect to the router, in a folder that nobody else can enter; nothing where there are none."""
    if has_workers:
        with TemporaryDirectory(prefix="arena-", ignore_cleanup_errors=True) as folder:
            yield f"{WORKERS_PROTOCOL}/{folder}/workers"
    else:
        yield ""


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Keep other pits off a folder of journals: two would resume the same matches."""
    data_folder(folder)
    try:
        lock = FileLock(folder / ".lock", blocking=False).acquire()
    except Timeout:
        raise InputError(f"another pit keeps its journals in {folder}; choose another folder with --data") from None
    except OSError as error:
        raise InputError(f"cannot keep journals in {folder}: {error.strerror}; choose another folder with --data") from error
    with lock:
        yield
