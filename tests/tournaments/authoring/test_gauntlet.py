"""`arena gauntlet`: a bot meets the shipped fighters on the same maps each time, and hears what has changed."""

import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from arena.errors import InputError, UnknownNameError
from arena.game.types import Team
from arena.records.journal_folder import load_journal
from policies.registry import REFERENCES, SCRIPTS, shipped
from tournaments.authoring.gauntlet import find_opponents, name_bot
from tournaments.authoring.turn_times import TurnTimes

Run = Callable[..., subprocess.CompletedProcess[str]]
STAY = "def act(observation):\n    return [0 for _ in observation.units]\n"
TO_THE_FLAG = """
def act(observation):
    row, column = observation.find_flag(observation.team.other)
    def step(unit):
        return 1 if unit.row > row else 3 if unit.row < row else 2 if unit.column < column else 4
    return [step(unit) for unit in observation.units]
"""
SMALL = ("--workers", 1, "--set", "side=10", "--set", "tick_limit=30")


@pytest.fixture
def bot(tmp_path: Path) -> Path:
    path = tmp_path / "mybot.py"
    path.write_text(STAY)
    return path


@pytest.fixture
def run(here: Run, bot: Path, tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """Run a small gauntlet of the bot, and return what it prints as JSON."""

    def play(*arguments: object, against: str = "rush,patrol") -> dict[str, Any]:
        done = here("gauntlet", bot, "--against", against, "--data", tmp_path / "data", *SMALL, *arguments, "--json")
        assert done.returncode == 0, done.stderr
        document: dict[str, Any] = json.loads(done.stdout)
        return document

    return play


def test_a_bot_that_leaves_its_folder_is_found_and_its_run_is_kept(
    here: Run, bot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    bot.write_text(f"import os\nos.chdir('/')\n{STAY}")

    done = here("gauntlet", bot.name, "--against", "rush", "--data", "data", "--pairs", 1, *SMALL)

    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "data").rglob("*.journal"))) == 2


def test_every_opponent_is_met_and_the_hardest_stands_first(run: Callable[..., dict[str, Any]]) -> None:
    begun_s = time.perf_counter()
    found = run("--pairs", 3)
    took_ms = 1000 * (time.perf_counter() - begun_s)

    assert (found["name"], found["seed"], found["pairs"], found["left_out"], found["since"]) == ("mybot", 1, 3, [], None)
    assert {one["opponent"] for one in found["opponents"]} == {"rush", "patrol"}
    assert [one["score"] for one in found["opponents"]] == sorted(one["score"] for one in found["opponents"])
    for one in found["opponents"]:
        assert one["wins"] + one["draws"] + one["losses"] == sum(one["endings"].values()) == 6
        assert len(one["pairs"]) == 3
        assert sum(one["pairs"]) / 6 == pytest.approx(one["score"])
        assert 0 < one["turns"]["median_ms"] <= one["turns"]["p99_ms"] <= one["turns"]["worst_ms"] < took_ms
        assert (one["faults"]["raised"], one["change"]) == (0, None)


def test_the_worst_map_is_a_journal_of_a_match_that_was_lost(run: Callable[..., dict[str, Any]], here: Run) -> None:
    found = run("--pairs", 4)
    rush = next(one for one in found["opponents"] if one["opponent"] == "rush")

    journal = load_journal(Path(rush["worst_map"]["journal"]))
    assert rush["worst_map"]["points"] == min(rush["pairs"]) == rush["pairs"][rush["worst_map"]["pair"]]
    assert f"/{rush['worst_map']['pair']:04}/" in journal.header.identity
    assert journal.ending is not None
    assert (journal.header.blue, journal.header.red)[journal.ending.winner or Team.BLUE] == "rush"
    assert len(list(Path(found["journals"]).iterdir())) == 16
    assert here("replay", "verify", "--local", found["journals"]).returncode == 0


def test_who_lost_nothing_has_no_worst_map(run: Callable[..., dict[str, Any]], bot: Path) -> None:
    [found] = run("--pairs", 1, "--set", "tick_limit=1", against="patrol")["opponents"]

    assert (found["draws"], found["worst_map"]) == (2, None)


def test_an_unchanged_bot_has_not_changed_and_its_maps_are_the_same(run: Callable[..., dict[str, Any]]) -> None:
    first, again = run("--pairs", 3), run("--pairs", 4, against="rush,squad")

    then, now = ({one["opponent"]: one for one in found["opponents"]} for found in (first, again))
    assert now["rush"]["pairs"][:3] == then["rush"]["pairs"]
    assert now["rush"]["change"] == {
        "score_before": then["rush"]["score"], "score": then["rush"]["score"], "n_pairs": 3, "p_value": 1.0, "verdict": "same"
    }  # fmt: skip
    assert now["squad"]["change"] is None
    assert again["since"]["run"] == "run-0001"
    assert again["since"]["is_same_file"]
    assert again["since"]["overall"] == now["rush"]["change"]


