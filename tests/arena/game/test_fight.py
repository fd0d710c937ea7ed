"""Fighting: chances that can be worked out on paper, the words behind them, and who can be hit at all."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import oracle
import pytest
from numpy.typing import NDArray
from worlds import is_near, lay, rules_for, scatter, to_match

from arena.game.engine import BatchedGame
from arena.game.ruleset import Ruleset, UnitType
from arena.game.state import StateField
from arena.game.types import Team

N = 40_000
HOME_AND_AWAY = "F . . f\n. U u .\n. . . .\n. . . ."
"""Each at home."""
AWAY = "F . . f\n. . U u\n. . . .\n. . . ."
"""Blue on red's half."""


def survivors(board: str, n: int = N, base: str = "paper", **overrides: Any) -> NDArray[np.bool_]:
    """Return who lives after one tick in which everybody stays, over many keys; shape (n, units)."""
    games = lay(rules_for(board, base, **overrides), n)
    games.step(np.zeros(games.state.cell.shape, np.int8))
    return games.state.alive.astype(bool)


@pytest.mark.parametrize(
    ("what", "board", "base", "overrides", "chances"),
    [
        ("one against one, at home", HOME_AND_AWAY, "paper", {}, [2 / 3, 2 / 3]),
        ("one against one, away", AWAY, "paper", {}, [1 / 3, 2 / 3]),
        ("one against one, diagonally", "F . . f\n. . U .\n. . . u\n. . . .", "paper", {}, [1 / 3, 2 / 3]),
        ("two against one, at home", "F . . f\n. U . .\n. U u .\n. . . .", "paper", {}, [3 / 4, 3 / 4, 1 / 2]),
        ("two against one, away", "F . . f\n. . . U\n. . u U\n. . . .", "paper", {}, [2 / 4, 2 / 4, 2 / 4]),
        ("three against one", "F . . f\n. U . .\nU U u .\n. . . .", "paper", {}, [4 / 5, 4 / 5, 4 / 5, 2 / 5]),
        ("gym-cap: alone on the enemy's half", AWAY, "gym-cap", {}, [0, 1 / 2]),
        ("gym-cap: alone at home", HOME_AND_AWAY, "gym-cap", {}, [1 / 2, 1 / 2]),
        ("gym-cap: two against one", "F . . f\n. U . .\n. U u .\n. . . .", "gym-cap", {}, [2 / 3, 2 / 3, 1 / 3]),
        ("strength counts on both sides", HOME_AND_AWAY, "paper", {"ugv": {"strength": 3}}, [4 / 7, 4 / 7]),
        ("without strength the half decides", AWAY, "paper", {"ugv": {"strength": 0}}, [0, 1]),
        ("a friend out of range does not help", "F . . f\n. . u U\n. . . .\n. . . U", "gym-cap", {}, [0, 1, 1 / 2]),
    ],
)
def test_survival(what: str, board: str, base: str, overrides: dict[str, Any], chances: Sequence[float]) -> None:
    """F / (F + E), for blue's units, then red's."""
    alive = survivors(board, base=base, **overrides)

    for share, chance in zip(alive.mean(axis=0), chances, strict=True):
        assert share == chance if chance in (0, 1) else is_near(share, chance, N)


def test_fights_of_one_tick_are_independent() -> None:
    alive = survivors(HOME_AND_AWAY)

    assert is_near((alive[:, 0] & alive[:, 1]).mean(), 4 / 9, N)
    assert is_near((~alive[:, 0] & ~alive[:, 1]).mean(), 1 / 9, N)


@pytest.mark.parametrize(
    ("board", "odds"), [(AWAY, [(1, 2), (2, 1)]), ("F . . f\n. U . .\n. U u .\n. . . .", [(3, 1), (3, 1), (2, 2)])]
)
def test_the_word_decides_exactly(board: str, odds: list[tuple[int, int]]) -> None:
    games = lay(rules_for(board), 500)
    words = [[match.word(unit, oracle.FIGHT) for unit in match.units] for match in (to_match(games, row) for row in range(500))]

    games.step(np.zeros(games.state.cell.shape, np.int8))

    expected = [[(word * (f + e)) >> 32 < f for word, (f, e) in zip(row, odds, strict=True)] for row in words]
    assert games.state.alive.astype(bool).tolist() == expected


def test_all_fights_are_judged_on_the_same_positions() -> None:
    """A unit that falls still counts: red's has two enemies in range even where one of them falls."""
    alive = survivors("F . . f\n. . U .\n. . u U\n. . . .")

    fallen = ~alive[:, 0]
    assert is_near(alive[fallen, 2].mean(), 2 / 4, int(fallen.sum()))


def test_a_tick_has_words_of_its_own_for_each_unit_and_purpose() -> None:
    games = lay(rules_for("F . . . . f\n. U . . . u\n. . . . . .\n. U . . . .\n. . . . . .\n. U . . . .", ugv={"attack": 0}))
    match = to_match(games, 0)
    words = set()
    for tick in range(20):
        match.tick = tick
        words |= {match.word(unit, purpose) for unit in match.units for purpose in (oracle.MOVE, oracle.FIGHT)}

    assert len(words) == 20 * 4 * 2


# Who is in range


