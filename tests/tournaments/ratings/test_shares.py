"""Shares: who counts where beating goes in circles."""

import json
import subprocess
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from outcomes import met

from arena.game.types import Team
from tournaments import plug_ins
from tournaments.outcome import Outcome
from tournaments.ratings.shares import GROUP, alpha_rank, find_shares, maximal_lottery, nash, share, unbeaten_mixture
from tournaments.store.store import Store

Arena = Callable[..., subprocess.CompletedProcess[str]]
METHODS = ("maximal-lotteries", "nash", "alpha-rank")
CIRCLE = np.array([[0.0, 1, -1], [-1, 0, 1], [1, -1, 0]])
OPEN_SPIEL = [0.127943071, 0.371407554, 0.167436919, 0.248439608, 0.084772848]
FACTS = {"ruleset": "paper", "rules": "1", "entries": {"a": "1", "b": "2", "c": "3", "d": "4"}, "clock": {}, "secret": "0"}


def won(one: str, other: str, n_pairs: int) -> list[Outcome]:
    """Return a fixture that the first entry wins, every match of it."""
    return [met(*sorted((one, other)), pair, blue, Team.BLUE if blue == one else Team.RED, league="friday")
            for pair in range(n_pairs) for blue in (one, other)]  # fmt: skip


def circle(n_pairs: int = 6) -> list[Outcome]:
    """Return a league in which a beats b, b beats c, c beats a, and all three beat d."""
    beats = [("a", "b"), ("b", "c"), ("c", "a"), ("a", "d"), ("b", "d"), ("c", "d")]
    return [outcome for pair in beats for outcome in won(*pair, n_pairs)]


@pytest.mark.parametrize("name", METHODS)
def test_a_circle_shares_alike_and_whom_all_beat_has_nothing(name: str) -> None:
    found = share(list("abcd"), circle(), find_shares(name), n_draws=100)

    for entry in "abc":
        assert found[entry].share == pytest.approx(1 / 3, abs=0.01)
        assert name == "alpha-rank" or found[entry].low < 0.3 < 0.35 < found[entry].high
    assert found["d"].share < 0.02
    assert found["d"].high < 0.2
    assert sum(one.share for one in found.values()) == pytest.approx(1)


@pytest.mark.parametrize("name", METHODS)
def test_whom_nobody_beats_has_all_and_how_sure_that_is_grows_with_the_pairs(name: str) -> None:
    few, many = (
        share(list("abc"), [*won("a", "b", n), *won("a", "c", n), *won("b", "c", n)], find_shares(name), n_draws=100)["a"]
        for n in (1, 40)
    )

    assert few.share == pytest.approx(many.share)
    assert many.share > 0.95
    assert few.low < 0.5 < 0.9 < many.low


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 7), st.integers(0, 10_000), st.booleans())
def test_no_entry_beats_the_mixture(n: int, seed: int, is_coarse: bool) -> None:
    rng = np.random.default_rng(seed)
    payoff = rng.integers(-1, 2, size=(n, n)).astype(float) if is_coarse else rng.normal(size=(n, n))
    payoff = np.triu(payoff, 1) - np.triu(payoff, 1).T

    mixture = unbeaten_mixture(payoff)

    assert mixture.sum() == pytest.approx(1)
    assert mixture.min() >= 0
    assert (payoff @ mixture).max() <= 1e-6


@pytest.mark.parametrize("seed", [4599, 7433, 8038, 8348])
def test_a_mixture_is_found_where_payoffs_are_of_many_sizes(seed: int) -> None:
    points = np.random.default_rng(seed).standard_gamma(0.5, (30, 30))  # as a bootstrap draws fixtures that were not played
    points[0] *= 3
    payoff = (points - points.T) / np.maximum(points + points.T, 1)

    shares = unbeaten_mixture(payoff)

    assert shares.sum() == pytest.approx(1)
    assert (shares @ payoff).min() > -1e-5


