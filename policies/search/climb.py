"""From plans to a better one, unit by unit: all are tried in the same worlds by the same chance, and those that win in more.

The portfolio of roles climbed one unit at a time is that of Churchill and Buro, "Portfolio greedy search and simulation for
large-scale combat in StarCraft" (CIG 2013). That a blueprint is left only for what is shown to be better is the idea of SPARTA
(Lerer, Hu, Foerster, Brown: "Improving policies via search in cooperative partially observable games", AAAI 2020).
"""

from typing import NamedTuple

import numpy as np

from arena.game.state import Rule, StateField
from arena.game.types import Action
from arena.jit import jit
from policies.chance import choose, mix
from policies.search.models import ATTACK, CHASE, FOLLOW, GO, GUARD, HOLD, HUNT, RUSH, SCOUT, WATCH, flyers_role
from policies.search.plans import FROM_ROLE, Plans, copy_plan, copy_tried_plan, lead_of, mean_of
from policies.search.playout import Bench, play_out
from policies.search.ways import NO_WAY
from policies.search.worlds import units_of

BLUEPRINT, BEST, LAST, PRESETS = range(4)
"""Rows of the plans: the blueprint, the best, that of the tick before, and the first of the team's presets."""
_TEAMS = (
    (ATTACK, ATTACK, ATTACK, ATTACK),
    (GUARD, ATTACK, ATTACK, ATTACK),
    (GUARD, GUARD, ATTACK, ATTACK),
    (GUARD, HUNT, HUNT, ATTACK),
    (GUARD, GUARD, HUNT, HUNT),
    (GUARD, HOLD, HOLD, HOLD),
    (RUSH, RUSH, RUSH, RUSH),
)
"""Presets: the roles of the quarters of a team, those nearest to their flag first."""
_TEAM_ROLES = np.array(_TEAMS, np.int64)
TRIALS = PRESETS + len(_TEAMS)
"""First row of what is tried for one unit."""
WALKS = np.array((ATTACK, RUSH, GUARD, HUNT, HOLD, CHASE), np.int64)
"""Roles that are tried for a unit on foot."""
FLIES = np.array((SCOUT, WATCH, FOLLOW), np.int64)
"""And for one that flies."""
_N_ACTIONS, _N_GOALS = len(Action), 3
N_PLANS = TRIALS + _N_ACTIONS + len(WALKS) + _N_GOALS
"""Rows that plans need."""
_WALK_CELLS, _FLY_CELLS = 6, 12
"""How far off goals are drawn, to either side."""
_KEPT = 0.03
"""How much better than the blueprint, and than the last plan, a preset must be to be climbed from."""
_ROUNDS = 3
"""How often each unit is climbed at most."""
_STRIDE = 37
"""Worlds are looked at in steps of this, since neighbours come from one world of the tick before. A prime."""


