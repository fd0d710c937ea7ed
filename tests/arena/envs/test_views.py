"""What an environment shows is what a bot is shown, and in its own frame a team is always the blue one."""

from collections.abc import Iterator
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import data_equivalence
from hypothesis import given, reject
from hypothesis import strategies as st

from arena.envs import as_observation, as_observations, as_orders, parallel_env
from arena.errors import BoardError, InputError, UnknownNameError
from arena.game.observation import EnemyUnit, Observation
from arena.game.ruleset import Ruleset, load
from arena.game.types import Action, Code, Team
from policies.environments import make_single, make_vector

PAPER = load("paper")
STEPS = {Action.STAY: (0, 0), Action.NORTH: (-1, 0), Action.EAST: (0, 1), Action.SOUTH: (1, 0), Action.WEST: (0, -1)}


@pytest.mark.parametrize("frame", ["board", "own"])
@pytest.mark.parametrize("agents", ["teams", "units"])
@pytest.mark.parametrize("name", ["paper", "exp1", "gym-cap"])
def test_a_bot_s_observation_becomes_that_of_the_environment(name: str, agents: str, frame: str) -> None:
    env, rng, n_enemies = parallel_env(name, agents, frame=frame), np.random.default_rng(3), 0
    observations, _ = env.reset(seed=2)
    while env.agents:
        for agent, expected in observations.items():
            team, unit = env._seats[agent]
            told = env._episodes.game.observe()[team].seat(0, env.ruleset)
            assert data_equivalence(as_observation(told, name, frame=frame, unit=unit), expected, exact=True)
            n_enemies += len(told.enemies)
        observations = env.step({agent: rng.choice([1, 2, 3, 4], env.action_space(agent).shape or None) for agent in env.agents})[
            0
        ]
    assert n_enemies or name != "paper"


@pytest.mark.parametrize("team", ["blue", "red"])
def test_a_batch_of_observations_becomes_that_of_the_vector_form(team: str) -> None:
    env = make_vector(5, opponent="rush", team=team, frame="own")
    shown, rng = env.reset(seed=1)[0], np.random.default_rng(3)
    for _ in range(30):
        assert data_equivalence(as_observations(env._games.observe()[env._team], PAPER, frame="own"), shown, exact=True)
        shown = env.step(rng.integers(0, 5, (5, 6)))[0]


@st.composite
def boards(draw: st.DrawFn) -> str:
    """Draw a board on which no two units of a team stand in a row, so that turning it over keeps the units' order."""
    cells = np.full((10, 10), ".")
    free = draw(st.permutations([(row, column) for row in range(10) for column in range(10)]))
    for team in ("UUUA", "uuua"):
        used = set[int]()
        for letter in team:
            at = next(cell for cell in free if cell[0] not in used)
            used.add(at[0])
            free.remove(at)
            cells[at] = letter
    for letter, half in (("F", range(5)), ("f", range(5, 10))):
        at = next(cell for cell in free if cell[1] in half)
        free.remove(at)
        cells[at] = letter
    for at in free[: draw(st.integers(0, 8))]:
        cells[at] = "#"
    return "\n".join("".join(row) for row in cells)


def turned_over(board: str) -> str:
    """Return a board with east for west and blue for red."""
    return "\n".join(line[::-1].swapcase() for line in board.splitlines())


