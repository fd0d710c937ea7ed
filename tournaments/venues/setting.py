"""What every venue is given, and what it is: it takes plans, and yields outcomes as matches end, in no promised order."""

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

from arena.errors import ArenaError
from arena.game.ruleset import Ruleset
from arena.match.time_control import TimeControl
from arena.records.plan import MatchPlan
from arena.sandbox.process import Sandbox
from tournaments.outcome import Outcome

MOST_CLIENTS = 32
"""Each takes the memory of a Python that plays, 90 MB, and a second of a core to start; a fork 25 MB, and a tenth of that."""


class EntryLostError(ArenaError):
    """An entry does not come to its matches, and nothing else is left to play."""

    def __init__(self, name: str, why: str) -> None:
        super().__init__(why)
        self.name = name


def ignore_invitations(_: Mapping[str, str]) -> None:
    """Tell nobody how to join."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fighter:
    """What plays for one entry."""

    spec: str
    """A fighter by name or file, a program, or the public key of one that joins by itself."""
    sandbox: Sandbox | None = None
    """Where a file or a program runs; None for another, which runs in the process that joins for it."""
    public_key: bytes | None = None
    """Of one that joins by itself, and has no process here."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VenueSetting:
    """What a venue needs to know of a league."""

    ruleset: Ruleset
    entries: Mapping[str, str]
    """The fighter, by name or file, behind each entry."""
    time_control: TimeControl
    slots: int
    """Seats that the process of an entry holds at once."""
    journals: Path
    keys: Path
    """Folder for the keys of the pit and of the entries: a process that is started anew keeps its identity."""
    homes: Path
    """Folder for the homes of the entries' processes."""
    sandboxes: Mapping[str, Sandbox] = field(default_factory=dict)
    """Where the fighters run that are files or programs, by entry; others run in the process that joins for them."""
    remote: Mapping[str, bytes] = field(default_factory=dict)
    """The public keys of those entries that join by themselves; they have no process here."""
    listen: str = ""
    """Endpoint of the pit; any free port of loopback without it."""
    on_open: Callable[[Mapping[str, str]], None] = ignore_invitations
    """Called once the pit is open, with the command by which each of `remote` joins."""
    absence_s: float = inf
    """How long those of `remote` are waited for, once nothing else is left to play."""
    most_clients: int = MOST_CLIENTS
    """Processes of entries that the pit starts at once; what others have to play waits its turn."""

    @property
    def fighters(self) -> dict[str, Fighter]:
        """What `entries`, `sandboxes` and `remote` say of each entry."""
        return {
            name: Fighter(spec=spec, sandbox=self.sandboxes.get(name), public_key=self.remote.get(name))
            for name, spec in self.entries.items()
        }


def check_plans(plans: Sequence[MatchPlan], left: Container[str], names: Container[str], where: str) -> None:
    """Refuse matches that cannot be added to those that are `left`, by identity; `names` are the entries of a venue."""
    for plan in plans:
        if plan.identity in left:
            raise ValueError(f"match {plan.identity} is on the plan already")
        for name in (plan.blue, plan.red):
            if name not in names:
                raise ValueError(f"match {plan.identity} is played by {name}, which is no entry of this {where}")


Venue = Callable[[VenueSetting, Sequence[MatchPlan]], Iterator[Outcome]]
