"""Journals of many matches at once: the bytes that each has alone."""

from collections.abc import Callable

import numpy as np
import pytest

from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.policy import MatchResult
from arena.records.journal import Header, write_ending, write_start, write_tick
from arena.records.journal_batch import JournalBatch
from arena.records.plan import MatchPlan

N_STATE_BYTES = 21


@pytest.mark.parametrize("n_ticks", [1, 63, 64, 65, 200])
def test_each_match_has_the_journal_that_it_has_alone(
    n_ticks: int, small_rules: Ruleset, planned: Callable[..., MatchPlan]
) -> None:
    """Row 0 is started again meanwhile, and row 2 stays empty; names differ in length."""
    chance = np.random.default_rng(n_ticks)
    n_orders = sum(len(small_rules.team(team)) for team in Team)
    result = MatchResult(ending=Termination.TICK_LIMIT, winner=None, score=0, ticks=n_ticks)
    batch, alone = JournalBatch(small_rules, 4, N_STATE_BYTES), dict[int, tuple[bytes, bytes]]()

    def start(rows: list[int], plans: list[MatchPlan]) -> None:
        grounds = chance.integers(-1, 5, (len(rows), 64), np.int8)
        states = chance.integers(256, size=(len(rows), N_STATE_BYTES), dtype=np.uint8)
        batch.start(rows, plans, grounds, states)
        for row, plan, ground, state in zip(rows, plans, grounds, states, strict=True):
            header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=small_rules, keys=plan.keys)
            alone[row] = write_start(header, ground.tobytes(), state.tobytes())

    start([0, 1, 3], [planned("a"), planned("league/ü/1"), planned("b" * 40, "x", "y" * 30)])
    for tick in range(n_ticks):
        if tick == n_ticks // 2:
            start([0], [planned("later")])
        orders = chance.integers(0, 5, (4, n_orders), np.int8)
        marks = chance.integers(0, 3, (4, len(Team)), np.uint8)
        states = chance.integers(256, size=(4, N_STATE_BYTES), dtype=np.uint8)
        batch.add_tick(np.array([0, 1, 3]), orders, marks, states)
        for row, (data, chain) in alone.items():
            record, link = write_tick(chain, *(part[row].tobytes() for part in (orders, marks, states)))
            alone[row] = data + record, link

    whole = dict(zip([3, 0, 1], batch.finish([3, 0, 1], [result] * 3), strict=True))

    assert whole == {row: data + write_ending(chain, result) for row, (data, chain) in alone.items()}
