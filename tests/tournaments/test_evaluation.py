"""`arena evaluate`: the same matches wherever the fighter's file lies, and one sentence for what cannot be evaluated."""

import json

import pytest
from typer.testing import CliRunner

from arena.cli import app
from arena.game.ruleset import load
from tournaments.evaluation.evaluate import evaluate

PAPER = load("paper")


def test_counts_are_from_the_fighters_side_and_repeat() -> None:
    counted = []
    runs = [
        list(evaluate(PAPER, "rush", ["random", "defend"], pairs=6, seed=3, advance=counted.append, workers=1)) for _ in range(2)
    ]

    assert runs[0] == runs[1]
    assert [name for name, _ in runs[0]] == ["random", "defend"]
    assert sum(counted) == 2 * 2 * 12
    for _, one in runs[0]:
        assert one.wins + one.draws + one.losses == 12
    assert runs[0][0][1].score > 0.5


def test_a_fighter_meets_itself() -> None:
    ((name, one),) = evaluate(PAPER, "rush", ["rush"], pairs=4, seed=3, advance=lambda _: None, workers=1)

    assert name == "rush"
    assert one.wins + one.draws + one.losses == 8


@pytest.mark.parametrize("against", ["", " , ", "candidate"])
def test_a_list_that_names_nobody_is_refused(against: str) -> None:
    done = CliRunner().invoke(app, ["evaluate", "rush", "--against", against])

    assert done.exit_code != 0
    assert "--against" in str(done.exception)


def test_json_is_one_document() -> None:
    done = CliRunner().invoke(app, ["evaluate", "rush", "--against", "random", "--pairs", "2", "--workers", "1", "--json"])

    facts = json.loads(done.stdout)
    assert facts["rules_hash"] == PAPER.hash
    assert facts["against"]["random"]["wins"] + facts["against"]["random"]["losses"] + facts["against"]["random"]["draws"] == 4