def without_contest(env: Any, orders: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Leave out moves to where another stands or goes: chance decides them, and knows the units by their numbers."""
    stand = env._episodes.game.state.cell[0].tolist()
    taken, kept = {divmod(cell, env.ruleset.side) for cell in stand}, {team: actions.copy() for team, actions in orders.items()}
    for number, cell in enumerate(stand):
        team, unit = ("blue", "red")[number // 4], number % 4
        down, right = STEPS[Action(int(orders[team][unit]))]
        row, column = divmod(cell, env.ruleset.side)
        target = row + down, column + (right if team == "blue" else -right)  # red's is its own frame
        if target in taken:
            kept[team][unit] = Action.STAY
        taken.add(target)
    return kept


@given(board=boards(), seed=st.integers(0, 999))
def test_in_its_own_frame_a_position_looks_the_same_from_either_side_and_orders_lead_to_positions_that_do(
    board: str, seed: int
) -> None:
    rules = PAPER.with_({"random_combat": False, "units": {"ugv": {"sight": 4}, "uav": {"sight": 5}}})
    try:
        one, other = (parallel_env(rules.with_({"board": drawn}), "teams", frame="own") for drawn in (board, turned_over(board)))
    except BoardError:
        reject()  # an obstacle cut somebody off
    seen, mirrored = one.reset(seed=1)[0], other.reset(seed=1)[0]
    rng = np.random.default_rng(seed)
    for _ in range(8):
        assert data_equivalence(seen["blue"], mirrored["red"], exact=True)
        assert data_equivalence(seen["red"], mirrored["blue"], exact=True)
        if not one.agents:
            break
        orders = without_contest(one, {team: rng.integers(0, 5, 4) for team in ("blue", "red")})
        seen, rewards, _, _, infos = one.step(orders)
        mirrored, other_rewards, *_, other_infos = other.step({"blue": orders["red"], "red": orders["blue"]})
        assert rewards == {"blue": other_rewards["red"], "red": other_rewards["blue"]}
        assert infos == other_infos
    assert one.agents == other.agents


def played(team: Team, n_ticks: int = 60) -> Iterator[Observation]:
    """Yield what a team of wanderers is shown in two matches, in one of which its half is the western one."""
    env, rng = parallel_env("paper", "teams"), np.random.default_rng(8)
    for seed in (0, 2):
        env.reset(seed=seed)
        for _ in range(n_ticks):
            yield env._episodes.game.observe()[team].seat(0, PAPER)
            if not env.agents:
                break
            env.step({agent: rng.integers(0, 5, 6) for agent in env.agents})


def seen_in_a_mirror(told: Observation) -> Observation:
    """Return an observation with east for west."""
    last = PAPER.side - 1
    return replace(
        told,
        ground=told.ground[:, ::-1],
        units=tuple(replace(unit, column=last - unit.column) for unit in told.units),
        enemies=tuple(
            sorted([replace(enemy, column=last - enemy.column) for enemy in told.enemies], key=attrgetter("row", "column"))
        ),
    )


def lies_west(told: Observation) -> bool:
    """Whether the own half is the western one, by any cell in sight."""
    row, column = np.argwhere(np.isin(told.ground, [Code.BLUE_HALF, Code.RED_HALF]))[0].tolist()
    return told.is_own_half(row, column) == (column < PAPER.side // 2)


@pytest.mark.parametrize("team", Team)
def test_in_its_own_frame_a_team_sees_and_does_the_same_whichever_half_of_the_board_is_its_own(team: Team) -> None:
    actions, found = np.arange(6) % 5, set[bool]()
    for told in played(team):
        other = seen_in_a_mirror(told)
        found.add(lies_west(told))
        shown = as_observation(told, frame="own")

        assert data_equivalence(shown, as_observation(other, frame="own"), exact=True)
        assert not (shown["grid"][:, : PAPER.side // 2] == Code.RED_HALF).any(), "the enemy is always east"
        assert not (shown["grid"][:, PAPER.side // 2 :] == Code.BLUE_HALF).any()
        east, west = ([0, 1, 2, 3, 4, 0], [0, 1, 4, 3, 2, 0])
        assert as_orders(actions, told).tolist() == (east if lies_west(told) else west)
        assert as_orders(actions, other).tolist() == (west if lies_west(told) else east)
        assert as_orders(actions[3], told) == as_orders(actions, told)[3]
        assert as_orders(actions, told, frame="board").tolist() == east
    assert found == {False, True}


def test_in_the_frame_of_the_board_the_own_half_of_either_team_lies_on_either_side() -> None:
    env, found = parallel_env("paper", "teams"), set()
    for seed in range(8):
        for team, seen in env.reset(seed=seed)[0].items():
            own = Code[f"{team.upper()}_HALF"]
            found.add((team, bool((seen["grid"][:, : PAPER.side // 2] == own).any())))
        assert (env.state() == env._episodes.game.truth(0)).all()

    assert len(found) == 4


def test_who_sees_nothing_is_shown_the_board_as_it_is() -> None:
    told = next(told for told in played(Team.RED) if not lies_west(told))
    blind = replace(told, ground=np.full_like(told.ground, Code.HIDDEN), enemies=())

    shown = as_observation(blind, frame="own")["units"]

    assert shown[:, 1].tolist() == [unit.column for unit in told.units]
    assert as_orders([2], blind).tolist() == [2]


@pytest.mark.parametrize("team", ["blue", "red"])
def test_in_the_own_frame_of_the_vector_form_each_match_is_turned_by_itself(team: str) -> None:
    envs = {frame: make_vector(8, opponent="patrol", team=team, frame=frame) for frame in ("board", "own")}
    rng, turned = np.random.default_rng(2), set[int]()
    for seed in range(3):
        plain, own = (env.reset(seed=8 * seed)[0] for env in envs.values())
        for _ in range(12):
            told = envs["board"]._games.observe()[Team[team.upper()]]
            east = [not lies_west(told.seat(row, PAPER)) for row in range(8)]
            turned.add(sum(east))
            for row in range(8):
                columns = PAPER.side - 1 - plain["units"][row, :, 1] if east[row] else plain["units"][row, :, 1]
                assert (own["units"][row, :, 1] == columns).all()
            chosen = rng.integers(0, 5, (8, 6)).astype(np.int8)
            orders = np.where(np.array(east)[:, None], np.array([0, 1, 4, 3, 2])[chosen], chosen)
            assert (as_orders(chosen, told) == orders).all()
            plain, own = envs["board"].step(orders)[0], envs["own"].step(chosen)[0]
            assert (plain["tick"] == own["tick"]).all()
    assert turned - {0, 8}, "in some batch, some were turned and others were not"


def test_one_network_plays_both_sides_of_a_single_match_alike() -> None:
    """Going east is seen and done as going east, by red as by blue."""
    for team in ("blue", "red"):
        env = make_single("patrol", team=team, frame="own")
        shown, _ = env.reset(seed=1)
        before = shown["units"][:, 1].sum()
        for _ in range(4):
            shown = env.step(np.where(shown["legal_actions"][:, Action.EAST], Action.EAST, Action.STAY))[0]
        assert shown["units"][:, 1].sum() > before


@pytest.mark.parametrize("agents", ["teams", "units"])
def test_the_layout_box_is_gymnasium_s_own_flattening(agents: str) -> None:
    rules = PAPER.with_({"tick_limit": 9})
    one, flat = parallel_env(rules, agents), parallel_env(rules, agents, layout="box")
    seen, boxes = one.reset(seed=1)[0], flat.reset(seed=1)[0]
    while one.agents:
        for agent, box in boxes.items():
            space = one.observation_space(agent)
            assert flat.observation_space(agent) == spaces.flatten_space(space)
            assert data_equivalence(box, spaces.flatten(space, seen[agent]), exact=True)
            assert data_equivalence(dict(spaces.unflatten(space, box)), dict(sorted(seen[agent].items())), exact=True)
            team, unit = one._seats[agent]
            told = one._episodes.game.observe()[team].seat(0, rules)
            assert data_equivalence(as_observation(told, rules, layout="box", unit=unit), box, exact=True)
        orders = {agent: one.action_space(agent).sample() for agent in one.agents}
        seen, boxes = one.step(orders)[0], flat.step(orders)[0]


def test_a_layout_of_another_name_is_refused() -> None:
    for make in (parallel_env, make_single, make_vector):
        with pytest.raises(UnknownNameError, match="unknown layout 'bocks'; did you mean 'box'"):
            make(layout="bocks")


def test_a_frame_of_another_name_is_refused() -> None:
    told = Observation.from_board("F..f\n.U.u\n....\n....")
    rules: Ruleset = PAPER.with_({"board": "F..f\n.U.u\n....\n...."})
    for call in (lambda: as_observation(told, rules, frame="mine"), lambda: as_orders([0], told, frame="mine")):
        with pytest.raises(UnknownNameError, match="unknown frame 'mine'"):
            call()


def test_an_observation_under_other_rules_is_refused_in_a_sentence() -> None:
    told = Observation.from_board("F..f\n.U.u\n....\n....")

    with pytest.raises(InputError, match="no team of the ruleset paper on 20 x 20 cells; pass the ruleset of its match"):
        as_observation(told)
    alone = PAPER.with_({"board": "F..f\n.U.u\n....\n...."})
    many = Observation.from_board("F..f\n.Uuu\n....\n....")
    of_another_type = replace(told, enemies=(EnemyUnit(row=1, column=3, type="tank", flies=False),))
    for strange in (many, of_another_type):
        with pytest.raises(InputError, match="no team of the ruleset paper"):
            as_observation(strange, alone)
