"""What a person tells the units of a seat, on boards drawn as text."""

from collections.abc import Callable

import numpy as np
import pytest

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import load
from arena.game.types import Action, Code, Team
from clients.human.commander import Commander

WALL = """
F.......
U.#.....
U.#....f
..#....u
..#.....
........
A.......
........
"""
STAY, NORTH, EAST, SOUTH, WEST = Action


class Field:
    """A commander of blue, and the game that it is in; red stays."""

    def __init__(self, board: str) -> None:
        self.rules = load("paper").with_({"board": board})
        self.games = BatchedGame(self.rules, 1)
        self.games.start([0], [MatchKeys(map_key=bytes(32), match_key=bytes(32))])
        self.commander = Commander(self.rules, Team.BLUE)
        self.see()

    def see(self, advice: list[int] | None = None, deadline_s: float | None = None) -> None:
        self.commander.see(self.games.observe()[Team.BLUE].seat(0, self.rules), advice, deadline_s)

    def play(self) -> None:
        """End the turn, and begin the next."""
        orders = np.zeros(self.games.state.cell.shape, np.int8)
        orders[0, : self.games.n_units[Team.BLUE]] = self.commander.actions()
        self.games.play(orders)
        self.see()

    def cell(self, unit: int) -> tuple[int, int]:
        return self.commander.view_model(0.0).units[unit].cell


@pytest.fixture
def field() -> Field:
    return Field(WALL)


def test_units_stay_until_they_are_told_something(field: Field) -> None:
    assert field.commander.actions() == [STAY, STAY, STAY]
    assert [unit.order for unit in field.commander.view_model(0.0).units] == ["no order"] * 3


def test_an_order_stays_until_it_is_changed(field: Field) -> None:
    field.commander.select(1)
    assert field.commander.order(SOUTH)
    field.play()
    assert field.commander.actions() == [STAY, SOUTH, STAY]
    field.play()
    assert field.cell(1) == (4, 0)

    field.commander.order(EAST)

    assert field.commander.actions() == [STAY, EAST, STAY]


def test_a_turn_is_complete_once_every_living_unit_has_got_its_order_in_it(field: Field) -> None:
    for unit in range(3):
        assert not field.commander.is_complete
        field.commander.select(unit)
        field.commander.order(STAY)
    assert field.commander.is_complete

    field.play()

    assert not field.commander.is_complete


def test_a_fallen_unit_is_not_waited_for_nor_chosen_nor_moved(field: Field) -> None:
    field.commander.order(EAST)
    field.games.state.alive[0, 0] = 0
    field.see([1, 1, 1])

    assert field.commander.selected == 1
    assert not field.commander.select(0)
    assert field.commander.actions() == [STAY, NORTH, NORTH]
    for unit in (1, 2):
        field.commander.select(unit)
        field.commander.order(STAY)
    assert field.commander.is_complete
    assert field.commander.view_model(0.0).units[0].order == "fallen"


def test_a_unit_goes_to_the_cell_that_it_was_sent_to_round_what_it_meets_and_stays_there(field: Field) -> None:
    field.commander.select(1)
    assert field.commander.send(2, 4)
    assert field.commander.view_model(0.0).units[1].route[-1] == (2, 4)
    for _ in range(20):
        field.play()
        if field.cell(1) == (2, 4):
            break

    assert field.cell(1) == (2, 4)
    assert field.commander.tick <= 12
    assert field.commander.actions()[1] is STAY
    assert field.commander.view_model(0.0).units[1].order == "is there, stays"
    field.play()
    assert field.cell(1) == (2, 4)


def test_a_route_is_planned_anew_when_an_obstacle_comes_into_sight() -> None:
    field = Field("F.......\nU.......\n......#.\n......#.\n......#.\n......#f\nA.....#u\n........\n")
    field.commander.select(0)
    field.commander.send(4, 7)
    first = field.commander.view_model(0.0).units[0].route
    for _ in range(30):
        field.play()

    assert (len(first), field.cell(0)) == (10, (4, 7))
    assert all(field.commander.view_model(0.0).known[cell] != Code.OBSTACLE for cell in ((1, 6), (1, 7)))


def test_a_route_leads_round_own_units_that_stay_and_through_them_where_there_is_no_other() -> None:
    field = Field("FU......\n........\nU.......\n.......f\n.......u\n........\nA.......\n........\n")
    field.commander.select(0)
    field.commander.send(2, 1)
    for _ in range(3):
        field.play()
    assert field.cell(0) == (2, 1)
    field.commander.select(1)

    field.commander.send(2, 3)
    around = field.commander.view_model(0.0).units[1].route
    field.commander.select(0)
    field.commander.order(SOUTH)
    behind = field.commander.view_model(0.0).units[1].route
    field.commander.release()
    field.commander.select(1)
    field.commander.send(2, 1)

    assert ((2, 1) in around, len(around)) == (False, 5)
    assert ((2, 1) in behind, len(behind)) == (True, 3)
    assert field.commander.view_model(0.0).units[1].route == ((2, 1),)


