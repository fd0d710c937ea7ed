"""A league that soaks: its scheduler, referees, clients and store; it grows whenever it has been played."""

from arena.errors import ArenaError
from benchmarks.measuring.audit import Audit, audit_league
from benchmarks.measuring.faults import FaultInjector, Kind, signals
from benchmarks.measuring.journal_watch import JournalWatch
from benchmarks.measuring.postgres import Cluster, open_cluster
from benchmarks.measuring.soak_ground import SELDOM, Ground
from benchmarks.measuring.supervised import RESTART_S

_NAME = "soak"
_BOT = """
import time
def act(observation):
    time.sleep(0.05)
    return [observation.tick // 7 % 5 for unit in observation.units]
"""
_FIGHTERS = ("patrol", "slow-a", "slow-b")
_ROUND_PAIRS = 5
"""By which it grows."""


class SoakedLeague:
    """The processes of a league over the network, and the faults that strike them."""

    def __init__(self, ground: Ground, seed: int, *, every_s: float) -> None:
        self._data, full_disks = ground.disk("league")
        self._file, self._seed, self._n_pairs = ground.folder / f"{_NAME}.toml", seed, 0
        (ground.folder / "slow.py").write_text(_BOT)
        self._db = str(self._data / "arena.db")
        self._cluster: Cluster | None = None
        databases: list[Kind] = []
        try:
            self._cluster = cluster = ground.stack.enter_context(open_cluster())
        except ArenaError as error:
            ground.not_drawn |= dict.fromkeys(("kill database", "stop database"), str(error))
        else:
            self._db = cluster.make_database()
            databases = signals("database", lambda: [("postgresql", cluster.find(), "")])
        self._add_pairs()
        self.process = league = ground.start(
            "league", "tournament", "run", str(self._file), "--venue", "network", "--data", str(self._data),
            "--db", self._db, "--json", is_forever=False,
        )  # fmt: skip
        kinds = [
            *signals("scheduler", lambda: [("scheduler", league.find(), "")], weight=SELDOM),
            *signals("referee", lambda: [("referee", league.find("spawn_main")[:1], "")], weight=SELDOM),
            *signals("client of the league", lambda: [(name, league.find(f"--name {name} ")[:1], name) for name in _FIGHTERS]),
            *databases,
            *full_disks,
        ]
        journals = self._data / "journals" / _NAME
        self.injector = FaultInjector("league", JournalWatch(journals), kinds, seed, every_s=every_s)

    def _add_pairs(self) -> None:
        self._n_pairs += _ROUND_PAIRS
        entries = "".join(f'{name} = "{name if name == "patrol" else "slow.py"}"\n' for name in _FIGHTERS)
        self._file.write_text(
            f'name = "{_NAME}"\npairs = {self._n_pairs}\nseed = {self._seed}\nslots = 2\nmaps = "fresh"\n'
            f'trusted = ["slow-a", "slow-b"]\n[entries]\n{entries}'
        )

    @property
    def store(self) -> str:
        """The kind of its store."""
        return "sqlite" if self._cluster is None else "postgresql"

    def tend(self, *, may_grow: bool) -> None:
        """Have it go on once it has been played, and its database once that is dead."""
        if self.process.has_finished and may_grow:
            self._add_pairs()
            self.process.start()
            self.injector.excuse()
        if self._cluster is not None:
            self._cluster.tend(RESTART_S)

    def roles(self) -> dict[str, list[int]]:
        """Return the processes that live long, by what they do."""
        family = self.process.family()
        return {
            "scheduler": self.process.find(),
            "referee": [pid for pid, command in family.items() if "spawn_main" in command],
            "client of the league": [pid for pid, command in family.items() if " --alive " in command],
        }

    def audit(self) -> Audit:
        """Return what came of it, once it has ended."""
        if self._cluster is not None:
            self._cluster.tend(0.0)
        n_planned = self._n_pairs * 2 * len(_FIGHTERS) * (len(_FIGHTERS) - 1) // 2
        return audit_league(self._data, self._db, _NAME, n_planned, self.injector.watch.seen)
