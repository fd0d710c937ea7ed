"""Finding ways: shortest ones against a plain search, and keeping a hand on obstacles on boards drawn as text."""

from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import GO

from arena.game.types import Action, Code
from policies.belief.bitrows import UNREACHED
from policies.tactics.moves import head_for
from policies.tactics.paths import downhill, flood


def plain_search(ground: np.ndarray, goal: tuple[int, int]) -> np.ndarray:
    steps = np.full(ground.shape, UNREACHED)
    steps[goal] = 0
    queue = deque([goal])
    while queue:
        row, column = queue.popleft()
        for rows, columns in GO.values():
            to = row + rows, column + columns
            on_board = 0 <= to[0] < len(ground) and 0 <= to[1] < len(ground)
            if on_board and ground[to] != Code.OBSTACLE and steps[to] == UNREACHED:
                steps[to] = steps[row, column] + 1
                queue.append(to)
    return steps


@settings(deadline=None)
@given(st.integers(2, 32).map(lambda n: 2 * n), st.integers(0, 2**32), st.sampled_from([0.0, 0.2, 0.4]))
def test_a_flood_counts_the_steps_of_the_shortest_way(side: int, seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    codes = rng.choice([Code.OBSTACLE, Code.HIDDEN, Code.RED_HALF], (2, side * side), p=[share, 0.5, 0.5 - share])
    ground = codes.astype(np.int8)
    goal = int(rng.integers(side * side))
    ground[1, goal] = Code.RED_FLAG
    steps, work = np.zeros((2, side * side), np.int16), np.full((19, 64), 99, np.uint64)

    flood(ground, 1, side, goal, steps, work)

    expected = plain_search(ground[1].reshape(side, side), divmod(goal, side))
    np.testing.assert_array_equal(steps[1].reshape(side, side), expected)
    assert not steps[0].any()
    row, column = rng.integers(side, size=2).tolist()
    action = downhill(ground, 1, side, row * side + column, steps)
    rows, columns = GO.get(action, (0, 0))
    if ground[1, row * side + column] != Code.OBSTACLE and 0 < expected[row, column] < UNREACHED:
        assert expected[row + rows, column + columns] == expected[row, column] - 1


BOARDS = {
    "open": """
        ........
        .a......
        ........
        ........
        ........
        ......b.
        ........
        ........""",
    "wall": """
        ........
        ...#....
        ...#....
        .a.#..b.
        ...#....
        ...#....
        ...#....
        ........""",
    "pocket": """
        ........
        ........
        ..###...
        ....#...
        .a..#.b.
        ....#...
        ..###...
        ........""",
    "wall to the border": """
        ...#....
        ...#....
        ...#....
        .a.#..b.
        ...#....
        ...#....
        ...#....
        ........""",
    "thick": """
        ........
        ........
        ..####..
        ..####..
        .a####b.
        ..####..
        ..####..
        ........""",
}


@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("word", [1 << 31, (1 << 31) + 1])
def test_a_unit_finds_its_way_round_what_is_in_its_way(name: str, word: int) -> None:
    cells = np.array([list(line.strip()) for line in BOARDS[name].split()])
    ground = np.where(cells == "#", Code.OBSTACLE, Code.BLUE_HALF).astype(np.int8).reshape(1, 64)
    cell, goal = int(np.flatnonzero(cells == "a")[0]), int(np.flatnonzero(cells == "b")[0])
    detour = 0

    for _ in range(40):
        action, detour = head_for(ground, 0, 8, cell // 8, cell % 8, goal, np.uint8(0), 1, detour, np.uint64(word))
        rows, columns = GO.get(action, (0, 0))
        cell += rows * 8 + columns
        assert ground[0, cell] != Code.OBSTACLE

    assert cell == goal


def test_a_unit_that_flies_far_stops_where_it_cannot_come_nearer() -> None:
    ground = np.full((1, 64), Code.OBSTACLE, np.int8)

    assert head_for(ground, 0, 8, 3, 3, 4 * 8 + 2, np.uint8(1), 3, 0, np.uint64(0)) == (Action.STAY, 0)
    assert head_for(ground, 0, 8, 3, 3, 5 * 8 + 2, np.uint8(1), 3, 0, np.uint64(0)) == (Action.SOUTH, 0)