def test_of_many_mixtures_it_is_the_one_of_largest_entropy() -> None:
    even_at_the_top = np.array([[0.0, 0, 1], [0, 0, 1], [-1, -1, 0]])
    two_circles = np.kron(np.eye(2), CIRCLE)  # of three each, and all even between them
    loses_to_a_loser = np.array([[0.0, 0, 0, 1], [0, 0, 0, -1], [0, 0, 0, 0], [-1, 1, 0, 0]])

    np.testing.assert_allclose(unbeaten_mixture(np.zeros((5, 5))), np.full(5, 0.2), atol=1e-6)
    np.testing.assert_allclose(unbeaten_mixture(even_at_the_top), [0.5, 0.5, 0], atol=1e-6)
    np.testing.assert_allclose(unbeaten_mixture(two_circles), np.full(6, 1 / 6), atol=1e-4)
    assert unbeaten_mixture(loses_to_a_loser) == pytest.approx([1 / 3, 1 / 3, 1 / 3, 0], abs=1e-4)


@pytest.mark.parametrize("method", [maximal_lottery, nash])
def test_an_entry_that_is_entered_twice_shares_what_it_had(method: Callable[..., np.ndarray]) -> None:
    rng = np.random.default_rng(3)
    wins = rng.integers(0, 11, size=(5, 5)).astype(float)
    points = np.triu(wins, 1) + np.tril(10 - wins.T, -1)
    twice = [0, 1, 2, 3, 4, 0]
    again = points[np.ix_(twice, twice)]
    again[0, 5] = again[5, 0] = 5

    once, both = method(points, np.full((5, 5), 10.0)), method(again, np.full((6, 6), 10.0))

    np.testing.assert_allclose([both[0] + both[5], *both[1:5]], once, atol=1e-5)


def test_alpha_rank_is_that_of_open_spiel() -> None:
    """By `open_spiel.python.egt.alpharank.compute([points - points.T], use_inf_alpha=True)` of OpenSpiel 2.0.2."""
    points = np.array([[0, 0, 1, 0, 1], [1, 0, 1, 0, 1], [0, 0, 0, 1, 1], [1, 1, 0, 0, 0], [0, 0, 0, 1, 0.0]])

    assert alpha_rank(points, np.ones((5, 5))) == pytest.approx(OPEN_SPIEL, abs=1e-8)


@pytest.mark.parametrize("name", METHODS)
def test_before_any_match_and_alone_shares_are_what_they_must_be(name: str) -> None:
    assert share(["a", "b"], [], find_shares(name), n_draws=9)["a"].share == pytest.approx(0.5)
    assert share(["a"], [], find_shares(name), n_draws=9)["a"].share == 1


@pytest.fixture
def stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Store a league, and let a package be installed that brings shares of its own."""
    found = [EntryPoint("even", f"{__name__}:even", GROUP)]
    monkeypatch.setattr(plug_ins, "entry_points", lambda group: found if group == GROUP else [])
    with Store(str(tmp_path / "arena.db")) as store:
        league = store.enter("friday", FACTS, 1)
        for outcome in circle(1):
            store.add(league, outcome)
    return tmp_path


def even(points: np.ndarray, matches: np.ndarray) -> np.ndarray:
    return np.full(len(points), 1 / len(points))


def test_a_report_shows_the_shares_that_it_is_asked_for(here: Arena, stored: Path) -> None:
    asked = ("tournament", "report", "friday", "--data", stored, "--shares", "alpha-rank", "--shares", "even")
    shown = {form: here(*asked, "--format", form).stdout for form in ("text", "md", "csv", "json", "html")}

    row = next(row for row in json.loads(shown["json"])["standings"] if row["entry"] == "d")
    assert row["shares"]["even"] == {"share": 0.25, "low": 0.25, "high": 0.25}
    assert row["shares"]["alpha-rank"]["share"] < 0.02
    assert "even,even_low,even_high" in shown["csv"].splitlines()[0]
    for form in ("text", "md", "html"):
        assert "25%, 25 to 25" in shown[form]
    assert "shares" not in here("tournament", "report", "friday", "--data", stored, "--json").stdout


def test_a_method_that_nobody_knows_is_named_with_the_nearest(here: Arena, stored: Path) -> None:
    done = here("leaderboard", "--data", stored, "--shares", "nahs")

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "arena: unknown method of shares 'nahs'; did you mean 'nash'?\n"
    assert "--shares are of leagues" in here("leaderboard", "--ladder", "--data", stored, "--shares", "nash").stderr
