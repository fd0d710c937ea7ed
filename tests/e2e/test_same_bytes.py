"""The network venue without a clock, and a cluster, give the journals of the local venue, byte by byte."""

import threading
from collections.abc import Callable
from contextlib import suppress
from itertools import product
from pathlib import Path

import pytest

from arena.errors import LostPitError
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import load
from arena.local.venue import play
from arena.match.time_control import TimeControl
from arena.network.session import open_router
from arena.pit.effects import MatchEnded
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.seating import PlannedSeating
from arena.protocol.identity import Identity
from arena.records.journal import journal_name, load_journal, read_journal
from arena.records.plan import MatchPlan
from clients.runner import Runner
from clients.settings import ClientSettings
from policies import registry
from tournaments.venues import ray as cluster

PAPER = load("paper")
SECRET = secret_from_seed(3)
PATIENCE_S = 100.0


def plans(pairs: list[tuple[str, str]]) -> list[MatchPlan]:
    return [
        MatchPlan(
            identity=f"same/{blue}/{red}",
            blue=blue,
            red=red,
            keys=MatchKeys(
                map_key=derive_map_key(SECRET, blue + red, 0), match_key=derive_match_key(SECRET, f"same/{blue}/{red}")
            ),
        )
        for blue, red in pairs
    ]


def play_on_the_network(wanted: list[MatchPlan], port: int, folder: Path, n_slots: int) -> list[MatchEnded]:
    """Play plans over Zenoh: the referee in this thread, each entry's client in one of its own."""
    played: list[MatchEnded] = []
    given_up = threading.Event()
    timer = threading.Timer(PATIENCE_S, given_up.set)
    timer.start()
    with open_router(f"tcp/127.0.0.1:{port}", "pit") as session:
        seating = PlannedSeating(wanted)
        context = PitContext(pit="pit", identity=Identity.make())
        time_control = TimeControl(turn_time_s=None, grace_s=PATIENCE_S)
        referee = Referee(session, context, PAPER, seating, time_control, folder, on_end=played.append)
        names = sorted({name for plan in wanted for name in (plan.blue, plan.red)})
        runners = [
            Runner(
                ClientSettings(
                    endpoint=f"tcp/127.0.0.1:{port}",
                    pit="pit",
                    name=name,
                    team="any",
                    make=registry.load(name),
                    n_matches=None,
                    n_slots=n_slots,
                    patience_s=5.0,
                ),
                on_seat=lambda _: None,
                on_end=lambda _: None,
                on_wait=lambda _: None,
            )
            for name in names
        ]

        def run(runner: Runner) -> None:
            with suppress(LostPitError):  # the pit closes when the last match is over
                runner.run()

        threads = [threading.Thread(target=run, args=(runner,)) for runner in runners]
        for thread in threads:
            thread.start()
        referee.run(lambda: given_up.is_set() or len(played) == len(wanted))
        referee.close()
        for runner in runners:
            runner.stop()
        for thread in threads:
            thread.join(PATIENCE_S)
    timer.cancel()
    return played


def test_the_network_venue_gives_the_journals_of_the_local_one(
    size: Callable[[int, int], int], port: int, tmp_path: Path
) -> None:
    every = list(product(registry.OWN, repeat=2))
    wanted = plans(every[:: size(5, 1)])

    played = play_on_the_network(wanted, port, tmp_path, n_slots=3)

    assert len(played) == len(wanted)
    for record in play(PAPER, wanted, registry.load, n_workers=1):
        journal = load_journal(tmp_path / journal_name(record.plan.identity))
        assert journal.canonical == record.journal, record.plan.identity
        assert journal.canonical_hash == read_journal(record.journal).canonical_hash
    for match in played:
        for seat in match.seats.values():
            assert not any(seat.faults().values()), match.header.identity


def test_a_cluster_gives_the_journals_of_the_local_venue(
    size: Callable[[int, int], int], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)  # one of its own
    wanted = plans(list(product(registry.OWN, repeat=2))[:: size(5, 1)])

    played = list(cluster.play_on_cluster(PAPER, wanted, {name: name for name in registry.OWN}, journals=tmp_path))

    assert len(played) == len(wanted)
    for record in play(PAPER, wanted, registry.load, n_workers=1):
        assert (tmp_path / journal_name(record.plan.identity)).read_bytes() == record.journal, record.plan.identity
