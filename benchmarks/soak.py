"""A soak: a pit with a ladder, and a league over the network, while processes, disk, network and database fail at random.

What a supervisor would start again, this does. At the end everything is counted: a match that is lost or stored twice, a journal
that does not verify, or memory that grows for ever breaks a promise, and the command ends with exit code 1.
"""

import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from secrets import randbelow
from typing import Any

from arena.errors import ArenaError
from arena.jit import cache_root
from arena.network.address import free_port
from benchmarks.measuring.faults import Court, Kind, Target, fill, kill, small_disk, stop
from benchmarks.measuring.postgres import Cluster, open_cluster
from benchmarks.measuring.pulse import Pulse
from benchmarks.measuring.reckoning import reckon_ladder, reckon_league
from benchmarks.measuring.supervised import RESTART_S, Supervised
from benchmarks.measuring.trends import Lives, read_cost
from policies.precompile import precompile
from policies.registry import load

PIT, LEAGUE = "soak", "soak"
ENTRIES = {"ann": "patrol", "bob": "rush", "cyd": "roomba", "dan": "random"}
"""Of the pit; each plays through a network of its own."""
_BOT = """
import time
def act(observation):
    time.sleep(0.05)
    return [observation.tick // 7 % 5 for unit in observation.units]
"""
_RELAY = Path(__file__).parent / "measuring" / "relay.py"
_FIGHTERS = ("patrol", "slow-a", "slow-b")
_DELAY_S = 0.01
"""Of each network, in each direction."""
_EVERY_S = 4.0
"""Mean time from the end of a fault to the next."""
_LASTS_S = (0.5, 8.0)
"""Of what is stopped, cut or full."""
_SELDOM = 0.1
"""Weight of what ends a process that is to live long, so that it can be seen whether its memory grows."""
_POLL_S, _LOOK_S, _SAY_S = 0.2, 2.0, 30.0
_COME_S, _END_S = 180.0, 300.0
"""How long the first matches may take to come, and the last ones to end."""
_ROUND_PAIRS = 5
"""By which the league grows, whenever it has been played."""
_JUDGED_MIN = 5.0
"""Of measurement, from which on it is judged whether something grows."""
MOST_GROWTH = {"memory_kb": 1_000.0, "handles": 0.5, "threads": 0.2}
"""A minute, of one process. A pit remembers its last 10,000 matches, at 2.5 kB each, and plays some 200 of them a minute here."""
Progress = Callable[[str], None]


