"""Where the matches of a league are played. Every venue takes plans and yields outcomes as matches end, in no promised order.

`local` plays in this process and its workers, and `ray` does the same on a cluster. `network` is the real pit: a referee and
every entry a process of its own, Zenoh on loopback between them.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from arena.extras import needs
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.keyring.files import load_or_make
from arena.local.venue import MatchRecord
from arena.local.venue import play as play_matches
from arena.match.time_control import TimeControl
from arena.network.address import Address
from arena.network.session import free_port
from arena.records.plan import MatchPlan
from policies.registry import load_entry
from tournaments.league.limits import NO_LIMITS, Limits
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.venues.processes import ClientProcess, RefereeProcess, entry_key_path
from tournaments.venues.recovery import find_ended

_PIT = "league"


def _tell_nobody(_: Mapping[str, str]) -> None:
    """Leave it to others to say."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What a venue needs to know of a league."""

    ruleset: Ruleset
    entries: Mapping[str, str]
    """The fighter, by name or file, behind each entry."""
    time_control: TimeControl
    slots: int
    """Seats that the process of an entry holds at once."""
    journals: Path
    keys: Path
    """Folder for the keys of the pit and of the entries: whoever is started anew is still who it was."""
    homes: Path
    """Folder for the homes of the entries' processes."""
    limits: Limits = NO_LIMITS
    """For each process of an entry."""
    remote: Mapping[str, bytes] = field(default_factory=dict)
    """The public keys of those entries that join by themselves; they have no process here."""
    listen: str = ""
    """Endpoint of the pit; any free port of loopback without it."""
    on_open: Callable[[Mapping[str, str]], None] = _tell_nobody
    """Told, once the pit is open, with which command each of `remote` joins."""


def address_of(setting: Setting) -> Address:
    """Return where the pit of a league is, in the venue `network`."""
    pit = load_or_make(setting.keys / "pit.key")
    return Address(endpoint=setting.listen or f"tcp/127.0.0.1:{free_port()}", pit=_PIT, fingerprint=pit.fingerprint)


def near(address: Address) -> Address:
    """Return how an address is reached from this machine: who listens everywhere is also on loopback."""
    endpoint = address.endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")
    return replace(address, endpoint=endpoint)


def invitations(setting: Setting, address: Address) -> dict[str, str]:
    """Return the command with which each entry joins that comes by itself."""
    return {name: f"arena join '{address}' --name {name} --key FILE --slots {setting.slots} --forever" for name in setting.remote}


def play_local(setting: Setting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play in this process and its workers, without a clock."""
    finder = partial(load_entry, dict(setting.entries))
    return _play_rest(setting, plans, lambda left: play_matches(setting.ruleset, left, finder, journals=setting.journals))


def play_ray(setting: Setting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play on a Ray cluster what `local` would play, without a clock.

    Raises
    ------
    InputError
        Ray is not installed.
    """
    with needs("cluster", "the venue ray"):
        from tournaments.venues.ray_cluster import play
    return _play_rest(setting, plans, lambda left: play(setting.ruleset, left, setting.entries, journals=setting.journals))


def _play_rest(
    setting: Setting, plans: Sequence[MatchPlan], play: Callable[[list[MatchPlan]], Iterator[MatchRecord]]
) -> Iterator[Outcome]:
    """Play what has not ended yet."""
    left = {plan.identity: plan for plan in plans}
    for outcome in find_ended(setting.journals, setting.ruleset, plans):
        del left[outcome.identity]
        yield outcome
    for record in play(list(left.values())):
        yield _of_record(record)


def play_network(setting: Setting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play over Zenoh, on loopback. A void match is told of, and not played again here.

    Raises
    ------
    ArenaError
        The referee died again and again, or a client that played no match; a log says why.
    """
    left = {plan.identity: plan for plan in plans}
    for outcome in find_ended(setting.journals, setting.ruleset, plans):
        del left[outcome.identity]
        yield outcome
    if not left:
        return
    setting.journals.mkdir(parents=True, exist_ok=True)
    names = sorted({name for plan in left.values() for name in (plan.blue, plan.red)})
    ours = [name for name in names if name not in setting.remote]
    entries = {**setting.remote, **{name: load_or_make(entry_key_path(setting, name)).public for name in ours}}
    address = address_of(setting)
    with ExitStack() as processes:
        referee = processes.enter_context(RefereeProcess(replace(setting, on_open=_tell_nobody), address, entries))
        referee.start(list(left.values()))
        setting.on_open(invitations(setting, address))
        clients = [processes.enter_context(ClientProcess(setting, near(address), name)) for name in ours]
        while left:
            is_gone = False
            try:
                heard = referee.hear()
            except EOFError:
                is_gone = True
                referee.bury()
                # What it wrote to a journal and could not tell any more has ended; only the rest is played.
                heard = list(find_ended(setting.journals, setting.ruleset, left.values()))
            for outcome in heard:
                if left.pop(outcome.identity, None) is not None:
                    yield outcome
            if is_gone and left:
                referee.start(list(left.values()))
            n_left = Counter(name for plan in left.values() for name in (plan.blue, plan.red))
            for client in clients:
                client.keep_alive(n_left[client.name])


VENUES = {"local": play_local, "network": play_network, "ray": play_ray}


def _of_record(record: MatchRecord) -> Outcome:
    seats = {team: SeatOutcome(faults={"unreadable": n} if n else {}) for team, n in zip(Team, record.n_unreadable, strict=True)}
    return Outcome.of(record.plan, record.result, seats)
