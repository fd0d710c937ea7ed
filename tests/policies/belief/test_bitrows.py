"""Sets of cells as rows of bits, against plain searches."""

from heapq import heappop, heappush

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from oracle import GO

from policies.belief.bitrows import UNREACHED, count, flood, has, low_bits, spread


def pack(cells: np.ndarray) -> np.ndarray:
    """Return a set as rows of bits; `cells` is bool, shape (side, side)."""
    return np.array([sum(1 << column for column in np.flatnonzero(row).tolist()) for row in cells], np.uint64)


def unpack(rows: np.ndarray, side: int) -> np.ndarray:
    return np.array([[bool(int(row) >> column & 1) for column in range(side)] for row in rows[:side]])


def neighbours(cell: tuple[int, int], side: int) -> list[tuple[int, int]]:
    around = [(cell[0] + rows, cell[1] + columns) for rows, columns in GO.values()]
    return [to for to in around if 0 <= to[0] < side and 0 <= to[1] < side]


def plain_flood(sources: np.ndarray, allowed: np.ndarray, slow: np.ndarray, delay: int) -> np.ndarray:
    steps = np.full(sources.shape, UNREACHED)
    queue = [(0, tuple(cell)) for cell in np.argwhere(sources).tolist()]
    for _, cell in queue:
        steps[cell] = 0
    while queue:
        far, cell = heappop(queue)
        for to in neighbours(cell, len(sources)):
            there = far + 1 + delay * int(slow[to])
            if allowed[to] and there < steps[to]:
                steps[to] = there
                heappush(queue, (there, to))
    return steps


sides = st.integers(2, 32).map(lambda n: 2 * n)
seeds = st.integers(0, 2**32)


@given(sides, seeds, st.sampled_from([0.0, 0.2, 0.4]), st.integers(0, 14), st.sampled_from([0.0, 0.01, 0.5]))
def test_a_flood_finds_the_quickest_ways(side: int, seed: int, walls: float, delay: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    allowed, slow = rng.random((side, side)) >= walls, rng.random((side, side)) < 0.3
    sources = rng.random((side, side)) < share
    steps = np.zeros(side * side, np.int16)

    flood(pack(sources), pack(allowed), pack(slow), delay, side, np.full((17, 64), 99, np.uint64), steps)

    np.testing.assert_array_equal(steps.reshape(side, side), plain_flood(sources, allowed, slow, delay))


@given(sides, seeds)
def test_a_set_spreads_by_a_step_where_it_may(side: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells, allowed = rng.random((side, side)) < 0.1, rng.random((side, side)) < 0.7
    rows = pack(cells)

    spread(rows, pack(allowed), side)

    expected = cells.copy()
    for cell in map(tuple, np.argwhere(cells).tolist()):
        for to in neighbours(cell, side):
            expected[to] |= allowed[to]
    np.testing.assert_array_equal(unpack(rows, side), expected)


@given(sides, seeds)
def test_a_set_knows_its_cells(side: int, seed: int) -> None:
    cells = np.random.default_rng(seed).random((side, side)) < 0.05
    rows, places = pack(cells), np.flatnonzero(cells)

    assert count(rows, side) == len(places)
    assert [bool(has(rows, side, cell)) for cell in range(side * side)] == cells.ravel().tolist()


def test_low_bits_reach_from_none_to_all() -> None:
    assert [int(low_bits(n)) for n in (0, 1, 20, 64)] == [0, 1, 2**20 - 1, 2**64 - 1]