def test_no_unit_is_sent_where_no_way_is_known(field: Field) -> None:
    assert not field.commander.send(1, 2)
    assert not field.commander.send(0, 8)
    assert not field.commander.send(-1, 0)
    assert field.commander.actions()[0] is STAY
    assert not field.commander.view_model(0.0).units[0].is_fresh


def test_a_unit_that_flies_is_sent_over_everything_as_near_as_its_step_allows(field: Field) -> None:
    field.commander.select(2)
    assert field.commander.send(2, 2)
    for _ in range(6):
        field.play()

    row, column = field.cell(2)
    assert abs(row - 2) <= 1
    assert abs(column - 2) <= 1
    assert field.commander.actions()[2] is STAY


def test_what_a_unit_may_do_is_told_with_where_it_leads_and_what_is_in_the_way(field: Field) -> None:
    field.commander.select(1)
    field.commander.order(EAST)
    field.play()

    told = {option.action: (option.to, option.is_open, option.why) for option in field.commander.view_model(0.0).options}

    assert told == {
        STAY: ((2, 1), True, ""),
        NORTH: ((1, 1), True, ""),
        EAST: ((2, 2), False, "an obstacle"),
        SOUTH: ((3, 1), True, ""),
        WEST: ((2, 0), True, ""),
    }
    assert not field.commander.order(EAST)
    field.commander.select(2)
    flies = {option.action: (option.to, option.why) for option in field.commander.view_model(0.0).options}
    assert flies[WEST] == ((6, 0), "the board ends")
    assert flies[SOUTH] == ((7, 0), "")
    assert flies[NORTH] == ((3, 0), "")


def test_the_autopilot_moves_the_units_without_orders_and_no_others(field: Field) -> None:
    field.commander.select(0)
    field.commander.order(EAST)
    field.see([3, 3, 3])
    assert field.commander.actions() == [EAST, SOUTH, SOUTH]

    field.commander.release()

    assert field.commander.actions() == [SOUTH, SOUTH, SOUTH]
    assert [unit.is_autopilot for unit in field.commander.view_model(0.0).units] == [True] * 3
    field.commander.advise(None)
    assert field.commander.actions() == [STAY, STAY, STAY]


def test_ground_that_was_seen_is_remembered_and_nothing_else_is_shown() -> None:
    field = Field("F.......\nU.......\n........\n........\n........\n.......f\n.......u\n........\n")
    before = field.commander.view_model(0.0)
    field.commander.send(7, 7)
    for _ in range(6):
        field.play()

    after = field.commander.view_model(0.0)

    gone = (before.grid != Code.HIDDEN) & (after.grid == Code.HIDDEN)
    assert gone.any()
    ground = np.where(before.grid == Code.BLUE_UGV, Code.BLUE_HALF, before.grid)
    assert (after.known[gone] == ground[gone]).all()
    assert (after.known[after.grid != Code.HIDDEN] == after.grid[after.grid != Code.HIDDEN]).all()
    assert (after.known == Code.HIDDEN).any()


def test_a_click_chooses_the_unit_that_stands_there_and_the_next_of_several() -> None:
    field = Field("F.......\nA.......\nA.......\n........\nU.......\n.......f\n.......u\n........\n")
    field.commander.select(1)
    field.commander.order(NORTH)
    field.commander.select(2)
    field.commander.order(NORTH)
    field.play()
    assert field.cell(1) == field.cell(2)
    assert field.commander.point(*field.cell(0))
    assert field.commander.selected == 0

    chosen = []
    for _ in range(3):
        field.commander.point(*field.cell(1))
        chosen.append(field.commander.selected)

    assert chosen == [1, 2, 1]
    assert field.commander.point(4, 4)
    assert field.commander.view_model(0.0).units[1].target == (4, 4)


def test_the_next_unit_that_lives_is_chosen_round_and_round(field: Field) -> None:
    field.games.state.alive[0, 1] = 0
    field.see()
    chosen = []
    for step in (1, 1, -1, -1):
        field.commander.select_next(step)
        chosen.append(field.commander.selected)

    assert chosen == [2, 0, 2, 0]


def test_the_time_left_runs_down_to_nothing(field: Field) -> None:
    field.see(deadline_s=30.0)

    assert [field.commander.view_model(now_s).time_left_s for now_s in (10.0, 29.5, 31.0)] == [20.0, 0.5, 0.0]
    field.see()
    assert field.commander.view_model(99.0).time_left_s is None


@pytest.mark.parametrize("ask", [lambda one: one.view_model(0.0), lambda one: one.view_model(9.0)])
def test_nothing_can_be_shown_before_the_first_turn(ask: Callable[[Commander], object]) -> None:
    commander = Commander(load("paper"), Team.RED)

    assert (commander.tick, commander.actions(), commander.is_complete) == (-1, [], False)
    assert not commander.select(0)
    assert not commander.order(NORTH)
    assert not commander.send(0, 0)
    with pytest.raises(ValueError, match="there was no observation yet"):
        ask(commander)