def test_a_better_version_is_told_from_noise(run: Callable[..., dict[str, Any]], bot: Path, here: Run, tmp_path: Path) -> None:
    plain = "--set", "fog=false", "--set", "obstacles=false"
    before = run("--pairs", 8, *plain, against="patrol")
    bot.write_text(TO_THE_FLAG)
    after = run("--pairs", 8, *plain, against="patrol")

    [then], [now] = before["opponents"], after["opponents"]
    assert then["score"] < now["score"]
    assert now["change"]["verdict"] == after["since"]["overall"]["verdict"] == "better"
    assert now["change"]["p_value"] < 0.05
    assert not after["since"]["is_same_file"]
    said = here("gauntlet", bot, "--against", "patrol", "--data", tmp_path / "data", *SMALL, *plain, "--pairs", 2).stdout
    assert "since run-0002, the same file: mybot scores" in said
    assert "no more than noise (p 1.000)" in said


@pytest.mark.parametrize("change", [("--seed", 2), ("--set", "tick_limit=29")], ids=str)
def test_other_maps_or_rules_are_not_compared(run: Callable[..., dict[str, Any]], change: tuple[object, ...]) -> None:
    first, other = run("--pairs", 1), run("--pairs", 1, *change)

    assert (first["since"], other["since"]) == (None, None)


def test_the_table_says_what_happened(here: Run, bot: Path, tmp_path: Path) -> None:
    bot.write_text("def act(observation):\n    return observation.flag\n")
    done = here("gauntlet", bot, "--against", "rush", "--pairs", 2, "--data", tmp_path / "data", *SMALL)

    [row] = [line.split() for line in done.stdout.splitlines() if line.strip().startswith("rush")]
    assert row[:2] == ["rush", "0.000"]
    assert "there is no earlier run to compare with" in done.stdout
    assert "worst map against rush: pair " in done.stdout
    assert f"arena replay show {tmp_path}" in done.stdout
    assert "has no attribute 'flag'" in done.stdout
    assert "mybot first failed like this:\nTraceback" in done.stderr


def test_all_shipped_fighters_are_met_the_bot_the_cheats_and_the_slower_planners_apart() -> None:
    opponents, left_out = find_opponents("rush", None)

    assert opponents == [name for name in (*SCRIPTS, "planner-fast", *shipped()) if name != "rush"]
    assert not set(opponents) & set(REFERENCES)
    assert left_out == []


def test_a_network_that_cannot_be_loaded_here_is_left_out_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def load(name: str) -> None:
        if name in shipped():
            raise InputError(f"the fighter {name} needs torch, which is not installed here")

    monkeypatch.setattr("tournaments.authoring.gauntlet.load", load)
    opponents, left_out = find_opponents("mybot.py", None)

    assert opponents == [*SCRIPTS, "planner-fast"]
    assert left_out == [f"without {name}: the fighter {name} needs torch, which is not installed here" for name in shipped()]


def test_opponents_that_are_none_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'rush'"):
        find_opponents("mybot.py", ["patrol,rsh"])
    with pytest.raises(InputError, match="it must name fighters"):
        find_opponents("mybot.py", [" , "])
    with pytest.raises(InputError, match="unknown policy 'oracle_rush'"):
        find_opponents("mybot.py", ["oracle_rush"])


def test_a_bot_is_called_as_its_file_or_its_folder_and_as_no_opponent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "tiger"
    folder.mkdir()
    for file in ("bot", "bot.js", "bot.py"):
        (folder / file).touch()
    monkeypatch.chdir(folder)

    assert name_bot("some/mybot.py", ["rush"]) == "mybot"
    assert {name_bot(spec, ["rush"]) for spec in (str(folder / "bot.py"), "exec:./bot", "exec:node bot.js")} == {"tiger"}
    assert name_bot("rush.py", ["rush"]) == "rush-2"


def test_the_times_of_turns_are_their_median_99th_percentile_and_worst() -> None:
    times = TurnTimes.of([number / 1000 for number in range(1, 101)])

    assert (times.median_ms, times.worst_ms) == (50.5, 100)
    assert 99 <= times.p99_ms < 100
    assert TurnTimes.of([0.002]) == TurnTimes(median_ms=2, p99_ms=2, worst_ms=2)
