"""Rating methods of other people's packages: an entry point brings one, and every report can take it."""

import json
import subprocess
from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from outcomes import met

from arena.errors import InputError, UnknownNameError
from arena.game.types import Team
from tournaments import plug_ins
from tournaments.outcome import Outcome
from tournaments.ratings.methods import GROUP, find_method
from tournaments.ratings.rate import Rating, Ratings, rate
from tournaments.store.store import Store

Arena = Callable[..., subprocess.CompletedProcess[str]]
FACTS = {"ruleset": "paper", "rules": "1", "entries": {"a": "rush", "b": "patrol"}, "clock": {}, "secret": "0"}


def points(names: Sequence[str], outcomes: Sequence[Outcome], **_: Any) -> Ratings:
    """Rate entries by their points, and know nothing of sides, draws or chances."""
    scored = {name: sum(one.points(name) for one in outcomes if name in (one.blue, one.red)) for name in names}
    ordered = sorted(names, key=lambda name: -scored[name])
    return Ratings(
        entries={
            name: Rating(elo=scored[name], elo_low=0, elo_high=9, rank=rank, rank_low=rank, rank_high=rank)
            for rank, name in enumerate(ordered, 1)
        }
    )


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a package be installed that brings the method `points`, and one that is broken."""
    found = [EntryPoint("points", f"{__name__}:points", GROUP), EntryPoint("broken", "no_such_module:rate", GROUP)]
    monkeypatch.setattr(plug_ins, "entry_points", lambda group: found if group == GROUP else [])


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    with Store(str(tmp_path / "arena.db")) as store:
        league = store.enter("friday", FACTS, 1)
        for blue in "ab":
            store.add(league, met("a", "b", 0, blue, Team.BLUE if blue == "b" else Team.RED, league="friday"))
    return tmp_path


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("command", [("tournament", "report", "friday"), ("leaderboard",)])
def test_a_report_takes_the_method_of_an_entry_point(here: Arena, stored: Path, command: tuple[str, ...]) -> None:
    told = here(*command, "--data", stored, "--ratings", "points")
    facts = json.loads(here(*command, "--data", stored, "--ratings", "points", "--json").stdout)

    assert [(row["entry"], row["elo"], row["elo_low"], row["elo_high"]) for row in facts["standings"]] == [
        ("b", 2, 0, 9),
        ("a", 0, 0, 9),
    ]
    assert facts["rating_method"] == "points"
    assert facts["superiority"]["a"]["b"] is facts["draw_rate"] is None
    assert "+0 to +9" in told.stdout
    assert "ratings by the method points" in told.stdout


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("form", ["md", "csv", "html"])
def test_every_format_can_do_without_what_a_method_does_not_know(here: Arena, stored: Path, form: str) -> None:
    done = here("leaderboard", "--data", stored, "--ratings", "points", "--format", form)

    assert (done.returncode, done.stderr) == (0, "")
    assert "None" not in done.stdout.replace("None counted:", "")
    assert "would draw" not in done.stdout


def test_without_the_option_nothing_is_said_of_a_method(here: Arena, stored: Path) -> None:
    assert "rating_method" not in json.loads(here("leaderboard", "--data", stored, "--json").stdout)
    assert here("leaderboard", "--data", stored, "--ratings", "davidson").stdout == here("leaderboard", "--data", stored).stdout


def test_a_method_that_nobody_installed_is_named_with_the_nearest(here: Arena, stored: Path) -> None:
    done = here("leaderboard", "--data", stored, "--ratings", "davidsen")

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "arena: unknown rating method 'davidsen'; did you mean 'davidson'?\n"
    assert find_method() is rate
    with pytest.raises(UnknownNameError):
        find_method("davidsen")


@pytest.mark.usefixtures("installed")
def test_a_method_that_cannot_be_loaded_is_one_sentence() -> None:
    with pytest.raises(InputError, match="the rating method broken cannot be loaded from no_such_module:rate"):
        find_method("broken")


def old_points(names: Sequence[str], outcomes: Sequence[Outcome], *, are_maps_fresh: bool = False, n_draws: int = 1) -> Ratings:
    """Rate as a method does that was written before entries had versions."""
    return points(names, outcomes)


def test_a_method_that_knows_no_versions_rates_leagues_as_before_and_says_so_when_it_is_asked_for_them(
    here: Arena, stored: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [EntryPoint("old", f"{__name__}:old_points", GROUP)]
    monkeypatch.setattr(plug_ins, "entry_points", lambda group: found if group == GROUP else [])
    with Store(str(stored / "arena.db")) as store:
        store.add(store.get("friday"), met("a", "b.2", 0, "a", Team.BLUE, league="friday"))
    asked = ("leaderboard", "--data", stored, "--ratings", "old")

    refused = here(*asked, "--all-versions")

    assert here(*asked).returncode == 0
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "the rating method old cannot rate versions: it takes no follows" in refused.stderr


def test_a_ladder_keeps_its_own_ratings(here: Arena, stored: Path) -> None:
    done = here("leaderboard", "--ladder", "--data", stored, "--ratings", "davidson")

    assert (done.returncode, done.stdout) == (2, "")
    assert "--ratings is how leagues are rated" in done.stderr
