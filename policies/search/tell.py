"""What a mind thought about a tick, put as `explain` takes it."""

import numpy as np
from numpy.typing import NDArray

from arena.game.ruleset import Ruleset
from arena.game.state import StateField
from arena.game.types import Action, Team
from policies.belief.belief import Belief
from policies.search.climb import BEST, BLUEPRINT, PRESETS, TRIALS
from policies.search.explain import Thought, WeighedPlan
from policies.search.models import NAMES, Role, shares_of_models
from policies.search.plans import Plans
from policies.search.playout import Bench
from policies.search.worlds import units_of


def thought_of(
    ruleset: Ruleset, team: Team, belief: Belief, bench: Bench, plans: Plans, taken: int, orders: NDArray[np.int8]
) -> Thought:
    """Return what was believed and weighed, and which plan was taken, once a tick's orders are written: shape (own units,)."""
    side, state = ruleset.side, bench.now.state
    own, (foe, _, last) = units_of(int(team), bench.tables)[0], units_of(int(team.other), bench.tables)
    columns = np.arange(side, dtype=np.uint64)
    rows = [row for row in (BLUEPRINT, BEST, *range(PRESETS, TRIALS)) if plans.n_tried[row]]
    models = shares_of_models(bench.now, team.other)
    ways = {}
    for unit, order in enumerate(orders.tolist()):
        if state.alive[0, own + unit]:
            cell, goal = int(state.cell[0, own + unit]), int(plans.goal[taken, unit])
            ways[unit] = [cell, goal if goal >= 0 else int(bench.tables.neighbour[order, cell])]
    return Thought(
        side=side,
        enemies=[f"{kind.name} {number}" for number, kind in enumerate(ruleset.team(team.other))],
        worlds=np.where(state.alive[:, foe:last] > 0, state.cell[:, foe:last], -1).astype(np.int16),
        in_sight=((belief.in_sight[0][:, None] >> columns) & np.uint64(1)).astype(np.bool_).ravel(),
        flag_cells=state.field[:, StateField.BLUE_FLAG + team.other].astype(np.int16) if belief.enemy_flag[0] < 0 else None,
        models=dict(zip(NAMES, models.tolist(), strict=True)),
        plans=[WeighedPlan.of(_name(row, ruleset, team, plans), plans.value[row, : plans.n_tried[row]]) for row in rows],
        taken=rows.index(taken) if taken in rows else 0,
        ways=ways,
    )


def _name(row: int, ruleset: Ruleset, team: Team, plans: Plans) -> str:
    if row == BLUEPRINT:
        return "role_team's orders"
    told = []
    for unit, kind in enumerate(ruleset.team(team)):
        role, goal, first = Role(int(plans.role[row, unit])), int(plans.goal[row, unit]), int(plans.first[row, unit])
        what = f"go to {divmod(goal, ruleset.side)}" if role is Role.GO else role.name.lower()
        told.append(f"{kind.name} {unit} {f'{Action(first).name.lower()}, then ' if first >= 0 else ''}{what}")
    return "; ".join(told)
