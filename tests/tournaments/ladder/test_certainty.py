"""How sure a ladder is of its ratings, in made-up pits whose truth is known: real ladders, and a clock that months pass on."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from math import log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.game.types import Team, Termination
from arena.intervals import Z95
from arena.pit.ladder import LadderMatch, Waiting
from arena.policy import MatchResult
from tournaments.ladder.ladder import LATELY, RatedLadder
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ladder.skill import (
    ELO,
    MOST_DRIFTED,
    NEW_VERSION,
    START_SIGMA,
    LadderEntry,
    age,
    renew,
)
from tournaments.ratings import davidson

DAY_S = 86_400.0
DRAW = log(2 / 9)
ENTRY = LadderEntry(key="a", name="ann", mu=30.0, sigma=1.5, version="one", played_at=1e9)


class FastStore(LadderStore):
    """Keeps no match: what a ladder knows is in its memory."""

    def count_match(self, *_: object) -> bool:
        return True


class MadeUpPit:
    """Entries of known strengths, some of which wait whenever a match is to begin."""

    def __init__(self, ladder: RatedLadder, rng: np.random.Generator, strengths_elo: Mapping[str, float]) -> None:
        self.ladder, self.rng, self.strengths_elo = ladder, rng, dict(strengths_elo)
        self.owners: dict[str, str] = {}
        self.versions: dict[str, str] = {}
        self.losers: set[str] = set()
        """Lose on purpose."""
        self.met: list[frozenset[str]] = []

    def play(self, n_matches: int, n_waiting: int = 8, without: str = "") -> None:
        names = sorted(set(self.strengths_elo) - {without})
        for _ in range(n_matches):
            present = self.rng.choice(names, min(n_waiting, len(names)), replace=False)
            waiting = [self._wait(str(name)) for name in present]
            chosen = self.ladder.choose(waiting, 60.0)
            if chosen is not None:
                self._play([one.entry.decode().strip() for one in chosen])

    def _wait(self, name: str) -> Waiting:
        owner, version = self.owners.get(name, name), self.versions.get(name, "")
        return Waiting(entry=key(name), since_s=float(self.rng.random()), owner=owner, version=version)

    def _play(self, names: list[str]) -> None:
        self.met.append(frozenset(names))
        strengths = [self.strengths_elo[name] - 5_000 * (name in self.losers) for name in names]
        shares = davidson.chances(np.array([*strengths, 0.0, DRAW * davidson.ELO]) / davidson.ELO)[0, 1]
        winner = (Team.BLUE, None, Team.RED)[self.rng.choice(3, p=shares)]
        self.ladder.count(
            LadderMatch(
                identity=f"pit/ladder/{len(self.met)}",
                names=dict(zip(Team, names, strict=True)),
                entries={team: key(name) for team, name in zip(Team, names, strict=True)},
                rules_hash="",
                result=MatchResult(ending=Termination.CAPTURE, winner=winner, score=0, ticks=9, reason=""),
            )
        )

    def errors(self) -> list[float]:
        """Return how far each rating is off, in its own standard deviations."""
        rows = {row["name"]: row for row in self.ladder.standings()}
        middle = np.mean([row["mu"] for row in rows.values()])
        truth = np.mean([self.strengths_elo[name] for name in rows])
        return [(row["mu"] - middle - (self.strengths_elo[name] - truth) / ELO) / row["sigma"] for name, row in rows.items()]

    def mu(self, name: str) -> float:
        return float(next(row["mu"] for row in self.ladder.standings() if row["name"] == name))


def key(name: str) -> bytes:
    return name.encode().ljust(32)


class Clock:
    def __init__(self) -> None:
        self.now_s = 1e9
        self.step_s = 0.0

    def __call__(self) -> float:
        self.now_s += self.step_s
        return self.now_s


@contextmanager
def made_up_pit(seed: int, strengths_elo: Mapping[str, float], clock: Clock | None = None) -> Iterator[MadeUpPit]:
    with FastStore("sqlite://") as store:
        ladder = RatedLadder(store, "pit", clock or Clock())
        try:
            yield MadeUpPit(ladder, np.random.default_rng(seed), strengths_elo)
        finally:
            ladder.close()


def draw_strengths(seed: int, n: int, deviation_elo: float) -> dict[str, float]:
    return {f"n{number}": float(elo) for number, elo in enumerate(np.random.default_rng(seed).normal(0, deviation_elo, n))}


@pytest.mark.parametrize("deviation_elo", [100.0, 300.0])
def test_intervals_of_static_bots_stay_honest_over_months(deviation_elo: float, size: Callable[[int, int], int]) -> None:
    """With opponents of nearest rating alone, less than two thirds of them held the truth."""
    errors: dict[str, list[float]] = {"in use": [], "after a pause": []}
    for seed in range(size(3, 60)):
        clock = Clock()
        with made_up_pit(seed, draw_strengths(seed, 10, deviation_elo), clock) as pit:
            clock.step_s = 90 * DAY_S / 500
            pit.play(500)
            errors["in use"] += pit.errors()
            clock.now_s += 180 * DAY_S
            errors["after a pause"] += pit.errors()

    for when, found in errors.items():
        covered = np.mean(np.abs(found) <= Z95)
        assert covered >= 0.95 - 3 * (0.95 * 0.05 / len(found)) ** 0.5, when
    assert np.std(errors["in use"]) > 0.4  # and are no wider than they need to be


def test_a_static_bot_that_plays_is_never_less_known_than_one_that_paused() -> None:
    clock = Clock()
    with made_up_pit(0, draw_strengths(0, 6, 100.0), clock) as pit:
        clock.step_s = 365 * DAY_S / 300
        pit.play(300)

        assert all(row["sigma"] < MOST_DRIFTED for row in pit.ladder.standings())


@given(st.floats(0.1, START_SIGMA), st.floats(0, 4_000), st.floats(0, 4_000))
def test_certainty_falls_with_time_up_to_a_bound(sigma: float, days: float, more_days: float) -> None:
    entry = replace(ENTRY, sigma=sigma)
    early, late = (age(entry, 1e9 + DAY_S * after) for after in (days, days + more_days))

    assert sigma <= early.sigma <= late.sigma <= max(sigma, MOST_DRIFTED)
    assert replace(late, sigma=sigma) == entry


def test_time_that_is_not_known_or_runs_backwards_changes_nothing() -> None:
    assert age(ENTRY, 5e8) == ENTRY
    assert age(replace(ENTRY, played_at=0.0), 2e9) == replace(ENTRY, played_at=0.0)


def test_a_new_version_is_less_known_and_never_less_than_a_newcomer() -> None:
    new = renew(ENTRY, "two")

    assert new.sigma == pytest.approx((1.5**2 + NEW_VERSION**2) ** 0.5)
    assert (new.mu, new.version) == (ENTRY.mu, "two")
    for number in range(20):
        new = renew(new, str(number))
    assert new.sigma == START_SIGMA


@pytest.mark.parametrize("version", ["", "one"])
def test_the_same_version_and_one_that_is_not_told_are_as_known_as_before(version: str) -> None:
    assert renew(ENTRY, version) == ENTRY


def test_the_first_version_that_is_told_is_the_one_that_has_played() -> None:
    assert renew(replace(ENTRY, version=""), "one") == ENTRY


def count_until_risen(seed: int, versions: tuple[str, str]) -> int:
    """Return how many matches an entry that became 300 Elo stronger plays until its rating says nearly so."""
    strengths = {**draw_strengths(seed, 9, 150.0), "me": -150.0}
    with made_up_pit(seed, strengths) as pit:
        pit.versions["me"] = versions[0]
        pit.play(500)
        before = pit.mu("me")
        pit.strengths_elo["me"] += 300.0
        pit.versions["me"] = versions[1]
        n_before = sum(frozenset(["me"]) < pair for pair in pit.met)
        while pit.mu("me") < before + 200.0 / ELO:
            pit.play(10)
        return sum(frozenset(["me"]) < pair for pair in pit.met) - n_before


def test_a_new_version_moves_fast(size: Callable[[int, int], int]) -> None:
    seeds = range(size(2, 20))
    told, untold = (np.median([count_until_risen(seed, (old, "two")) for seed in seeds]) for old in ("one", "two"))

    assert told < untold / 2


def test_a_farm_of_losing_entries_of_one_owner_lifts_nobody(size: Callable[[int, int], int]) -> None:
    """A cheat with eight entries that lose on purpose, among six honest ones of its own strength."""
    places: list[int] = []
    for seed in range(size(4, 40)):
        farm = {f"farm{number}": 0.0 for number in range(8)}
        honest = {f"n{number}": 0.0 for number in range(6)}
        with made_up_pit(seed, {**farm, **honest, "cheat": 0.0}) as pit:
            pit.owners = dict.fromkeys([*farm, "cheat"], "eve")
            pit.losers = set(farm)
            pit.play(300)
            names = [row["name"] for row in pit.ladder.standings()]
            assert not any(len(pair & {*farm, "cheat"}) == 2 for pair in pit.met)
            places.append(names.index("cheat"))

    # Of seven equals, the cheat is in the middle; it comes no lower than others, whom its farm lifted as well as itself.
    assert np.mean(places) >= 3.0 - 3 * 2.0 / len(places) ** 0.5


def test_the_entries_of_one_owner_alone_play_nothing() -> None:
    with made_up_pit(0, dict.fromkeys(("cheat", "farm1", "farm2"), 0.0)) as pit:
        pit.owners = dict.fromkeys(("cheat", "farm1", "farm2"), "eve")
        pit.play(50)

        assert pit.met == []


def test_opponents_of_like_strength_are_met_in_turn() -> None:
    with made_up_pit(0, dict.fromkeys(map("n{}".format, range(9)), 0.0)) as pit:
        pit.play(9 * LATELY // 2, n_waiting=9)
        counts = [pit.met.count(frozenset((f"n{one}", f"n{other}"))) for one in range(9) for other in range(one)]

        assert max(counts) - min(counts) <= 5


def test_the_standings_of_a_ladder_that_nobody_plays_on_grow_old() -> None:
    clock = Clock()
    with made_up_pit(0, draw_strengths(0, 4, 100.0), clock) as pit:
        pit.play(300)
        before = {row["name"]: row["sigma"] for row in pit.ladder.standings()}
        clock.now_s += 90 * DAY_S
        after = {row["name"]: row["sigma"] for row in pit.ladder.standings()}

        assert all(after[name] > before[name] for name in before)
