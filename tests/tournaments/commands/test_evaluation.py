"""`arena evaluate`: the same matches wherever the fighter's file lies, and one sentence for what cannot be evaluated."""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import pytest
from typer.testing import CliRunner

from arena.game.ruleset import Ruleset, load
from arena.local.venue import Load, MatchRecord, play
from arena.records.plan import MatchPlan
from tournaments.cli import app
from tournaments.evaluation.evaluate import evaluate
from tournaments.evaluation.solo import play_alone, shortest_ways
from tournaments.fixture import plan_fixture

PAPER = load("paper")


def test_counts_are_from_the_fighters_side_and_repeat() -> None:
    counted = []
    runs = [
        evaluate(PAPER, "rush", ["random", "defend"], pairs=6, seed=3, advance=counted.append, workers=workers)
        for workers in (1, 2)
    ]

    assert runs[0] == runs[1]
    assert list(runs[0]) == ["random", "defend"]
    assert sum(counted) == 2 * 2 * 12
    for one in runs[0].values():
        assert one.wins + one.draws + one.losses == 12
    assert runs[0]["random"].score > 0.5


def test_processes_are_started_once_for_all_opponents(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []

    def count(ruleset: Ruleset, plans: Sequence[MatchPlan], load: Load, **options: Any) -> Iterator[MatchRecord]:
        calls.append(len(plans))
        return play(ruleset, plans, load, **options)

    monkeypatch.setattr("tournaments.evaluation.evaluate.play", count)
    evaluate(PAPER, "rush", ["random", "defend", "patrol"], pairs=2, seed=3, advance=lambda _: None, workers=1)

    assert calls == [3 * 4]


def test_a_fighter_meets_itself() -> None:
    ((name, one),) = evaluate(PAPER, "rush", ["rush"], pairs=4, seed=3, advance=lambda _: None, workers=1).items()

    assert name == "rush"
    assert one.wins + one.draws + one.losses == 8


def test_alone_a_fighter_that_knows_the_way_takes_nearly_the_shortest() -> None:
    exp1 = load("exp1")
    one = play_alone(exp1, "rush", matches=40, seed=3, advance=lambda _: None, workers=1)
    lost = play_alone(exp1, "random", matches=40, seed=3, advance=lambda _: None, workers=1)

    assert one.captures == 40
    assert 1.0 <= one.detour < 1.1
    assert lost.shortest == one.shortest
    assert lost.detour > 2
    assert lost.captures < 20


BOARD = """
........
.F..##.f
.U..##..
........
........
........
........
U.......
"""


def test_the_shortest_way_goes_round_obstacles_from_whoever_is_nearest() -> None:
    ruleset = load("exp1").with_({"side": 8, "board": BOARD, "units": {"ugv": {"blue": 2}}})
    plans = plan_fixture("evaluation", "one", "other", 3, bytes(32))

    assert shortest_ways(ruleset, plans) == [9] * 6


@pytest.mark.parametrize("against", ["", " , ", "candidate"])
def test_a_list_that_names_nobody_is_refused(against: str) -> None:
    done = CliRunner().invoke(app, ["evaluate", "rush", "--against", against])

    assert done.exit_code != 0
    assert "--against" in str(done.exception)


def test_opponents_are_named_by_one_option_or_by_several() -> None:
    named = ("--against", "random,patrol", "--against", "planner:budget=40,hold=12")
    done = CliRunner().invoke(app, ["evaluate", "rush", *named, "--pairs", "2", "--workers", "1", "--json"])

    assert list(json.loads(done.stdout)["against"]) == ["random", "patrol", "planner:budget=40,hold=12"]


def test_json_is_one_document() -> None:
    done = CliRunner().invoke(app, ["evaluate", "rush", "--against", "random", "--pairs", "2", "--workers", "1", "--json"])

    facts = json.loads(done.stdout)
    assert facts["rules_hash"] == PAPER.hash
    assert facts["against"]["random"]["wins"] + facts["against"]["random"]["losses"] + facts["against"]["random"]["draws"] == 4


def test_alone_is_a_table_and_json_too() -> None:
    order = ["evaluate", "rush", "--rules", "exp1", "--pairs", "4", "--workers", "1"]
    table = CliRunner().invoke(app, order).stdout
    facts = json.loads(CliRunner().invoke(app, [*order, "--json"]).stdout)

    assert "4 matches alone, rules exp1" in table
    assert facts["alone"]["captures"] == 4
    assert facts["alone"]["detour"] == facts["alone"]["ticks"] / facts["alone"]["shortest"]


@pytest.mark.parametrize("change", ["units.ugv.blue=0", "units.ugv.step=0"])
def test_alone_needs_somebody_who_walks(change: str) -> None:
    done = CliRunner().invoke(app, ["evaluate", "rush", "--rules", "exp1", "--pairs", "2", "--set", change])

    assert "nobody could take the flag" in str(done.exception)
