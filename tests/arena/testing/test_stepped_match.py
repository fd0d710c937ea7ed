"""A match that is stepped by hand is a match of the real engine, and says what happens in it."""

import doctest
from collections.abc import Sequence

import numpy as np
import pytest

import arena.testing.stepped_match
from arena import Action, MatchInfo, MatchResult, Observation, Team
from arena.errors import BoardError, UnknownNameError
from arena.game.types import Termination
from arena.testing import DrawnMatch, SteppedMatch

CORRIDOR = """
    FU.f
    ....
    ....
    ...u
    """
DUEL = """
    F..f
    ..Uu
    ....
    ....
    """
MELEE = """
    F....f
    ..Uu..
    ..Uu..
    A.....
    .....a
    ......
    """


def east(observation: Observation) -> Sequence[int]:
    return [Action.EAST for _ in observation.units]


def alive(match: SteppedMatch) -> list[list[bool]]:
    return [[unit.alive for unit in match.units(team)] for team in Team]


def test_orders_move_units_and_no_orders_let_them_stay() -> None:
    match = DrawnMatch(CORRIDOR)
    match.step(red=[Action.NORTH])

    assert match.text().split() == ["FU.f", "....", "...u", "...."]
    assert (match.tick, match.ending, match.is_over, match.result) == (1, Termination.RUNNING, False, None)


def test_a_capture_ends_it_and_is_told() -> None:
    match = DrawnMatch(CORRIDOR)
    for _ in range(2):
        match.step(blue=[Action.EAST])

    assert match.result == MatchResult(ending=Termination.CAPTURE, winner=Team.BLUE, score=100, ticks=2)
    assert (match.ending, match.is_over, match.score(Team.BLUE), match.score(Team.RED)) == (Termination.CAPTURE, True, 100, -100)
    with pytest.raises(ValueError, match="ended by capture after 2 ticks"):
        match.step()


def test_a_team_is_shown_what_it_sees_and_the_text_shows_the_truth() -> None:
    match = DrawnMatch("F.........\n" + 8 * "..........\n" + "U........f\n", units={"ugv": {"sight": 1}})

    assert match.text().count("f") == 1
    assert match.text(Team.BLUE).splitlines()[-2:] == [".?????????", "U.????????"]
    assert match.observe(Team.BLUE).find_flag(Team.RED) is None
    assert match.observe(Team.BLUE).tick == 0


def test_what_lies_on_red_s_left_half_is_drawn_in_numbers() -> None:
    text = "7 1 0 6\n4 1 0 2\n1 1 0 0\n1 1 8 0"

    assert DrawnMatch(text).text() == text
    assert DrawnMatch(text, units={"ugv": {"sight": 1}}).text(Team.BLUE) == "? ? ? 6\n? ? 0 2\n? ? ? 0\n? ? ? ?"


@pytest.mark.parametrize(
    ("orders", "says"),
    [
        ({"blue": [1, 2]}, "tick 0, blue: 2 orders for 1 units"),
        ({"red": [7]}, "tick 0, red: unit 0 is ordered 7, and an order is a number from 0 to 4"),
        ({"red": "north"}, "tick 0, red: 'north' is no list of orders"),
    ],
)
def test_orders_that_are_none_are_refused_and_change_nothing(orders: dict[str, Sequence[int]], says: str) -> None:
    match = DrawnMatch(CORRIDOR)
    with pytest.raises(ValueError, match=says):
        match.step(**orders)

    assert (match.tick, match.text().split()) == (0, CORRIDOR.split())


def test_the_same_seed_is_the_same_match_and_another_seed_another() -> None:
    def play(seed: int) -> list[str]:
        match, rng, texts = SteppedMatch("paper", seed=seed), np.random.default_rng(0), []
        while not match.is_over and match.tick < 40:
            match.step(rng.integers(5, size=6), rng.integers(5, size=6))
            texts += [match.text(), str(match.observe(Team.RED).seed)]
        return texts

    assert play(1) == play(1)
    assert play(1)[0] != play(2)[0]


def test_the_seed_decides_who_falls() -> None:
    def fallen(seed: int) -> tuple[bool, bool]:
        match = DrawnMatch(DUEL, seed=seed)
        match.step()
        return not alive(match)[0][0], not alive(match)[1][0]

    assert {fallen(seed) for seed in range(40)} == {(False, False), (False, True), (True, False), (True, True)}


