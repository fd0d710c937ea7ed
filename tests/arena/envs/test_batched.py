"""The batch that never stops: rows begin anew, and who is in the batch changes nothing in a row."""

import numpy as np

from arena.envs.batched import BatchedEnv
from arena.game.ruleset import load
from arena.game.types import Team, Termination

PAPER = load("paper")


def play(env: BatchedEnv, n_ticks: int) -> list[np.ndarray]:
    """Return the true states, tick by tick, of units that go where the clock says."""
    states = []
    for tick in range(n_ticks):
        states.append(env.games.digestible().copy())
        orders = np.full((env.n_games, 6), 1 + tick // 7 % 4, np.int8)
        env.step({Team.BLUE: orders, Team.RED: orders})
    return states


def test_a_row_plays_the_same_matches_in_any_batch() -> None:
    whole = play(BatchedEnv(PAPER, 6, seed=4), 230)
    part = play(BatchedEnv(PAPER, 2, seed=4, first_row=3), 230)

    for one, other in zip(whole, part, strict=True):
        np.testing.assert_array_equal(one[3:5], other)


def test_another_seed_or_row_gives_other_maps() -> None:
    one, other = BatchedEnv(PAPER, 4, seed=4), BatchedEnv(PAPER, 4, seed=5)
    boards = {state.ground.tobytes() for env in (one, other) for state in [env.games.state]}
    rows = {one.games.state.ground[row].tobytes() for row in range(4)}

    assert len(boards) == 2
    assert len(rows) == 4


def test_what_ended_is_told_and_begins_anew() -> None:
    env, ended = BatchedEnv(PAPER.with_({"tick_limit": 5}), 8, seed=1), np.zeros(8, int)
    stay = {team: np.zeros((8, 6), np.int8) for team in Team}
    for tick in range(1, 16):
        turn = env.step(stay)
        ended += turn.has_ended
        if tick % 5 == 0:
            assert (turn.ending[turn.ticks == 5] != Termination.RUNNING).all()
        assert not env.games.is_over.any()
        assert (turn.ticks[~turn.has_ended] < 5).all()
    assert (ended >= 3).all()
    assert (env.episode == ended + 1).all()
