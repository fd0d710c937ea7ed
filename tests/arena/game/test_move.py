"""Moving, drawn as text: arrows are blue UGVs and where they want to go, U and u stay, A and a fly."""

from itertools import pairwise

import numpy as np
import oracle
import pytest
from worlds import drawing, is_near, lay, march, picture, rules_for, to_match

from arena.game.state import StateField
from arena.game.types import Team

CASES = {
    "every order goes where it says": (
        """
        F . ^ . . .
        . ^ . . > .
        . . . . . .
        . . < . v .
        . . . . . .
        . . . . . f
        """,
        """
        F U U . . .
        . . . . . U
        . . . . . .
        . U . . . .
        . . . . U .
        . . . . . f
        """,
    ),
    "nobody leaves the board": (
        """
        F ^ . .
        < . . >
        . . . .
        . v . f
        """,
        """
        F U . .
        U . . U
        . . . .
        . U . f
        """,
    ),
    "an obstacle stops": (
        """
        F v . .
        > # < .
        . ^ . .
        . . . f
        """,
        """
        F U . .
        U # U .
        . U . .
        . . . f
        """,
    ),
    "the own flag does not stop": (
        """
        F < . .
        . . . .
        . . . .
        . . . f
        """,
        """
        U . . .
        . . . .
        . . . .
        . . . f
        """,
    ),
    "two that would swap stay": (
        """
        F . . v
        > < . ^
        . . . .
        . . . f
        """,
        """
        F . . U
        U U . U
        . . . .
        . . . f
        """,
    ),
    "a unit behind a swap stays too": (
        """
        F . . .
        > > < <
        . ^ . .
        . . . f
        """,
        """
        F . . .
        U U U U
        . U . .
        . . . f
        """,
    ),
    "a chain moves": (
        """
        F . . .
        > > > .
        . . . .
        . . . f
        """,
        """
        F . . .
        . U U U
        . . . .
        . . . f
        """,
    ),
    "a chain moves whatever the order of its units": (
        """
        F . v .
        . . v .
        . . v .
        . . . f
        """,
        """
        F . . .
        . . U .
        . . U .
        . . U f
        """,
    ),
    "a chain behind a unit that stays, stays": (
        """
        F . . .
        > > > U
        . . . .
        . . . f
        """,
        """
        F . . .
        U U U U
        . . . .
        . . . f
        """,
    ),
    "a chain behind an enemy that stays, stays": (
        """
        F . . .
        > > > u
        . . . .
        . . . f
        """,
        """
        F . . .
        U U U u
        . . . .
        . . . f
        """,
    ),
    "a chain into the border stays": (
        """
        F . . .
        . > > >
        . . . .
        . . . f
        """,
        """
        F . . .
        . U U U
        . . . .
        . . . f
        """,
    ),
    "a rotation moves": (
        """
        F . . .
        . > v .
        . ^ < .
        U . . f
        """,
        """
        F . . .
        . U U .
        . U U .
        U . . f
        """,
    ),
    "a rotation of eight moves": (
        """
        F . . . . .
        . > > v . .
        . ^ # v . .
        . ^ < < . .
        . . . . . .
        . . . . . f
        """,
        """
        F . . . . .
        . U U U . .
        . U # U . .
        . U U U . .
        . . . . . .
        . . . . . f
        """,
    ),
    "a broken rotation stands still": (
        """
        F . . .
        . > v .
        . ^ U .
        . . . f
        """,
        """
        F . . .
        . U U .
        . U U .
        . . . f
        """,
    ),
    "a unit may enter the cell that another leaves": (
        """
        F . ^ .
        . > ^ .
        . . . .
        . . . f
        """,
        """
        F . U .
        . U U .
        . . . .
        . . . f
        """,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_walking(name: str) -> None:
    before, after = CASES[name]

    _, [picture_after] = march(before)

    assert picture_after == drawing(after)


def test_a_rotation_turns_each_unit_by_one_place() -> None:
    games, _ = march(CASES["a rotation moves"][0])

    assert [divmod(int(cell), 4) for cell in games.state.cell[0]] == [(1, 2), (2, 2), (1, 1), (2, 1), (3, 0)]


def test_three_that_claim_one_cell_win_a_third_of_the_time_each() -> None:
    n = 30_000
    games, _ = march("F v . .\n> . < .\n. . . .\n. . . f", n_games=n)
    arrived = games.state.cell == 5

    assert (arrived.sum(axis=1) == 1).all()
    assert all(is_near(share, 1 / 3, n) for share in arrived.mean(axis=0))


def test_four_that_claim_one_cell_win_a_quarter_of_the_time_each() -> None:
    n = 30_000
    games, _ = march("F v . .\n> . < .\n. ^ . .\n. . . f", n_games=n)
    arrived = games.state.cell == 5

    assert (arrived.sum(axis=1) == 1).all()
    assert all(is_near(share, 1 / 4, n) for share in arrived.mean(axis=0))


def test_the_largest_word_wins_the_cell() -> None:
    games, _ = march("F v . .\n> . < .\n. . . .\n. . . f", n_games=200)
    for row in range(games.n_games):
        match = to_match(games, row)
        match.tick = 0
        words = [match.word(unit, oracle.MOVE) for unit in match.units]
        assert games.state.cell[row].tolist().index(5) == words.index(max(words))


def test_the_losers_of_a_cell_hold_up_those_behind_them() -> None:
    _, pictures = march("F . . .\n> > . <\n. . . .\n. . . f", n_games=300)

    assert set(pictures) == {drawing("F . . .\n. U U U\n. . . .\n. . . f"), drawing("F . . .\nU U U .\n. . . .\n. . . f")}


def test_who_would_swap_is_decided_before_who_gets_the_cell() -> None:
    """The middle two would swap, so the unit above must not enter either cell, whatever its word."""
    _, pictures = march("F v . .\n. > < .\n. . . .\n. . . f", n_games=100)

    assert set(pictures) == {drawing("F U . .\n. U U .\n. . . .\n. . . f")}


def test_a_cell_that_its_holder_leaves_is_claimed_like_any_other() -> None:
    _, pictures = march("F v . .\n> > . .\n. ^ . .\n. . . f", n_games=300)

    assert set(pictures) == {
        drawing("F . . .\nU U U .\n. U . .\n. . . f"),
        drawing("F U . .\n. U U .\n. U . .\n. . . f"),
        drawing("F U . .\nU U U .\n. . . .\n. . . f"),
    }


def test_no_team_moves_first() -> None:
    n = 20_000
    games = lay(rules_for("F . . .\nU . u .\n. . . .\n. . . f", ugv={"attack": 0}), n)

    games.step(np.tile(np.array([2, 4], np.int8), (n, 1)))

    arrived = games.state.cell == 5
    assert (arrived.sum(axis=1) == 1).all()
    assert is_near(arrived[:, Team.BLUE].mean(), 1 / 2, n)


def test_a_tie_goes_to_the_lower_index() -> None:
    """The same key for both teams gives the first unit of each the same word."""
    games = lay(rules_for("F . . .\nu . U .\n. . . .\n. . . f", ugv={"attack": 0}), 50)
    games.state.key[:, oracle.MOVE, Team.RED] = games.state.key[:, oracle.MOVE, Team.BLUE]

    games.step(np.tile(np.array([4, 2], np.int8), (50, 1)))

    assert (games.state.cell == [5, 4]).all()


def test_words_are_drawn_anew_at_each_tick() -> None:
    """Where one word decided for good, the same unit would win the cell at each of ten ticks."""
    games = lay(rules_for("F . . .\nU . U .\n. . . .\n. . . f", ugv={"attack": 0}), 500)
    winners = []
    for tick in range(10):
        games.state.cell[:] = [4, 6]
        games.state.field[:, StateField.TICK] = tick
        games.step(np.tile(np.array([2, 4], np.int8), (500, 1)))
        winners.append(games.state.cell[:, 0] == 5)

    assert is_near(np.mean(winners), 1 / 2, 5_000)
    assert all(is_near((one == other).mean(), 1 / 2, 500) for one, other in pairwise(winners))


def test_a_fallen_unit_neither_moves_nor_blocks_nor_claims() -> None:
    games = lay(rules_for("F . . .\nU U U .\n. . . .\n. . . f"))
    games.state.alive[0] = [1, 0, 1]

    games.step(np.array([[2, 2, 4]], np.int8))

    assert games.state.cell[0, 1] == 5
    assert sorted(games.state.cell[0, [0, 2]].tolist()) in ([4, 5], [5, 6])


def test_a_walker_that_takes_no_steps_blocks_and_is_not_moved() -> None:
    games = lay(rules_for("F . . .\nU . . .\n. . . .\n. . . f", ugv={"step": 0}))

    games.step(np.array([[2]], np.int8))

    assert picture(games) == drawing("F . . .\nU . . .\n. . . .\n. . . f")


@pytest.mark.parametrize("order", [-128, -1, 5, 6, 100, 127])
def test_an_order_that_is_none_means_to_stay(order: int) -> None:
    games = lay(rules_for("F . . .\nU . A .\n. . . .\n. . . f"))

    games.step(np.array([[order, order]], np.int8))

    assert picture(games) == drawing("F . . .\nU . A .\n. . . .\n. . . f")


# In the air

SKY = """
    F . . . . . . .
    . . . . . . . .
    . . # # . . . .
    . A # # U . . .
    . . . . . . . .
    . . . . . . . .
    . . . . . . . .
    U . . . . . . f
    """


@pytest.mark.parametrize(
    ("action", "places"),
    [
        (0, [(3, 1), (3, 1), (3, 1)]),
        (1, [(0, 1), (0, 1), (0, 1)]),
        (2, [(3, 4), (3, 7), (3, 7)]),
        (3, [(6, 1), (7, 1), (7, 1)]),
        (4, [(3, 0), (3, 0), (3, 0)]),
    ],
)
def test_a_uav_goes_three_cells_over_everything_and_stops_at_the_border(action: int, places: list[tuple[int, int]]) -> None:
    games = lay(rules_for(SKY))
    uav = 2
    went = []
    for _ in places:
        games.step(np.array([[0, 0, action]], np.int8))
        went.append(divmod(int(games.state.cell[0, uav]), 8))

    assert went == places


def test_uavs_share_a_cell_pass_through_each_other_and_stop_nobody() -> None:
    games = lay(rules_for("F . . . . .\nA . . a . .\nU . . . . .\nA . . . . .\n. . . . . .\n. . . . . f", ugv={"attack": 0}))

    games.step(np.array([[1, 2, 2, 4]], np.int8))  # the walker goes under where the first flew; the first and red's swap

    assert picture(games) == drawing("F . . . . .\nU . . A . .\n. . . . . .\n. . . A . .\n. . . . . .\n. . . . . f")
    games.state.cell[0, 1] = games.state.cell[0, 2]
    games.step(np.array([[0, 1, 1, 0]], np.int8))
    assert games.state.cell[0, 1] == games.state.cell[0, 2] == 3


def test_a_walker_enters_a_cell_below_a_uav() -> None:
    _, [after] = march("F . . .\n> A . .\n. . . .\n. . . f")

    assert after == drawing("F . . .\n. U . .\n. . . .\n. . . f")
