"""Judging: captures, eliminations, the tick limit and the score, on boards small enough to count by hand."""

import numpy as np
import pytest
from worlds import facts_of, lay, rules_for, settle

from arena.game.engine import BatchedGame
from arena.game.ruleset import Ruleset
from arena.game.state import StateField
from arena.game.types import Team, Termination

BLUE, RED, NOBODY = 0, 1, -1


def outcome(games: BatchedGame) -> tuple[Termination, int, int]:
    """Return how the first game ended, who won it, and blue's score."""
    facts = facts_of(games, 0)
    return Termination(facts["ending"]), facts["winner"], facts["score"]


def after(board: str, *orders: int, **overrides: object) -> tuple[Termination, int, int]:
    games = lay(rules_for(board, **overrides))
    games.step(np.array([orders], np.int8))
    return outcome(games)


@pytest.mark.parametrize(
    ("what", "board", "orders", "result"),
    [
        ("blue captures", "F . U f\n. . . .\n. . . .\nu . . .", [2, 0], (Termination.CAPTURE, BLUE, 100)),
        ("red captures", "F u . f\n. . . .\n. . . .\n. . . U", [0, 4], (Termination.CAPTURE, RED, -100)),
        ("both in one tick: a draw", "F u U f\n. . . .\n. . . .\n. . . .", [2, 4], (Termination.CAPTURE, NOBODY, 0)),
        ("a step short is no capture", "F . U f\n. . . .\n. . . .\nu . . .", [3, 0], (Termination.RUNNING, NOBODY, 0)),
        ("the own flag is no capture", "F U . f\n. . . .\n. . . .\n. . . u", [4, 0], (Termination.RUNNING, NOBODY, 0)),
        ("the last unit captures", "F . U f\n. . . .\n. . . .\n. . . .", [2], (Termination.CAPTURE, BLUE, 100)),
    ],
)
def test_captures(what: str, board: str, orders: list[int], result: tuple[Termination, int, int]) -> None:
    assert after(board, *orders, ugv={"attack": 0}) == result


def test_a_uav_above_the_flag_captures_nothing() -> None:
    board = "F . A f\n. . . .\n. . . .\nU . . u"

    assert after(board, 0, 2, 0) == (Termination.RUNNING, NOBODY, 0)


def test_who_falls_on_the_flag_has_not_captured_it() -> None:
    board = "F . U f\n. . . .\n. . . u\nU . . ."
    games = lay(rules_for(board, random_combat=False))

    games.step(np.array([[2, 0, 0]], np.int8))

    assert outcome(games) == (Termination.RUNNING, NOBODY, -10)
    assert games.state.alive[0].tolist() == [0, 1, 1]


def test_a_capture_counts_before_an_elimination() -> None:
    """Blue's last but one falls deep in red's half; in the same tick the last takes the flag that red's one left."""
    board = "F . U f\n. . . .\n. . . .\nu . U ."
    games = lay(rules_for(board, random_combat=False))
    games.state.cell[0, 1] = 13  # beside red's, on blue's half: red falls

    games.step(np.array([[2, 0, 0]], np.int8))

    assert games.state.field[0, StateField.RED_LIVING] == 0
    assert outcome(games) == (Termination.CAPTURE, BLUE, 100)


@pytest.mark.parametrize(
    ("what", "board", "orders", "result"),
    [
        ("red's last falls", "F . . f\nU u . .\n. . . .\n. . . .", [0, 0], (Termination.ELIMINATION, BLUE, 100)),
        ("blue's last falls", "F . . f\n. . U u\n. . . .\n. . . .", [0, 0], (Termination.ELIMINATION, RED, -100)),
        ("both in one tick: a draw", "F . . f\n. u U .\n. . . .\n. . . .", [0, 0], (Termination.ELIMINATION, NOBODY, 0)),
        (
            "both, unequal teams: still a draw",
            "F . . f\n. u U .\n. . U .\n. . . .",
            [0, 0, 0],
            (Termination.ELIMINATION, NOBODY, 0),
        ),
        ("UAVs alone cannot go on", "F . . f\nU u . .\n. . . a\n. A . .", [0, 0, 0, 0], (Termination.ELIMINATION, BLUE, 100)),
        ("one is left", "F . . f\nU u . .\n. . . .\n. . . u", [0, 0, 0], (Termination.RUNNING, NOBODY, 10)),
        ("a team that never had UGVs goes on", "F . . f\n. . . .\nU . . .\n. . . a", [0, 0], (Termination.RUNNING, NOBODY, 0)),
        ("two teams without UGVs go on", "F . . f\n. . . .\nA . . .\n. . . a", [0, 0], (Termination.RUNNING, NOBODY, 0)),
        ("nobody at all goes on", "F . . f\n. . . .\n. . . .\n. . . .", [], (Termination.RUNNING, NOBODY, 0)),
    ],
)
def test_eliminations(what: str, board: str, orders: list[int], result: tuple[Termination, int, int]) -> None:
    assert after(board, *orders, random_combat=False) == result


