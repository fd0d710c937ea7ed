"""The network venue without a clock, and a cluster, give the journals of the local venue, byte by byte."""

from collections.abc import Callable
from itertools import product
from pathlib import Path

import pytest
from pit_in_process import play_on_the_network

from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import load
from arena.local.venue import play
from arena.records.journal import journal_name, read_journal
from arena.records.journal_folder import load_journal
from arena.records.plan import MatchPlan
from policies import registry
from tournaments.venues import ray as cluster

PAPER = load("paper")
SECRET = secret_from_seed(3)
PAIRS = list(product(registry.SCRIPTS, repeat=2))
PLANNER = ("planner-fast", "rush")
"""One match is enough of those who think for milliseconds."""


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


def test_the_network_venue_gives_the_journals_of_the_local_one(
    size: Callable[[int, int], int], port: int, tmp_path: Path
) -> None:
    wanted = plans([*PAIRS[:: size(5, 1)], PLANNER])

    played = play_on_the_network(PAPER, wanted, port, tmp_path, n_slots=3)

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
    wanted = plans([*PAIRS[:: size(5, 1)], PLANNER])

    played = list(cluster.play_on_cluster(PAPER, wanted, {name: name for name in registry.OWN}, journals=tmp_path))

    assert len(played) == len(wanted)
    for record in play(PAPER, wanted, registry.load, n_workers=1):
        assert (tmp_path / journal_name(record.plan.identity)).read_bytes() == record.journal, record.plan.identity
