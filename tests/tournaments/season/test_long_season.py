"""A season of many days: versions at random, kills at random, and every result counted once. Its size is that of the tests."""

import os
from pathlib import Path

import numpy as np
import pytest
from pretended_season import PretendedSeason

from tournaments.league.season import Phase

IS_FULL = os.environ.get("ARENA_TEST_SIZE") == "full"
N_DAYS, N_ENTRIES, N_MATCHES_A_DAY = (1_000, 200, 60) if IS_FULL else (12, 12, 60)
MOST_BYTES_A_MATCH = 3_000
"""Of the store: 1 GB for 300,000 matches."""


def test_a_season_of_many_days_loses_no_result_and_counts_none_twice(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    season = PretendedSeason(str(tmp_path / "arena.db"), tmp_path, {"rush": 100.0, "patrol": 0.0, "random": -100.0})
    season.venue.most = 32
    told: list[str] = []
    n_versions = 0
    with season.store:
        for day in range(N_DAYS):
            season.now_s += 86_400
            n_new = N_ENTRIES // 10 if day < 10 else int(rng.poisson(5))
            for _ in range(n_new):
                name = f"e{rng.integers(N_ENTRIES)}"
                n_versions += 1
                season.submit(name, f"d{n_versions}", float(rng.normal(0, 150)))
            n_today = 0
            while n_today < N_MATCHES_A_DAY:
                season.now_s += 1
                counted = season.runner.step(Phase.OPEN)
                told += [outcome.identity for outcome in counted]
                n_today += len(counted)
                if not counted and not season.runner.n_under_way:
                    break
            if rng.random() < 0.2:
                season.open()  # it was killed in the middle of the day

        stored = season.store.identities(season.row)
        assert len(told) == len(set(told))
        assert set(told) == stored
        assert season.runner.results.n_matches == len(stored) > N_DAYS * N_MATCHES_A_DAY // 2
        ratings = season.runner.table.ratings
        strengths = np.array([season.venue.elo[label] for label in ratings])
        found = np.array([rating.elo for rating in ratings.values()])
        inside = np.mean([
            rating.elo_low <= strength - strengths.mean() <= rating.elo_high
            for rating, strength in zip(ratings.values(), strengths, strict=True)
        ])  # fmt: skip
    n_bytes = sum(path.stat().st_size for path in tmp_path.glob("arena.db*"))
    print(f"{len(stored)} matches, {n_versions} versions, {n_bytes / 1e6:.1f} MB, {inside:.3f} of the intervals hold")  # noqa: T201
    assert n_bytes < max(MOST_BYTES_A_MATCH * len(stored), 10_000_000)
    assert np.corrcoef(strengths, found)[0, 1] > (0.9 if IS_FULL else 0.7)
    assert inside > 0.8


@pytest.mark.parametrize("n", [1, 2])
def test_a_season_opened_again_has_the_table_that_it_had(tmp_path: Path, n: int) -> None:
    season = PretendedSeason(str(tmp_path / "arena.db"), tmp_path, {"rush": 100.0, "patrol": 0.0, "random": -100.0})
    with season.store:
        for number in range(n):
            season.submit("ann", f"d{number}", 50.0)
            for _ in range(10):
                season.now_s += 10
                season.runner.step(Phase.OPEN)
        while season.runner.n_under_way:
            season.runner.step(Phase.OPEN, may_choose=False)
        season.now_s += 10
        season.runner.step(Phase.OPEN, may_choose=False)
        before = season.runner.table.ratings

        season.open()

        for label, rating in season.runner.table.ratings.items():
            assert rating.elo == pytest.approx(before[label].elo, abs=0.01)