@pytest.mark.parametrize(
    ("board", "result"),
    [
        ("F . . f\nU u . .\n. . . .\n. . . u", (Termination.TICK_LIMIT, BLUE, 10)),
        ("F . . f\n. . U u\n. . . .\nU . . .", (Termination.TICK_LIMIT, RED, -10)),
        ("F . . f\nU . . u\n. . . .\n. . . .", (Termination.TICK_LIMIT, NOBODY, 0)),
        ("F . . f\nU u U u\n. . . .\nU . . u", (Termination.TICK_LIMIT, NOBODY, 0)),
    ],
)
def test_at_the_tick_limit_the_higher_score_wins(board: str, result: tuple[Termination, int, int]) -> None:
    n_units = board.lower().count("u")

    assert after(board, *[0] * n_units, random_combat=False, tick_limit=1) == result


def test_the_limit_is_the_number_of_ticks_played() -> None:
    games = lay(rules_for("F . . f\n. . . .\n. . . .\nU . . u", tick_limit=7))
    for tick in range(1, 7):
        games.step(np.zeros((1, 2), np.int8))
        assert facts_of(games, 0)["tick"] == tick
        assert not games.is_over[0]

    games.step(np.zeros((1, 2), np.int8))

    assert facts_of(games, 0)["tick"] == 7
    assert outcome(games) == (Termination.TICK_LIMIT, NOBODY, 0)


def test_a_capture_in_the_last_tick_is_a_capture() -> None:
    board = "F . U f\n. . . .\n. . . .\nu . . ."

    assert after(board, 2, 0, tick_limit=1, ugv={"attack": 0}) == (Termination.CAPTURE, BLUE, 100)


def test_the_score_stops_at_a_hundred() -> None:
    """Sixteen against sixteen: fifteen fall and nobody is eliminated."""
    unit = {"step": 1, "sight": 1, "blue": 16, "red": 16}
    rules = Ruleset(name="large", side=20).with_({"units": {"ugv": unit}})
    for fallen in range(16):
        for team in Team:
            games = BatchedGame(rules, 1)
            games.state.cell[0] = np.arange(0, 320, 10)
            games.state.field[0, [StateField.BLUE_FLAG, StateField.RED_FLAG]] = 395, 396
            games.state.alive[0] = 1
            first = 16 * team
            games.state.alive[0, first : first + fallen] = 0
            settle(games, 0, tick=0)

            games.step(np.zeros((1, 32), np.int8))

            score = min(10 * fallen, 100)
            assert outcome(games) == (Termination.RUNNING, NOBODY, -score if team is Team.BLUE else score)


def test_a_running_game_has_no_winner() -> None:
    games = lay(rules_for("F . . f\nU u . .\n. . . .\n. . . u", random_combat=False))

    games.step(np.zeros((1, 3), np.int8))

    assert outcome(games) == (Termination.RUNNING, NOBODY, 10)


def test_each_team_is_told_its_own_score_and_living() -> None:
    games = lay(rules_for("F . . f\nU u . .\n. . . .\nA . . u", random_combat=False))
    games.step(np.zeros((1, 4), np.int8))

    seen = games.observe()

    assert (seen[Team.BLUE].score[0], seen[Team.RED].score[0]) == (10, -10)
    assert seen[Team.BLUE].living[0].tolist() == [2, 1]
    assert seen[Team.RED].living[0].tolist() == [1, 2]


def test_what_a_journal_hashes_changes_with_each_fact_of_a_tick() -> None:
    """`digestible` must tell any two states apart that one tick could lead to."""
    games = lay(rules_for("F . . f\nU . . .\n. . . .\nA . . u"))
    digest = games.digestible().tobytes()
    for array, place in (
        (games.state.field, StateField.TICK),
        (games.state.field, StateField.ENDING),
        (games.state.field, StateField.SCORE),
    ):
        array[0, place] += 1
        assert games.digestible().tobytes() != digest
        array[0, place] -= 1
    for array in (games.state.cell, games.state.alive):
        for unit in range(3):
            array[0, unit] ^= 1
            assert games.digestible().tobytes() != digest
            array[0, unit] ^= 1
    assert games.digestible().tobytes() == digest
