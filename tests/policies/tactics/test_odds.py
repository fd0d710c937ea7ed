"""The odds of combat, on small boards: as `docs/reference/rules.md` counts them."""

from typing import Any

import numpy as np
import pytest

from arena.game.ruleset import load
from arena.game.types import Team
from arena.jit import jit
from policies.belief.belief import make_belief
from policies.belief.bitrows import low_bits
from policies.belief.memory import Sight
from policies.belief.team_rules import team_rules
from policies.tactics.odds import mark_danger
from policies.tactics.odds import weigh as inlined

SIDE = 20
HOME, BORDER, AWAY = 5, 9, 15
"""Columns: deep in the own half, its last one, and deep in the enemy's."""


def scene(own: list[int], enemies: list[int], rules: str = "paper") -> tuple:
    """Return what `weigh` reads of one seat of blue, whose half is the western one; cells of UGVs, as many as there are."""
    ruleset = load(rules).with_({"units": {"ugv": {"blue": len(own), "red": len(enemies)}, "uav": {"blue": 0, "red": 0}}})
    known, belief = team_rules(ruleset, Team.BLUE), make_belief(ruleset, Team.BLUE, 1)
    belief.enemy_half[0, :] = low_bits(20) & ~low_bits(10)
    n = len(enemies)
    sight = Sight(
        ground=np.zeros((1, 400), np.int8), cell=np.array([own], np.int16), alive=np.ones((1, len(own)), np.uint8),
        enemy_cell=np.array([enemies], np.int16).reshape(1, n), enemy_flies=np.zeros((1, n), np.uint8),
        enemy_type=np.zeros((1, n), np.int8), tick=np.zeros(1, np.int32), living=np.zeros((1, 2), np.int16),
        score=np.zeros(1, np.int16), seed=np.zeros(1, np.uint64),
    )  # fmt: skip
    return sight, belief, known, np.array(own, np.int64), np.zeros((len(own), 2))


@jit()
def weigh(seat: int, unit: int, cell: int, sight: Any, belief: Any, known: Any, aims: Any, force: Any) -> Any:
    """What is part of each kernel that calls it needs one to be called from here."""
    return inlined(seat, unit, cell, sight, belief, known, aims, force)


def at(row: int, column: int) -> int:
    return row * SIDE + column


@pytest.mark.parametrize(
    ("own", "enemies", "rules", "expected"),
    [
        ([at(5, HOME)], [at(5, HOME + 2)], "paper", 1 / 3),  # 2 against 1
        ([at(5, AWAY)], [at(5, AWAY + 2)], "paper", 2 / 3),  # 1 against 2
        ([at(5, HOME), at(6, HOME)], [at(5, HOME + 2)], "paper", 1 / 4),
        ([at(5, AWAY)], [at(5, AWAY + 2), at(6, AWAY)], "paper", 3 / 4),
        ([at(5, HOME)], [at(5, HOME + 3)], "paper", 0.5 / 2.5),  # it may step up, or not
        ([at(5, HOME)], [at(5, HOME + 4)], "paper", 0.0),
        ([at(5, HOME)], [at(5, HOME + 1)], "gym-cap", 1 / 2),  # the unit itself does not count
        ([at(5, BORDER)], [at(5, BORDER + 1)], "paper", 1 / 3),  # the own half ends with its own last column
    ],
)  # fmt: skip
def test_the_chance_to_fall_is_as_the_rules_count(own: list[int], enemies: list[int], rules: str, expected: float) -> None:
    sight, belief, known, aims, force = scene(own, enemies, rules)

    fall, _, _ = weigh(0, 0, own[0], sight, belief, known, aims, force)

    assert fall == pytest.approx(expected)


def test_a_friend_behind_is_worth_what_it_adds() -> None:
    own = [at(5, HOME), at(5, HOME - 2)]
    sight, belief, known, aims, force = scene(own, [at(5, HOME + 2)])
    aims[1] = at(15, HOME)
    weigh(0, 0, own[0], sight, belief, known, aims, force)

    fall, kills, averted = weigh(0, 1, own[1], sight, belief, known, aims, force)

    assert (fall, kills) == (0.0, 0.0)
    assert averted == pytest.approx(1 / 3 - 1 / 4)


def test_the_fallen_help_nobody() -> None:
    own = [at(5, HOME), at(6, HOME)]
    sight, belief, known, aims, force = scene(own, [at(5, HOME + 2)])
    sight.alive[0, 1] = 0

    assert weigh(0, 0, own[0], sight, belief, known, aims, force)[0] == pytest.approx(1 / 3)


@pytest.mark.parametrize("rules", ["paper", "gym-cap"])
@pytest.mark.parametrize("enemy", [at(5, 5), at(0, 0), at(19, 10)])
def test_danger_is_where_an_enemy_can_hit_after_a_step(rules: str, enemy: int) -> None:
    sight, _, known, _, _ = scene([at(9, 9)], [enemy], rules)
    rows = np.zeros(64, np.uint64)

    mark_danger(0, sight, known, rows)

    after = [enemy + step for step in (0, -SIDE, SIDE, -1, 1)]  # off the board too, where no cell is nearer than from on it
    reach = 4 if rules == "paper" else 3
    places = [(cell // SIDE, enemy % SIDE + step) for cell, step in zip(after, (0, 0, 0, -1, 1), strict=True)]
    places = [((enemy // SIDE) if step else row, column) for (row, column), step in zip(places, (0, 0, 0, -1, 1), strict=True)]
    for cell in range(SIDE * SIDE):
        is_near = any((cell // SIDE - row) ** 2 + (cell % SIDE - column) ** 2 <= reach for row, column in places)
        assert bool(int(rows[cell // SIDE]) >> (cell % SIDE) & 1) == is_near