def run(progress: Progress, minutes: float = 2.0, seed: int | None = None) -> dict[str, Any]:
    """A pit and a league while processes, disk, network and database fail at random; whether anything is lost, or grows."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # end all processes, too
    return measure(progress, duration_s=60 * minutes, seed=randbelow(1 << 31) if seed is None else seed)


def measure(
    progress: Progress,
    *,
    duration_s: float,
    seed: int,
    entries: dict[str, str] | None = None,
    has_league: bool = True,
    every_s: float = _EVERY_S,
    n_workers: int = 2,
) -> dict[str, Any]:
    """Let it soak for a while, and reckon up."""
    entries = entries or ENTRIES
    progress(f"seed {seed}")
    for policy in {*entries.values(), "patrol"}:
        precompile(load(policy))  # here, and not in all processes at once
    with tempfile.TemporaryDirectory(prefix="arena-soak-", ignore_cleanup_errors=True) as name, ExitStack() as stack:
        soak = _Soak(Path(name), stack, duration_s, entries, seed, every_s, n_workers, has_league=has_league)
        soak.go_on(progress)
        progress("every journal, played again")
        found = soak.reckon()
        return {"seed": seed, "minutes": round(duration_s / 60, 2), **found}


class _Soak:
    """All processes of a soak."""

    def __init__(
        self,
        folder: Path,
        stack: ExitStack,
        duration_s: float,
        entries: dict[str, str],
        seed: int,
        every_s: float,
        n_workers: int,
        *,
        has_league: bool,
    ) -> None:
        self._folder, self._stack, self._duration_s = folder, stack, duration_s
        self._not_drawn: dict[str, str] = {}
        self._growth: dict[str, dict[str, Lives]] = defaultdict(lambda: defaultdict(Lives))
        self._n_pairs = 0
        self._parts: list[Supervised] = []
        self._courts: list[Court] = []
        self._broken: list[str] = []
        self._cluster: Cluster | None = None
        self._open_pit(entries, seed, every_s, n_workers)
        if has_league:
            self._open_league(seed, every_s)

    def _disk(self, whose: str) -> Path:
        disk = self._folder / whose
        try:
            self._stack.enter_context(small_disk(disk, 64 + int(self._duration_s / 15)))
        except ArenaError as error:
            self._not_drawn[f"full disk of the {whose}"] = str(error)
        return disk

    def _start(self, name: str, *words: str, is_forever: bool = True, arena: bool = True) -> Supervised:
        command = [sys.executable, *(["-P", "-c", "from tournaments.cli import main; main()"] if arena else []), *words]
        environment = {"ARENA_CONFIG": str(self._folder / "config" / name), "NUMBA_CACHE_DIR": str(cache_root())}
        part = self._stack.enter_context(Supervised(name, command, self._folder, environment, is_forever=is_forever))
        self._parts.append(part)
        return part

    def _open_pit(self, entries: dict[str, str], seed: int, every_s: float, n_workers: int) -> None:
        self._pit_data, port = self._disk("pit"), free_port()
        self._pit = pit = self._start(
            "pit", "serve", "--pit", PIT, "--ladder", "--listen", f"tcp/127.0.0.1:{port}", "--data", str(self._pit_data),
            "--workers", str(n_workers),
        )  # fmt: skip
        relays, clients = {}, {}
        for name, policy in entries.items():
            between = str(free_port())
            relays[name] = self._start(f"network-of-{name}", str(_RELAY), between, str(port), str(_DELAY_S), arena=False)
            clients[name] = self._start(
                name, "join", f"arena://127.0.0.1:{between}/{PIT}", "--name", name, "--policy", policy, "--forever",
                "--slots", "2", "--no-audit", "--no-transcripts", "--data", str(self._folder / "clients"),
            )  # fmt: skip
        self._clients = clients
        workers = _signals("worker", lambda: [("worker", [pid], "") for pid in pit.find("spawn_main")], weight=_SELDOM)
        kinds = [
            *(workers if n_workers > 1 else ()),
            *_signals("pit", lambda: [("pit", pit.find(), "")], weight=_SELDOM),
            *_signals("client", lambda: [(name, one.find(), name) for name, one in clients.items()]),
            Kind(name="cut network", find=lambda: _targets(kill, [(name, one.find(), name) for name, one in relays.items()])),
            Kind(
                name="silent network",
                find=lambda: _targets(stop, [(name, one.find(), name) for name, one in relays.items()]),
                lasts_s=_LASTS_S,
            ),
            *self._full_disk("pit", self._pit_data),
        ]
        self._courts.append(Court("pit", Pulse(self._pit_data / "journals"), kinds, seed, every_s=every_s))

    def _open_league(self, seed: int, every_s: float) -> None:
        self._league_data = self._disk("league")
        self._file = self._folder / f"{LEAGUE}.toml"
        (self._folder / "slow.py").write_text(_BOT)
        self._league_seed = seed
        self._db = str(self._league_data / "arena.db")
        databases: list[Kind] = []
        try:
            self._cluster = cluster = self._stack.enter_context(open_cluster())
        except ArenaError as error:
            self._not_drawn |= dict.fromkeys(("kill database", "stop database"), str(error))
        else:
            self._db = cluster.make_database()
            databases = _signals("database", lambda: [("postgresql", cluster.find(), "")])
        self._add_pairs()
        self._league = league = self._start(
            "league", "tournament", "run", str(self._file), "--venue", "network", "--data", str(self._league_data),
            "--db", self._db, "--json", is_forever=False,
        )  # fmt: skip
        kinds = [
            *_signals("scheduler", lambda: [("scheduler", league.find(), "")], weight=_SELDOM),
            *_signals("referee", lambda: [("referee", league.find("spawn_main")[:1], "")], weight=_SELDOM),
            *_signals("client of the league", lambda: [(name, league.find(f"--name {name} ")[:1], name) for name in _FIGHTERS]),
            *databases,
            *self._full_disk("league", self._league_data),
        ]
        journals = self._league_data / "journals" / LEAGUE
        self._courts.append(Court("league", Pulse(journals), kinds, seed, every_s=every_s))

    def _full_disk(self, whose: str, disk: Path) -> list[Kind]:
        name = f"full disk of the {whose}"
        target = Target(name=whose, inflict=fill(disk))
        return [] if name in self._not_drawn else [Kind(name=name, find=lambda: [target], lasts_s=_LASTS_S, weight=_SELDOM)]

    def _add_pairs(self) -> None:
        self._n_pairs += _ROUND_PAIRS
        entries = "".join(f'{name} = "{name if name == "patrol" else "slow.py"}"\n' for name in _FIGHTERS)
        self._file.write_text(
            f'name = "{LEAGUE}"\npairs = {self._n_pairs}\nseed = {self._league_seed}\nslots = 2\nmaps = "fresh"\n'
            f'trusted = ["slow-a", "slow-b"]\n[entries]\n{entries}'
        )

    # While it goes on

    def go_on(self, progress: Progress) -> None:
        """Let everything come, fail for a while, and come to its end."""
        come_by_s = time.monotonic() + _COME_S
        while not all(court.pulse.seen for court in self._courts):
            self._tend(progress, may_begin=False)
            if time.monotonic() > come_by_s:
                said = "; ".join(f"{part.name}: {part.last_words}" for part in self._parts)
                raise ArenaError(f"no match began within {_COME_S:.0f} s; what was said last: {said}")
        begun_s = time.monotonic()
        looked_s = said_s = 0.0
        while (now_s := time.monotonic()) < begun_s + self._duration_s:
            self._tend(progress, may_begin=True, at_s=now_s - begun_s)
            if now_s - looked_s >= _LOOK_S:
                looked_s = now_s
                self._weigh(now_s)
            if now_s - said_s >= _SAY_S:
                said_s = now_s
                progress(f"{now_s - begun_s:.0f} of {self._duration_s:.0f} s, {self._describe()}")
        self._finish(progress)

    def _describe(self) -> str:
        counted = (
            f"{len(court.pulse.seen)} matches and {len(court.faults)} faults in the {court.name}" for court in self._courts
        )
        return ", ".join(counted)

    def _tend(self, progress: Progress, *, may_begin: bool, at_s: float = 0.0, may_grow: bool = True) -> None:
        for part in self._parts:
            part.tend()
            if part.has_finished and may_grow:
                self._add_pairs()
                part.start()
                self._courts[-1].excuse()
        if self._cluster is not None:
            self._cluster.tend(RESTART_S)
        for court in self._courts:
            begun = court.tend(may_begin=may_begin)
            if begun:
                progress(f"{at_s:.0f} s: {begun}")
        time.sleep(_POLL_S)

    def _weigh(self, now_s: float) -> None:
        """Look at what the processes hold that live long."""
        roles = {
            "pit": self._pit.find(),
            "worker": self._pit.find("spawn_main"),
            "client": [pid for one in self._clients.values() for pid in one.find()],
        }
        if len(self._courts) > 1:
            family = self._league.family()
            roles["scheduler"] = self._league.find()
            roles["referee"] = [pid for pid, command in family.items() if "spawn_main" in command]
            roles["client of the league"] = [pid for pid, command in family.items() if " --alive " in command]
        for role, pids in roles.items():
            for pid in pids:
                cost = read_cost(pid)
                if cost is not None:
                    for what in MOST_GROWTH:
                        self._growth[role][what].add(pid, now_s, float(getattr(cost, what)))

    def _finish(self, progress: Progress) -> None:
        """Let the last fault pass, the league end, and the pit close."""
        progress(f"no more faults; {self._describe()}")
        by_s = time.monotonic() + _END_S
        league = self._league if len(self._courts) > 1 else None
        while not all(court.is_calm for court in self._courts) or (league is not None and not league.has_finished):
            self._tend(progress, may_begin=False, may_grow=False)
            if time.monotonic() > by_s:
                self._broken.append(
                    f"{_END_S:.0f} s after the last fault, the league had not ended: {league and league.last_words}"
                )
                break
        while not self._pit.is_running:
            self._tend(progress, may_begin=False, may_grow=False)
        code = self._pit.finish(60.0)
        if code != 0:
            self._broken.append(f"the pit ended with exit code {code}: {self._pit.last_words}")

    # Afterwards

    def reckon(self) -> dict[str, Any]:
        """Return what came of it."""
        figures: dict[str, Any] = {"store": "sqlite" if self._cluster is None else "sqlite and postgresql"}
        broken = [*self._broken, *(sentence for court in self._courts for sentence in court.broken())]
        found = reckon_ladder(self._pit_data, PIT, self._courts[0].pulse.seen)
        figures["pit"], broken = found.figures, [*broken, *found.broken]
        if len(self._courts) > 1:
            if self._cluster is not None:
                self._cluster.tend(0.0)
            n_planned = self._n_pairs * 2 * len(_FIGHTERS) * (len(_FIGHTERS) - 1) // 2
            found = reckon_league(self._league_data, self._db, LEAGUE, n_planned, self._courts[1].pulse.seen)
            figures["league"], broken = found.figures, [*broken, *found.broken]
        figures["faults"] = {kind: costs for court in self._courts for kind, costs in court.costs().items()}
        figures["not_drawn"] = self._not_drawn
        for court in self._courts:
            in_faults = sum(fault.n_late for fault in court.faults)
            figures[court.name]["late_turns"] = {"in_faults": in_faults, "outside": court.pulse.count_late() - in_faults}
        exits: Counter[str] = Counter()
        for part in self._parts:
            exits.update({f"{'client' if part.name in self._clients else part.name} {code}": n for code, n in part.exits.items()})
        figures["exits"] = dict(sorted(exits.items()))
        figures["growth_per_min"], grown = self._judge_growth()
        broken += [f"{path.name} tells of a traceback: {said}" for path in self._logs() if (said := _find_traceback(path))]
        return {**figures, "broken": [*broken, *grown]}

    def _logs(self) -> list[Path]:
        return sorted([*self._folder.glob("*.log"), *self._folder.glob("*/journals/**/*.log")])

    def _judge_growth(self) -> tuple[dict[str, Any], list[str]]:
        figures: dict[str, Any] = {}
        broken = []
        for role, found in self._growth.items():
            for what, most in MOST_GROWTH.items():
                slope = found[what].slope()
                if slope is None:
                    figures.setdefault(role, {})[what] = "too short to tell"
                    continue
                figures.setdefault(role, {})[what] = {
                    "slope": round(slope.per_min, 3), "low": round(slope.low, 3), "high": round(slope.high, 3)
                }  # fmt: skip
                figures[role]["minutes"] = round(slope.minutes, 1)
                if slope.minutes >= _JUDGED_MIN and slope.low > most:
                    broken.append(f"the {what} of each {role} grow by at least {slope.low:.1f} a minute")
        return figures, broken


def _find_traceback(log: Path) -> str:
    """Return what a process raised that ought to have said a sentence; nothing if none did."""
    lines = log.read_text(errors="replace").splitlines()
    for number, line in enumerate(lines):
        if line.startswith("Traceback"):
            return next((later for later in lines[number + 1 :] if later and not later.startswith(" ")), line)
    return ""


def _signals(what: str, find: Callable[[], Sequence[tuple[str, list[int], str]]], weight: float = 1.0) -> list[Kind]:
    """Return the kinds of fault of a process: it is killed, or stopped for a while."""
    return [
        Kind(name=f"kill {what}", find=lambda: _targets(kill, find()), weight=weight),
        Kind(name=f"stop {what}", find=lambda: _targets(stop, find()), lasts_s=_LASTS_S),
    ]


def _targets(how: Callable[[Sequence[int]], Any], found: Sequence[tuple[str, list[int], str]]) -> list[Target]:
    return [Target(name=name, inflict=how(pids), entry=entry) for name, pids, entry in found if pids]