@pytest.mark.parametrize("falls", [{}, {Team.RED: [0, 1]}, {Team.BLUE: [1]}, {Team.BLUE: [0], Team.RED: [1]}], ids=str)
def test_who_falls_can_be_chosen(falls: dict[Team, list[int]]) -> None:
    match = DrawnMatch(MELEE)
    match.step(falls=falls)

    expected = [[number not in falls.get(team, []) for number in range(3)] for team in Team]
    assert alive(match) == expected
    assert match.tick == 1


def test_a_chosen_luck_is_of_its_tick_alone() -> None:
    """What happens in later ticks follows from the seed, however many lucks were tried; here two more fall."""
    standing = [[0, 0, 0]] * 2
    plain, chosen = DrawnMatch(MELEE, seed=2), DrawnMatch(MELEE, seed=2)
    plain.step(*standing)
    fell = {team: [number for number, lives in enumerate(alive(plain)[team]) if not lives] for team in Team}
    chosen.step(*standing, falls=fell)
    plain.step(*standing)
    for other in ({}, {Team.BLUE: [0]}, {Team.RED: [1]}):
        if other != fell:
            tried = DrawnMatch(MELEE, seed=2)
            tried.step(*standing, falls=other)
            assert (tried._games.state.key == plain._games.state.key).all()
    chosen.step(*standing)

    assert alive(chosen) == alive(plain)


def test_a_fall_that_no_luck_brings_is_refused_and_changes_nothing() -> None:
    match = DrawnMatch(MELEE)
    before = match.text()
    with pytest.raises(ValueError, match="tick 0: no luck of 10,000 lets exactly red 2 fall"):
        match.step(falls={Team.RED: [2]})  # which flies
    with pytest.raises(ValueError, match="red has no living unit 3"):
        match.step(falls={Team.RED: [3]})
    with pytest.raises(ValueError, match="lets exactly nobody fall"):
        DrawnMatch(DUEL, random_combat=False).step(falls={})

    assert (match.text(), match.tick, alive(match)) == (before, 0, [[True] * 3] * 2)


class Counter:
    """Goes east, and writes down what it is told."""

    def __init__(self) -> None:
        self.told: list[object] = []

    def start(self, info: MatchInfo) -> None:
        self.told.append(info)

    def act(self, observation: Observation) -> Sequence[int]:
        self.told.append(observation.tick)
        return east(observation)

    def end(self, result: MatchResult) -> None:
        self.told.append(result)


def test_bots_play_to_the_end_or_for_some_ticks() -> None:
    match, bot = DrawnMatch(CORRIDOR), Counter()

    assert match.play(bot, ticks=1) is None
    assert bot.told == [0]
    assert match.play(bot) == match.result
    assert bot.told == [0, 1, match.result]


def test_a_class_is_made_and_started_for_its_seat_and_hears_its_own_score() -> None:
    made: list[Counter] = []

    class Kept(Counter):
        def __init__(self) -> None:
            super().__init__()
            made.append(self)

    match = DrawnMatch(CORRIDOR)
    match.play(east, Kept)

    [bot] = made
    info, *ticks, result = bot.told
    assert info == MatchInfo(ruleset=match.ruleset, team=Team.RED)
    assert ticks == [0, 1]
    assert result == MatchResult(ending=Termination.CAPTURE, winner=Team.BLUE, score=-100, ticks=2)


def test_what_a_bot_raises_reaches_the_test() -> None:
    with pytest.raises(ZeroDivisionError):
        DrawnMatch(CORRIDOR).play(lambda _: 1 / 0)
    with pytest.raises(ValueError, match="tick 0, blue: 0 orders for 1 units"):
        DrawnMatch(CORRIDOR).play(lambda _: [])


def test_a_board_or_a_rule_that_is_none_is_refused_as_everywhere() -> None:
    with pytest.raises(BoardError, match="no red flag"):
        DrawnMatch("F..u\nU...\n..A.\na...\n")
    with pytest.raises(UnknownNameError, match="did you mean 'tick_limit'"):
        DrawnMatch(CORRIDOR, tick_limt=4)


def test_the_examples_in_the_docstrings_hold() -> None:
    done = doctest.testmod(arena.testing.stepped_match)

    assert (done.failed, done.attempted > 0) == (0, True)