def touched(board: str, base: str = "paper", **overrides: Any) -> list[bool]:
    """Whether each unit ever falls, over many keys."""
    return (~survivors(board, 2_000, base, **overrides)).any(axis=0).tolist()


@pytest.mark.parametrize(
    ("name", "board", "base", "overrides", "expected"),
    [
        ("two cells apart", "F . . f\nU . u .\n. . . .\n. . . .", "paper", {}, [True, True]),
        ("two apart, strictly nearer", "F . . f\nU . u .\n. . . .\n. . . .", "gym-cap", {}, [False, False]),
        ("a corner apart", "F . . f\n. U . .\n. . u .\n. . . .", "gym-cap", {}, [True, True]),
        ("a knight's move apart", "F . . f\n. U . .\n. . . u\n. . . .", "paper", {}, [False, False]),
        ("two corners apart", "F . . f\n. U . .\n. . . .\n. . . u", "paper", {}, [False, False]),
        ("a knight's move apart, range 3", "F . . f\n. U . .\n. . . u\n. . . .", "paper", {"ugv": {"attack": 3}}, [True, True]),
        (
            "two corners apart, nearer than 3",
            "F . . f\n. U . .\n. . . .\n. . . u",
            "gym-cap",
            {"ugv": {"attack": 3}},
            [True, True],
        ),
        ("an obstacle between", "F . . f\nU # u .\n. . . .\n. . . .", "paper", {}, [True, True]),
        ("friends alone", "F . . f\n. U . .\n. U . .\n. . . .", "paper", {}, [False, False]),
        ("no range", "F . . f\n. U u .\n. . . .\n. . . .", "paper", {"ugv": {"attack": 0}}, [False, False]),
        (
            "a UAV hits nobody",
            "F . . f\n. U a .\n. . . .\n. . . u",
            "paper",
            {"uav": {"attack": 9, "strength": 9}},
            [False, False, False],
        ),
        ("a UAV is not hit", "F . . f\n. A u .\n. . . .\nU . . .", "paper", {}, [False, False, False]),
    ],
)
def test_range(name: str, board: str, base: str, overrides: dict[str, Any], expected: list[bool]) -> None:
    assert touched(board, base, **overrides) == expected


def test_a_uav_adds_no_strength() -> None:
    alone = survivors("F . . f\n. U u .\n. . . .\n. . . .", 2_000)
    with_eyes = survivors("F . . f\nA U u a\n. . . .\n. . . .", 2_000, uav={"attack": 9, "strength": 9})

    assert (with_eyes[:, [0, 2]] == alone).all()


def test_the_attackers_range_counts_not_the_own() -> None:
    """At two cells a gun hits a fist and cannot be hit, whoever has which."""
    for blue_has_gun in (True, False):
        gun = UnitType(name="gun", step=1, sight=3, attack=2, blue=int(blue_has_gun), red=int(not blue_has_gun))
        fist = UnitType(name="fist", step=1, sight=3, attack=1, blue=int(not blue_has_gun), red=int(blue_has_gun))
        games = BatchedGame(Ruleset(name="arms", side=4, random_combat=True, units=(gun, fist)), 500)
        for row in range(games.n_games):
            scatter(games, row, np.random.default_rng(row), n_obstacles=0, fallen=0)
            games.state.cell[row] = [5, 7]

        games.step(np.zeros((500, 2), np.int8))

        assert (games.state.alive == 0).any(axis=0).tolist() == [not blue_has_gun, blue_has_gun]


# Deterministic


@pytest.mark.parametrize(
    ("board", "lives"),
    [
        (HOME_AND_AWAY, [True, True]),
        (AWAY, [False, True]),
        ("F . . f\n. u U .\n. . . .\n. . . .", [False, False]),
        ("F . . f\n. . U u\n. . U .\n. . . .", [False, False, True]),
        ("F . . f\n. . U .\n. . . .\n. U . u", [True, True, True]),
    ],
)
def test_without_chance_who_meets_an_enemy_on_its_half_falls(board: str, lives: list[bool]) -> None:
    alive = survivors(board, 100, random_combat=False)

    assert (alive == lives).all()


def test_a_flag_is_part_of_its_own_half() -> None:
    """Red stands on its own flag, at home; blue stands beside it, away."""
    rules = rules_for("F . . f\n. . . U\n. . . u\n. . . .", random_combat=False)
    games = lay(rules)
    games.state.cell[0, 1] = 3

    games.step(np.zeros((1, 2), np.int8))

    assert games.state.alive[0].tolist() == [0, 1]


def test_units_fight_where_they_have_moved_to() -> None:
    games = lay(rules_for("F . . f\nU . . u\n. . . .\n. . . .", random_combat=False))

    games.step(np.array([[2, 4]], np.int8))  # one apart now, each at home
    assert games.state.alive[0].tolist() == [1, 1]
    games.step(np.array([[0, 4]], np.int8))  # blocked: a unit's cell is taken
    assert games.state.alive[0].tolist() == [1, 1]
    games.step(np.array([[3, 4]], np.int8))  # red crosses the border into blue's half
    assert games.state.alive[0].tolist() == [1, 0]
    assert games.state.field[0, [StateField.BLUE_LIVING, StateField.RED_LIVING]].tolist() == [1, 0]
    assert games.state.field[0, StateField.WINNER] == Team.BLUE
