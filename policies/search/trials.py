"""Plans tried in playouts so that a network learns what plans are worth: those that a climb looks at, and some at random.

A few worlds for each of many plans say more than many worlds for a few: the chance of one is made up for by thousands of others.
"""

import numpy as np

from arena.game.types import Action
from arena.jit import jit
from policies.chance import choose, mix
from policies.search.climb import BEST, FLIES, N_PLANS, PRESETS, TRIALS, WALKS
from policies.search.plans import FROM_ROLE, Plans, copy_plan
from policies.search.playout import Bench, play_out
from policies.search.worlds import units_of

UNTRIED = -1.0
"""Stands for the value of a plan that was not tried."""
_N_PRESETS = 3
"""How many of the presets are tried at a tick, drawn anew each time; one may be drawn twice."""
_PAIR, _STEPS, _RANDOM = TRIALS + 8, TRIALS + 9, N_PLANS - 1
"""Rows of a plan in which two units take other roles than in the best, of plans in which one takes another first step, and of one
in which all take any role. In those before, one unit takes another role."""
_N_ACTIONS = len(Action)


@jit()
def write_variants(me: int, plans: Plans, bench: Bench, seed: np.uint64) -> None:
    """Write other plans than the best, in the rows from `TRIALS` on."""
    first, flyers, last = units_of(me, bench.tables)
    n_units, n_walkers = int(last - first), int(flyers - first)
    for plan in range(TRIALS, N_PLANS):
        word = mix(seed + np.uint64(plan))
        copy_plan(BEST, plans, plan, plans)
        if plan == _RANDOM:
            for unit in range(n_units):
                word = mix(word)
                _take_any_role(plan, unit, n_walkers, word, plans)
        elif plan < _STEPS:
            for _ in range(2 if plan == _PAIR else 1):
                word = mix(word)
                _take_any_role(plan, choose(word, n_units), n_walkers, mix(word), plans)
        else:
            plans.first[plan, choose(word, n_units)] = choose(mix(word), _N_ACTIONS)


@jit(inline=True)
def _take_any_role(plan: int, unit: int, n_walkers: int, word: np.uint64, plans: Plans) -> None:
    walks = unit < n_walkers
    role = WALKS[choose(word, len(WALKS))] if walks else FLIES[choose(word, len(FLIES))]
    plans.first[plan, unit], plans.role[plan, unit], plans.goal[plan, unit] = FROM_ROLE, role, -1


@jit()
def try_plans(me: int, n_worlds: int, plans: Plans, bench: Bench, seed: np.uint64, horizon: int, hold: int) -> None:
    """Try all plans in the same few worlds, by the same chance; of the presets, some.

    Parameters
    ----------
    n_worlds
        How many worlds, drawn anew each time.
    horizon, hold
        As `play_out`.
    """
    n, drawn = bench.now.role.shape[0], 0
    for turn in range(_N_PRESETS):
        drawn |= 1 << (PRESETS + choose(mix(seed + np.uint64(turn)), TRIALS - PRESETS))
    for plan in range(N_PLANS):
        plans.n_tried[plan] = 0
        if plan < PRESETS or plan >= TRIALS or (drawn >> plan) & 1:
            for k in range(n_worlds):
                world = choose(mix(seed ^ mix(np.uint64(k))), n)
                plans.value[plan, k] = play_out(world, me, int(np.int64(plan)), plans, bench, seed, horizon, hold)
            plans.n_tried[plan] = n_worlds
