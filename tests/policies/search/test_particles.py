"""The worlds that may be agree with all that a seat was shown, and the models that foresaw it outlive the others."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from quick import begin_games, decide, seat

from arena.game.ruleset import Ruleset, load
from arena.game.state import StateField, Trait
from arena.game.types import Code, Team
from policies.belief.bitrows import has
from policies.registry import load as load_policy
from policies.search.climb import Effort
from policies.search.mind import Mind
from policies.search.models import NAMES

N_WORLDS = 24
BARELY = Effort.of(1)
"""Plans are not the point here."""
RULES = {
    "paper": load("paper"),
    "gym-cap": load("gym-cap"),
    "crowded": load("paper").with_({"side": 16, "units": {"ugv": {"blue": 8, "red": 8}, "uav": {"blue": 0, "red": 3}}}),
    "no fog": load("paper").with_({"fog": False}),
}


def assert_agree(mind: Mind, seen: object, ruleset: Ruleset, team: Team) -> Counter[str]:
    """Hold every world against an observation and the belief that follows from it; return what there was to agree about."""
    told, belief, bench = seen.seat(0, ruleset), mind.blueprint.belief, mind.benches[0]
    state, side, first = bench.now.state, ruleset.side, len(ruleset.team(Team.BLUE))
    own, enemies = slice(None, first), slice(first, None)
    if team is Team.RED:
        own, enemies = enemies, own
    walks = bench.tables.unit[enemies, Trait.FLIES] == 0
    kinds = bench.tables.unit[enemies, Trait.TYPE]
    in_sight = Counter((unit.row * side + unit.column, unit.type) for unit in told.enemies)
    tracks = [{cell for cell in range(side**2) if has(rows, side, cell)} for rows in belief.enemy_rows[0]]
    may_stand, sight = set().union(*tracks), {cell for cell in range(side**2) if has(belief.in_sight[0], side, cell)}
    n_walkers = told.living[1] - int((~walks).sum())
    found: Counter[str] = Counter()
    for world in range(N_WORLDS):
        assert state.cell[world, own].tolist() == [unit.row * side + unit.column for unit in told.units]
        assert state.alive[world, own].tolist() == [unit.alive for unit in told.units]
        field = state.field[world]
        assert field[StateField.TICK] == told.tick
        assert field[StateField.SCORE] == told.score * (1 if team is Team.BLUE else -1)
        assert tuple(field[[StateField.BLUE_LIVING + team, StateField.RED_LIVING - team]]) == told.living
        for flag in Team:
            cell, known = int(field[StateField.BLUE_FLAG + flag]), told.find_flag(flag)
            assert known is None or divmod(cell, side) == known
            assert known is not None or cell not in sight or told.ground[divmod(cell, side)] == Code.HIDDEN
            assert has((belief.home_rows if flag is team else belief.flag_rows)[0], side, cell)
        here = Counter(
            (int(cell), ruleset.units[kind].name)
            for cell, kind, alive in zip(state.cell[world, enemies], kinds, state.alive[world, enemies], strict=True)
            if alive and int(cell) in sight
        )
        assert here == in_sight
        assert state.alive[world, enemies][walks].sum() == n_walkers
        hidden = {int(cell) for cell in state.cell[world, enemies][walks & (state.alive[world, enemies] == 1)]} - sight
        assert hidden <= may_stand
        found.update({"in sight": in_sight.total(), "hidden": len(hidden), "fallen": int(walks.sum()) - n_walkers})
    return found


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("enemy", ["rush", "role_team"])
@pytest.mark.parametrize("name", RULES)
def test_every_world_agrees_with_sight_with_the_living_and_with_the_tracks(
    name: str, enemy: str, team: Team, size: Callable[[int, int], int]
) -> None:
    ruleset, found = RULES[name], Counter[str]()
    mind = Mind(ruleset, team, N_WORLDS, n_lines=1)
    for seed in range(size(1, 20)):
        games, opponent = begin_games(ruleset, [seed]), seat(load_policy(enemy), ruleset, team.other)
        mind.start()
        while not games.is_over[0] and games.state.field[0, StateField.TICK] < 60:
            seen = games.observe()
            orders = {team: mind.act(seen[team], BARELY, None)[None], team.other: decide(opponent, seen[team.other])}
            found.update(assert_agree(mind, seen[team], ruleset, team))
            games.step(np.concatenate([orders[one] for one in Team], axis=1))

    assert found["in sight"] > 0
    assert found["hidden"] > 0 or not ruleset.fog


def shares_after(enemy: str, n_ticks: int, n_matches: int) -> np.ndarray:
    """Return the mean share of each model among the worlds, some ticks into matches against a fighter."""
    ruleset, shares = RULES["paper"], []
    mind = Mind(ruleset, Team.BLUE, n_worlds=256, n_lines=1)
    for seed in range(n_matches):
        games, opponent = begin_games(ruleset, [seed]), seat(load_policy(enemy), ruleset, Team.RED)
        mind.start()
        for _ in range(n_ticks):
            if games.is_over[0]:
                break
            seen = games.observe()
            orders = [mind.act(seen[Team.BLUE], BARELY, None)[None], decide(opponent, seen[Team.RED])]
            shares_now = np.bincount(mind.benches[0].now.model[:, Team.RED], minlength=len(NAMES)) / 256
            games.step(np.concatenate(orders, axis=1))
        shares.append(shares_now)
    return np.mean(shares, axis=0)


@pytest.mark.parametrize("alike", [("random",), ("role_team",), ("rush", "roomba", "fighter")])
def test_the_filter_finds_the_model_of_the_enemy(alike: tuple[str, ...], size: Callable[[int, int], int]) -> None:
    """Those that run for a flag once they know it are alike."""
    mine = [NAMES.index(name) for name in alike]

    shares = shares_after(alike[0], 30, size(8, 50))

    assert shares[mine].sum() > 1.5 * len(mine) / len(NAMES)