class Effort(NamedTuple):
    """How long a planner thinks, and how it spends that."""

    budget: int
    """Playouts a tick, all in all."""
    few: int
    """Worlds in which each plan is tried."""
    more: int
    """In which those are that were better in the few."""
    most: int
    """In which the winner is, and the best plan against the blueprint."""
    n_kept: int = 3
    """How many go on from few worlds to more."""
    hold: int = 40
    """Ticks for which a plan is held in a playout."""
    horizon: int = 60
    """Ticks of a playout."""
    is_better: float = 0.5
    """By how many standard errors a plan must lead to take the place of the best."""
    is_sure: float = 0.5
    """By how many the best must lead to take the place of the blueprint."""

    mutates: int = 48
    """One world in so many takes another model of the enemy at each tick: opponents change their minds."""

    tries_steps: bool = True
    """Whether other first steps of a unit are tried, as the two that follow. All from here on are there to be measured."""
    tries_roles: bool = True
    tries_goals: bool = True
    filters: bool = True
    """Whether worlds go on from tick to tick; else they are drawn anew, from the tracks alone."""
    shares_chance: bool = True
    """Whether plans are tried by the same chance."""
    sees_all: bool = False
    """Whether the own team sees all of a playout; else what its units see there."""
    checks: bool = True
    """Whether the best plan and the blueprint are tried at last by a chance for which neither was chosen."""

    @classmethod
    def of(cls, budget: int) -> "Effort":
        """Return how a budget of playouts is spent: worlds and plans grow with it alike."""
        few = min(max(budget // 20, 2), 12)
        return cls(budget=budget, few=few, more=3 * few, most=min(max(budget // 5, 16), 16 * few))

    def within(self, n_worlds: int) -> "Effort":
        """Return the same for no more worlds than there are."""
        few, more, most = (min(n, n_worlds) for n in (self.few, self.more, self.most))
        return self._replace(few=few, more=more, most=most)


@jit()
def climb(me: int, plans: Plans, bench: Bench, effort: Effort, seed: np.uint64, salt: np.uint64) -> None:
    """Make plan `BEST` as good as the budget allows, from `BLUEPRINT`, `LAST` and the presets.

    Parameters
    ----------
    seed
        Of the chance in playouts; the same for all plans that are to be compared.
    salt
        Of the order in which units are climbed, and of the goals that are drawn.
    """
    few, more, most = effort.few, effort.more, effort.most
    spent = 0
    write_presets(me, plans, bench)
    for plan in range(TRIALS):
        plans.n_tried[plan] = 0
    best, top = BLUEPRINT, -1.0
    for plan in range(TRIALS):
        if plan != BEST:
            spent += try_plan(plan, few, me, plans, bench, effort, seed)
            mean = mean_of(plan, few, plans) + (_KEPT if plan in (BLUEPRINT, LAST) else 0.0)
            if mean > top:
                best, top = plan, mean
    top = -1.0
    for plan in (best, LAST, BLUEPRINT):
        spent += try_plan(plan, more, me, plans, bench, effort, seed)
        if mean_of(plan, more, plans) > top:
            best, top = plan, mean_of(plan, more, plans)
    copy_tried_plan(best, plans, BEST, plans)
    n_units = plans.role.shape[1]
    first, offset, turn = units_of(me, bench.tables)[0], choose(salt, max(n_units, 1)), 0
    reserve = 2 * most
    while spent + reserve < effort.budget and turn < _ROUNDS * n_units:
        unit = (turn + offset) % n_units
        turn += 1
        if bench.now.state.alive[0, first + unit]:
            spent += _climb_unit(
                unit, me, effort.budget - reserve - spent, plans, bench, effort, seed, mix(salt + np.uint64(turn))
            )


@jit()
def check(plan: int, me: int, plans: Plans, bench: Bench, effort: Effort, seed: np.uint64) -> None:
    """Try a plan anew in the most worlds, by a chance for which it was not chosen: the best of many owes some lead to luck."""
    plans.n_tried[plan] = 0
    try_plan(plan, effort.most, me, plans, bench, effort, seed)


def is_sure(plan: int, plans: Plans, effort: Effort) -> bool:
    """Whether a plan is shown to be better than the blueprint; both have been checked."""
    lead, error = lead_of(plan, BLUEPRINT, int(min(plans.n_tried[plan], plans.n_tried[BLUEPRINT])), plans)
    return bool(lead > effort.is_sure * error)


@jit()
def try_plan(plan: int, n: int, me: int, plans: Plans, bench: Bench, effort: Effort, seed: np.uint64) -> int:
    """Try a plan in the first n worlds, those apart in which it was; return how many playouts that took."""
    before, n_worlds = int(plans.n_tried[plan]), bench.now.role.shape[0]
    row = int(np.int64(plan))  # a constant row, as `BEST` is, would have playouts compiled anew for it
    if not effort.shares_chance:
        seed = mix(seed + np.uint64(plan))
    for k in range(before, n):
        plans.value[plan, k] = play_out(k * _STRIDE % n_worlds, me, row, plans, bench, seed, effort.horizon, effort.hold)
    plans.n_tried[plan] = max(n, before)
    return max(n - before, 0)


@jit()
def _climb_unit(
    unit: int, me: int, left: int, plans: Plans, bench: Bench, effort: Effort, seed: np.uint64, salt: np.uint64
) -> int:
    """Try what else a unit of the best plan could do, and keep what is better; return how many playouts it took, about `left`."""
    few, more, most = effort.few, effort.more, effort.most
    n_plans = _write_trials(unit, me, plans, bench, effort, salt)
    spent = try_plan(BEST, few, me, plans, bench, effort, seed)
    for plan in range(TRIALS, n_plans):
        if spent >= left:
            n_plans = plan
            break
        spent += try_plan(plan, few, me, plans, bench, effort, seed)
    base = mean_of(BEST, few, plans)
    spent += try_plan(BEST, more, me, plans, bench, effort, seed)
    winner, top = -1, mean_of(BEST, more, plans)
    for _ in range(effort.n_kept):
        chosen, least = -1, base
        for plan in range(TRIALS, n_plans):
            if plans.n_tried[plan] == few and mean_of(plan, few, plans) > least:
                chosen, least = plan, mean_of(plan, few, plans)
        if chosen < 0 or spent >= left:
            break
        spent += try_plan(chosen, more, me, plans, bench, effort, seed)
        if mean_of(chosen, more, plans) > top:
            winner, top = chosen, mean_of(chosen, more, plans)
    if winner >= 0:
        spent += try_plan(winner, most, me, plans, bench, effort, seed)
        spent += try_plan(BEST, most, me, plans, bench, effort, seed)
        lead, error = lead_of(winner, BEST, most, plans)
        if lead > effort.is_better * error:
            copy_tried_plan(winner, plans, BEST, plans)
    return spent


@jit()
def _write_trials(unit: int, me: int, plans: Plans, bench: Bench, effort: Effort, salt: np.uint64) -> int:
    """Write what else a unit of the best plan could do: another first step, another role, a goal; return the row after them."""
    tables, ways = bench.tables, bench.ways
    first, flyers, _ = units_of(me, tables)
    cell, walks, side = int(bench.now.state.cell[0, first + unit]), first + unit < flyers, int(tables.rule[Rule.SIDE])
    plan = TRIALS
    for action in range(_N_ACTIONS if effort.tries_steps else 0):
        to = int(tables.neighbour[action, cell])
        is_idle = action > 0 and (to == cell or (walks and ways.far[to, to] == NO_WAY))
        if action != plans.first[BEST, unit] and not is_idle:
            copy_plan(BEST, plans, plan, plans)
            plans.first[plan, unit] = action
            plan += 1
    for role in WALKS if walks else FLIES:
        if effort.tries_roles and (role != plans.role[BEST, unit] or plans.first[BEST, unit] != FROM_ROLE):
            copy_plan(BEST, plans, plan, plans)
            plans.first[plan, unit], plans.role[plan, unit] = FROM_ROLE, role
            plan += 1
    for k in range(_N_GOALS if effort.tries_goals else 0):
        reach, word = _WALK_CELLS if walks else _FLY_CELLS, mix(salt + np.uint64(k))
        row = min(max(cell // side + choose(word, 2 * reach + 1) - reach, 0), side - 1)
        column = min(max(cell % side + choose(mix(word), 2 * reach + 1) - reach, 0), side - 1)
        goal = cell if k == 0 else row * side + column
        copy_plan(BEST, plans, plan, plans)
        plans.first[plan, unit], plans.role[plan, unit] = FROM_ROLE, GO
        plans.goal[plan, unit] = ways.open[goal] if walks else goal
        plan += 1
    return plan


@jit()
def write_presets(me: int, plans: Plans, bench: Bench) -> None:
    """Write the presets of the whole team, in the rows from `PRESETS` on."""
    for team in range(_TEAM_ROLES.shape[0]):
        _write_preset(me, team, plans, bench)


@jit()
def _write_preset(me: int, team: int, plans: Plans, bench: Bench) -> None:
    """Write a plan of the whole team: the roles of a row of presets, from the unit nearest to the own flag on."""
    state, plan = bench.now.state, PRESETS + team
    first, flyers, last = units_of(me, bench.tables)
    home = int(state.field[0, StateField.BLUE_FLAG + me])
    for unit in range(last - first):
        plans.first[plan, unit], plans.goal[plan, unit] = FROM_ROLE, -1
        plans.role[plan, unit] = flyers_role(unit - flyers + first)
    placed = 0
    for rank in range(flyers - first):
        chosen, least = 0, 1 << 30
        for unit in range(flyers - first):
            far = int(bench.ways.far[home, state.cell[0, first + unit]])
            far += 0 if state.alive[0, first + unit] else 1000
            if not (placed >> unit) & 1 and far < least:
                chosen, least = unit, far
        placed |= 1 << chosen
        plans.role[plan, chosen] = _TEAM_ROLES[team, rank * _TEAM_ROLES.shape[1] // (flyers - first)]
