"""The venue `network`: the real pit, a referee and every entry a process of its own, Zenoh between them."""

import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace

from arena.folders import data_folder
from arena.game.types import Team
from arena.keyring.files import load_or_make
from arena.network.address import Address
from arena.network.session import free_port
from arena.records.plan import MatchPlan
from tournaments.outcome import Outcome
from tournaments.venues.bundle import pack
from tournaments.venues.processes import ClientProcess, RefereeProcess, entry_key_path
from tournaments.venues.recovery import find_ended
from tournaments.venues.setting import VenueSetting, ignore_invitations

_PIT = "league"
_SETTLE_S = 2.0


def address_of(setting: VenueSetting) -> Address:
    """Return where the pit of a league is, in the venue `network`."""
    pit = load_or_make(setting.keys / "pit.key")
    return Address(endpoint=setting.listen or f"tcp/127.0.0.1:{free_port()}", pit=_PIT, fingerprint=pit.fingerprint)


def invitations(setting: VenueSetting, address: Address) -> dict[str, str]:
    """Return the command with which each entry joins that comes by itself."""
    return {name: f"arena join '{address}' --name {name} --key FILE --slots {setting.slots} --forever" for name in setting.remote}


def freeze(setting: VenueSetting) -> dict[str, str]:
    """Return the fighters such that what is edited while the league runs changes none that plays behind a wall."""
    walled = {name for name, sandbox in setting.sandboxes.items() if sandbox.has_wall}
    copies = pack({name: spec for name, spec in setting.entries.items() if name in walled}).unpack()
    return {**setting.entries, **copies}


def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
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
    data_folder(setting.journals)
    names = sorted({name for plan in left.values() for name in (plan.blue, plan.red)})
    ours = [name for name in names if name not in setting.remote]
    entries = {**setting.remote, **{name: load_or_make(entry_key_path(setting, name)).public for name in ours}}
    address = address_of(setting)
    setting = replace(setting, entries=freeze(setting))
    settling: deque[tuple[float, Outcome]] = deque()
    """Matches that are over, and by when what their fighters met as they were ended is known."""
    with ExitStack() as processes:
        referee = processes.enter_context(RefereeProcess(replace(setting, on_open=ignore_invitations), address, entries))
        referee.start(list(left.values()))
        setting.on_open(invitations(setting, address))
        clients = {name: processes.enter_context(ClientProcess(setting, address.from_here(), name)) for name in ours}
        while left:
            is_gone = False
            try:
                ended = referee.receive()
            except EOFError:
                is_gone = True
                referee.reap()
                # What it wrote to a journal and could not tell any more has ended; only the rest is played.
                ended = list(find_ended(setting.journals, setting.ruleset, left.values()))
            for outcome in ended:
                if left.pop(outcome.identity, None) is not None:
                    is_limited = not setting.sandboxes.keys().isdisjoint((outcome.blue, outcome.red))
                    settling.append((time.monotonic() + is_limited * _SETTLE_S, outcome))
            while settling and settling[0][0] <= time.monotonic():
                yield _with_limits_met(settling.popleft()[1], clients)
            if is_gone and left:
                referee.start(list(left.values()))
            n_left = Counter(name for plan in left.values() for name in (plan.blue, plan.red))
            for name, client in clients.items():
                client.keep_alive(n_left[name])
    for _, outcome in settling:
        yield _with_limits_met(outcome, clients)


def _with_limits_met(outcome: Outcome, clients: Mapping[str, ClientProcess]) -> Outcome:
    """Return an outcome with the limits among its faults that its fighters met since the outcome before."""
    seats = {
        team: replace(outcome.seats[team], faults={**outcome.seats[team].faults, **clients[name].take_limits_met()})
        for team, name in ((Team.BLUE, outcome.blue), (Team.RED, outcome.red))
        if name in clients
    }
    return replace(outcome, seats={**outcome.seats, **seats})
