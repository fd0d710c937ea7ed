"""A pit that soaks: with workers here and on another machine, and clients that join it, each through a network of its own."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from arena.errors import ArenaError
from arena.network.address import free_port
from benchmarks.measuring.audit import Audit, audit_ladder
from benchmarks.measuring.faults import LASTS_S, FaultInjector, Kind, Repair, Target, kill, signals, stop, targets
from benchmarks.measuring.journal_watch import JournalWatch
from benchmarks.measuring.machines import FarMachine, Network, far_machines, networks, program_of, ssh_of
from benchmarks.measuring.soak_ground import SELDOM, Ground
from benchmarks.measuring.supervised import Supervised

_NAME = "soak"
_RELAY = Path(__file__).parent / "relay.py"
_DELAY_S = 0.01
"""Of each network, in each direction."""
_AWAY_S = (0.5, 30.0)
"""How long a machine is off, or cut off: shorter and longer than a pit takes to note it."""
_OF_MACHINES = ("kill far worker", "switch machine off", "cut network of machine")


class SoakedPit:
    """The processes of a pit and its clients, and the faults that strike them.

    Parameters
    ----------
    entries
        Names of the clients, and what each plays.
    n_workers, n_far_workers
        Here, and on another machine.
    """

    def __init__(
        self, ground: Ground, entries: Mapping[str, str], seed: int, *, every_s: float, n_workers: int, n_far_workers: int
    ) -> None:
        self._data, full_disks = ground.disk("pit")
        self._machine: FarMachine | None = None
        port = free_port()
        words, environment, of_machine = self._open_machine(ground, n_far_workers)
        self.process = pit = ground.start(
            "pit", "serve", "--pit", _NAME, "--ladder", "--listen", f"tcp/127.0.0.1:{port}", "--data", str(self._data),
            "--workers", str(n_workers), *words, environment=environment,
        )  # fmt: skip
        relays, self._clients = dict[str, Supervised](), dict[str, Supervised]()
        for name, policy in entries.items():
            between = str(free_port())
            relays[name] = ground.start(f"network-of-{name}", str(_RELAY), between, str(port), str(_DELAY_S), is_arena=False)
            self._clients[name] = ground.start(
                name, "join", f"arena://127.0.0.1:{between}/{_NAME}", "--name", name, "--policy", policy, "--forever",
                "--slots", "2", "--no-audit", "--no-transcripts", "--data", str(ground.folder / "clients"),
            )  # fmt: skip
        kinds = [
            *self._of_workers(n_workers + (self._machine is not None)),
            *of_machine,
            *signals("pit", lambda: [("pit", pit.find(), "")], weight=SELDOM),
            *signals("client", lambda: [(name, one.find(), name) for name, one in self._clients.items()]),
            Kind(name="cut network", find=lambda: targets(kill, [(name, one.find(), name) for name, one in relays.items()])),
            Kind(
                name="silent network",
                find=lambda: targets(stop, [(name, one.find(), name) for name, one in relays.items()]),
                lasts_s=LASTS_S,
            ),
            *full_disks,
        ]
        self.injector = FaultInjector("pit", JournalWatch(self._data / "journals"), kinds, seed, every_s=every_s)

    def _open_machine(self, ground: Ground, n_workers: int) -> tuple[list[str], dict[str, str], list[Kind]]:
        """Return what a pit is started with to have workers on another machine, and the faults of that."""
        if not n_workers:
            return [], {}, []
        folder, within = ground.folder / "ssh", list[Network]()
        try:
            within = ground.stack.enter_context(networks(1))
        except ArenaError as error:
            ground.not_drawn[_OF_MACHINES[-1]] = str(error)
        try:
            (machine,) = ground.stack.enter_context(far_machines(folder, 1, within))
        except ArenaError as error:
            ground.not_drawn |= dict.fromkeys(_OF_MACHINES, str(error))
            return [], {}, []
        self._machine = machine
        kinds = [
            Kind(
                name=_OF_MACHINES[0],
                find=lambda: targets(kill, [("worker", [pid], "") for pid in machine.workers()], is_of_all=True),
                weight=SELDOM,
            ),
            _of_machine(_OF_MACHINES[1], machine, partial(_switch_off, machine)),
            *(_of_machine(_OF_MACHINES[2], machine, partial(_cut, one)) for one in within),
        ]
        words = ["--machine", f"{machine.host}={n_workers}", "--machine-program", str(program_of(folder))]
        return words, {"ARENA_SSH": ssh_of(folder)}, kinds

    def _of_workers(self, n_workers: int) -> list[Kind]:
        if n_workers == 1:
            return []  # the pit referees by itself
        return signals("worker", lambda: [("worker", [pid], "") for pid in self._workers()], weight=SELDOM, is_of_all=True)

    def _workers(self) -> list[int]:
        return self.process.find("spawn_main")

    def roles(self) -> dict[str, list[int]]:
        """Return the processes that live long, by what they do."""
        return {
            "pit": self.process.find(),
            "worker": self._workers(),
            "far worker": [] if self._machine is None else self._machine.workers(),
            "client": [pid for one in self._clients.values() for pid in one.find()],
        }

    def is_client(self, part: Supervised) -> bool:
        """Whether it plays here."""
        return part.name in self._clients

    def audit(self) -> Audit:
        """Return what came of it, once it has closed."""
        return audit_ladder(self._data, _NAME, self.injector.watch.seen)


def _of_machine(name: str, machine: FarMachine, inflict: Callable[[], Repair]) -> Kind:
    target = Target(name=machine.host, inflict=inflict, is_of_all=True)
    return Kind(name=name, find=lambda: [target], lasts_s=_AWAY_S)


def _switch_off(machine: FarMachine) -> Repair:
    """End all that runs there, until that is repaired."""
    machine.die()
    return machine.start


def _cut(network: Network) -> Repair:
    """Let nothing through, until that is repaired."""
    network.cut()
    return network.mend
