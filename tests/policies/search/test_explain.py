"""What a planner thought, as its author reads it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from arena.annotations import read_annotations
from policies.search.explain import Thought, WeighedPlan, explain

SIDE = 20
NAMES = ("ugv 0", "ugv 1", "uav 2")
HERE = np.zeros(SIDE**2, np.bool_)
HERE[:40] = True
"""The upper two rows are in sight."""
WORLDS = np.array([[5, 100, 200], [5, 100, 201], [5, 101, -1], [5, 120, -1]], np.int16)
"""The first enemy is seen; the second is at 100 in half of the worlds; the third has fallen in half of them."""
PLANS = [WeighedPlan(name=f"plan {number}", value=number / 10, error=0.01, n_worlds=8 + number) for number in range(9)]
THOUGHT = Thought(
    side=SIDE,
    enemies=NAMES,
    worlds=WORLDS,
    in_sight=HERE,
    flag_cells=np.array([399, 399, 399, 20], np.int16),
    models={"rush": 0.22, "role_team": 0.61, "turtle": 0.17, "random": 0.001},
    plans=PLANS,
    taken=7,
    ways={0: [380, 360, 361], 3: [399]},
    remarks=["the blueprint is to be left"],
)


def told(thought: Thought) -> dict[str, Any]:
    """Return what a reader of the transcript gets."""
    return read_annotations(explain(thought).pack(), thought.side)


def heats(notes: dict[str, Any], side: int = SIDE) -> dict[str, np.ndarray]:
    return {one["label"]: np.frombuffer(one["heat"], np.uint8).reshape(side, side) for one in notes["draw"] if "heat" in one}


def test_each_unseen_enemy_has_a_heat_map_by_the_share_of_worlds_and_one_in_sight_has_none() -> None:
    maps = heats(told(THOUGHT))

    assert list(maps) == ["ugv 1", "uav 2", "their flag"]
    assert {cell: int(heat) for cell, heat in np.ndenumerate(maps["ugv 1"]) if heat} == {(5, 0): 255, (5, 1): 128, (6, 0): 128}
    assert {cell: int(heat) for cell, heat in np.ndenumerate(maps["uav 2"]) if heat} == {(10, 0): 128, (10, 1): 128}
    assert {cell: int(heat) for cell, heat in np.ndenumerate(maps["their flag"]) if heat} == {(19, 19): 255, (1, 0): 85}


def test_the_log_tells_what_was_believed_weighed_and_taken() -> None:
    assert told(THOUGHT)["log"] == [
        "the blueprint is to be left",
        "weighed 9 plans: value, standard error, worlds; > was taken",
        "  0.800 +-0.010   16  plan 8",
        "> 0.700 +-0.010   15  plan 7",
        "  0.600 +-0.010   14  plan 6",
        "  0.500 +-0.010   13  plan 5",
        "  0.400 +-0.010   12  plan 4",
        "  0.300 +-0.010   11  plan 3",
        "they play like: role_team 0.61, rush 0.22, turtle 0.17",
        "ugv 1 (orange): 3 cells, likeliest (5, 0) with 0.50",
        "uav 2 (purple): 2 cells, likeliest (10, 0) with 0.25; alive and out of sight in 0.50 of the worlds",
        "their flag (yellow): 2 cells, likeliest (19, 19) with 0.75",
    ]


def test_the_plan_that_was_taken_is_told_however_bad_it_is() -> None:
    lines = told(replace(THOUGHT, taken=0))["log"]

    assert [line for line in lines if line.startswith(">")] == ["> 0.000 +-0.010    8  plan 0"]
    assert len(lines) == len(told(THOUGHT)["log"])


def test_ways_are_drawn_over_the_heat_with_the_unit_at_their_end() -> None:
    drawn = told(THOUGHT)["draw"]

    assert drawn[-3:] == [
        {"path": [[19, 0], [18, 0], [18, 1]], "colour": "green"},
        {"cell": [18, 1], "colour": "green", "text": "0"},
        {"cell": [19, 19], "colour": "green", "text": "3"},
    ]
    assert all("heat" in one for one in drawn[:-3])


@pytest.mark.parametrize(
    ("side", "labels"),
    [
        (20, [*(f"ugv {number}" for number in range(6)), "uav 6", "uav 7", "their flag"]),
        (32, ["every ugv", "every uav", "their flag"]),
        (48, ["every enemy", "their flag"]),
    ],
)
def test_on_a_large_board_enemies_share_a_map_which_says_so(side: int, labels: list[str]) -> None:
    rng, names = np.random.default_rng(0), [*(f"ugv {number}" for number in range(6)), "uav 6", "uav 7"]
    worlds = rng.integers(0, side**2, (64, 8)).astype(np.int16)
    ways = {unit: rng.integers(0, side**2, 30).tolist() for unit in range(8)}
    thought = replace(THOUGHT, side=side, enemies=names, worlds=worlds, ways=ways, in_sight=np.zeros(side**2, np.bool_))

    notes = told(thought)

    assert list(heats(notes, side)) == labels
    assert sum("is one map for ugv 0, ugv 1" in line for line in notes["log"]) == (side > 20)
    assert not any(line.startswith("arena:") for line in notes["log"])
    if side == 48:
        expected = np.bincount(worlds.ravel(), minlength=side**2)
        assert (heats(notes, side)["every enemy"].ravel() == np.ceil(expected / expected.max() * 255)).all()


def test_a_planner_that_knows_all_and_weighs_nothing_says_nothing() -> None:
    nothing = Thought(side=SIDE, enemies=NAMES, worlds=WORLDS, in_sight=np.ones(SIDE**2, np.bool_))

    assert explain(nothing).pack() == b""


def test_a_plan_is_weighed_by_the_mean_of_its_worlds_and_the_standard_error_of_that() -> None:
    weighed = WeighedPlan.of("wait", np.array([0.0, 1.0, 1.0, 0.0], np.float32))

    assert weighed == WeighedPlan(name="wait", value=0.5, error=0.25, n_worlds=4)
