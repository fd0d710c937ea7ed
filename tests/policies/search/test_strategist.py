"""The fighter that plays what a network says plans are worth."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from quick import begin_games, decide, play_tick, seat

from arena.annotations import read_annotations
from arena.game.ruleset import Ruleset, load
from arena.game.state import StateField
from arena.game.types import Action, Team
from policies.heuristics.role_team import RoleTeam
from policies.networks.appraiser import Appraiser
from policies.networks.play_settings import PlaySettings
from policies.registry import load as load_fighter
from policies.search.climb import BEST, LAST
from policies.search.models import Role
from policies.search.planner import MOST_SIDE
from policies.search.plans import FROM_ROLE
from policies.search.strategist import Strategist, StrategistFactory, fresh_shape, to_frame

PAPER = load("paper")


def fond_of(deed: str, which: int | slice, temperature: float = 0.0) -> StrategistFactory:
    """Return a fighter whose network counts the living units that do something, by their "role", or their "first" steps."""
    network = Appraiser(fresh_shape(channels=8, blocks=1, patch=5, local=8, hidden=16))
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
        getattr(network, deed)[:, which, 0] = 1
        for layer in (network.team, network.mix, network.out):
            layer.weight[0, 0] = 1
    return StrategistFactory(network, PlaySettings(temperature=temperature), "fond")


def untrained(temperature: float = 0.0) -> StrategistFactory:
    torch.manual_seed(3)
    network = Appraiser(fresh_shape(channels=8, blocks=1, patch=5, local=8, hidden=16))
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    return StrategistFactory(network.eval(), PlaySettings(temperature=temperature), "untrained")


def chosen(fighter: object, of_seat: int = 0) -> NDArray[np.int8]:
    assert isinstance(fighter, Strategist)
    roles: NDArray[np.int8] = fighter.minds[of_seat].plans[0].role[BEST]
    return roles


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("role", [Role.RUSH, Role.GUARD, Role.CHASE])
def test_every_unit_takes_the_role_that_is_worth_most(team: Team, role: Role) -> None:
    games = begin_games(PAPER, [1, 2])
    fighter = seat(fond_of("role", role), PAPER, team, 2)

    decide(fighter, games.observe()[team])

    for of_seat in range(2):
        assert chosen(fighter, of_seat)[:4].tolist() == [role] * 4
        assert not set(chosen(fighter, of_seat)[4:]) & set(range(Role.SCOUT))


def test_what_is_played_is_what_the_roles_order() -> None:
    games = begin_games(PAPER, [4, 5])
    fighters = {Team.BLUE: seat(fond_of("role", Role.RUSH), PAPER, Team.BLUE, 2)}
    fighters[Team.RED] = seat(fond_of("role", Role.GUARD), PAPER, Team.RED, 2)
    blue_began, red_began = (games.observe()[team].cell[:, :4] % 20 for team in Team)
    for _ in range(12):
        play_tick(games, fighters)
    seen = games.observe()
    forward = np.sign(red_began.mean(1) - blue_began.mean(1))
    gone = (seen[Team.BLUE].cell[:, :4] % 20 - blue_began).mean(1) * forward

    assert (gone > 3).all()  # all run for the flag, wherever it is
    assert ((seen[Team.RED].cell[:, :4] % 20 - red_began).mean(1) * forward > -2).all()  # and none of these


def test_the_blueprints_own_orders_are_given_where_they_are_worth_most() -> None:
    games, blueprint = begin_games(PAPER, [6]), seat(RoleTeam, PAPER, Team.BLUE)
    fighter = seat(fond_of("first", slice(1, None)), PAPER, Team.BLUE)
    rivals = seat(RoleTeam, PAPER, Team.RED)
    for _ in range(30):
        seen = games.observe()
        orders = decide(fighter, seen[Team.BLUE])
        np.testing.assert_array_equal(orders, decide(blueprint, seen[Team.BLUE]))
        games.step(np.concatenate([orders, decide(rivals, seen[Team.RED])], axis=1))


def test_the_plan_of_the_tick_before_is_one_to_choose() -> None:
    games, fighter = begin_games(PAPER, [7]), seat(untrained(), PAPER, Team.BLUE)
    assert isinstance(fighter, Strategist)
    decide(fighter, games.observe()[Team.BLUE])
    plans = fighter.minds[0].plans[0]

    np.testing.assert_array_equal(plans.role[LAST], plans.role[BEST])
    assert (plans.first[LAST] == FROM_ROLE).all()


def test_at_a_temperature_it_plays_by_the_chance_of_its_seat_and_at_0_by_none() -> None:
    games = begin_games(PAPER, [8, 9])
    seen = games.observe()[Team.BLUE]

    def choose(temperature: float, shift: int) -> NDArray[np.int8]:
        fighter = seat(fond_of("role", Role.RUSH, temperature), PAPER, Team.BLUE, 2)
        decide(fighter, replace(seen, seed=seen.seed + np.uint64(shift)))
        return np.stack([chosen(fighter, of_seat) for of_seat in range(2)])

    np.testing.assert_array_equal(choose(50.0, 0), choose(50.0, 0))
    assert any((choose(50.0, shift) != choose(50.0, 0)).any() for shift in range(1, 4))
    np.testing.assert_array_equal(choose(0.0, 0), choose(0.0, 1))
    assert (choose(50.0, 0)[:, :4] != Role.RUSH).any()


def test_a_seat_plays_alike_alone_and_among_others() -> None:
    games = begin_games(PAPER, [10, 11, 12])
    together = seat(untrained(), PAPER, Team.RED, 3)
    alone = [seat(untrained(), PAPER, Team.RED) for _ in range(3)]
    rivals = seat(RoleTeam, PAPER, Team.BLUE, 3)
    for _ in range(8):
        seen = games.observe()
        orders = decide(together, seen[Team.RED])
        apart = [decide(fighter, seen[Team.RED].select(slice(one, one + 1)))[0] for one, fighter in enumerate(alone)]
        np.testing.assert_array_equal(orders, apart)
        games.step(np.concatenate([decide(rivals, seen[Team.BLUE]), orders], axis=1))


def test_where_no_enemy_walks_all_run_for_the_flag_whatever_the_network_says() -> None:
    ruleset = load("exp1")
    games, fighter = begin_games(ruleset, [15]), seat(fond_of("role", Role.GUARD), ruleset, Team.BLUE)
    for _ in range(ruleset.tick_limit):
        games.step(decide(fighter, games.observe()[Team.BLUE]))
        if games.is_over.all():
            break

    assert games.is_over.all()
    assert games.state.field[0, StateField.WINNER] == Team.BLUE
    assert games.state.field[0, StateField.TICK] < 3 * ruleset.side


def test_first_steps_are_turned_into_the_frame_and_back() -> None:
    first = np.array([[FROM_ROLE, Action.STAY, Action.NORTH, Action.EAST, Action.SOUTH, Action.WEST]] * 2, np.int64)
    is_turned = np.array([[True], [False]])
    framed = to_frame(first, is_turned)

    assert framed[0].tolist() == [FROM_ROLE, Action.STAY, Action.NORTH, Action.WEST, Action.SOUTH, Action.EAST]
    np.testing.assert_array_equal(framed[1], first[1])
    np.testing.assert_array_equal(to_frame(framed, is_turned), first)


def test_it_tells_what_it_thought_to_those_who_ask() -> None:
    games, fighter = begin_games(PAPER, [13]), seat(untrained(), PAPER, Team.BLUE)
    fighter.keeps_annotations = fighter.explains = True
    decide(fighter, games.observe()[Team.BLUE])
    told = read_annotations(fighter.take_annotations(0), PAPER.side)

    assert "role_team's orders" in str(told["log"])
    assert fighter.take_annotations(0) == b""


def test_on_a_board_that_is_too_large_it_plays_its_blueprint_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    ruleset: Ruleset = PAPER.with_({"side": MOST_SIDE + 2})
    games = begin_games(ruleset, [14])
    fighter, blueprint = seat(untrained(), ruleset, Team.BLUE), seat(RoleTeam, ruleset, Team.BLUE)
    seen = games.observe()[Team.BLUE]

    np.testing.assert_array_equal(decide(fighter, seen), decide(blueprint, seen))
    assert "untrained: it looks ahead on boards of up to 40 cells a side, and paper has 42; it plays the orders" in caplog.text


def test_the_champion_is_one_and_takes_the_settings_of_a_network() -> None:
    champion = load_fighter("champion:temperature=0.5,mirror=false")

    assert isinstance(champion, StrategistFactory)
    assert champion.play == PlaySettings(temperature=0.5, mirror=False)
