"""Playouts: worlds played on by the rules' own functions, both teams by roles, to the end of the match or to a horizon."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.engine import WORK_SHAPE, tables_of
from arena.game.kernel import DEFAULT_SHAPE, shape_of, step_one
from arena.game.ruleset import Ruleset
from arena.game.state import Rule, Shape, StateField, Tables
from arena.game.types import Termination
from arena.jit import jit
from policies.chance import mix
from policies.search.desk import Desk, make_desk, place_units
from policies.search.models import ASSIGN_EVERY, ROWS, assign_roles
from policies.search.plans import FROM_ROLE, Plans
from policies.search.roles import order_team, order_team_anew
from policies.search.value import N_FEATURES, WEIGHTS, value_of
from policies.search.ways import Ways, make_ways
from policies.search.worlds import Worlds, as_index, copy_world, make_worlds, units_of

_HASTE = 0.001
"""What a tick more costs of a win, and is worth of a loss: else nobody would hurry to what is sure."""
_PLAYED_OUT = 10
"""With so many ticks left after the horizon, a match is played to its end."""


class Bench(NamedTuple):
    """What one line of thought works with."""

    now: Worlds
    """What may be now; read only, and shared by all benches of a seat."""
    then: Worlds
    """Scratch for what comes of it."""
    ways: Ways
    """Shared, too."""
    tables: Tables
    rows: NDArray[np.int64]
    """`models.ROWS`."""
    desk: Desk
    orders: NDArray[np.int8]
    """Shape (worlds, units)."""
    work: NDArray[np.int64]
    """Scratch of `arena.game`."""
    weights: NDArray[np.float64]
    """`value.WEIGHTS`."""
    features: NDArray[np.float64]


def make_bench(ruleset: Ruleset, n_worlds: int, shared: "Bench | None" = None) -> Bench:
    """Return memory for a line of thought; what may be shared is that of another."""
    now = make_worlds(ruleset, n_worlds) if shared is None else shared.now
    return Bench(
        now=now,
        then=make_worlds(ruleset, n_worlds, now.state),
        ways=make_ways(ruleset.side**2) if shared is None else shared.ways,
        tables=tables_of(ruleset),
        rows=ROWS,
        desk=make_desk(ruleset),
        orders=np.zeros((n_worlds, now.role.shape[1]), np.int8),
        work=np.zeros(WORK_SHAPE, np.int64),
        weights=WEIGHTS,
        features=np.zeros(N_FEATURES),
    )


@jit()
def _step_apart(world: int, shape: Shape, bench: Bench) -> None:
    """`step_one`, not inlined: for all boards but the default, whose sizes the compiler knows."""
    step_one(world, shape, bench.then.state, bench.orders, bench.tables, bench.work)


@jit(inline=True)
def _begin(world: int, me: int, plan: int, plans: Plans, bench: Bench) -> None:
    """Make a world of then what it is now, with the roles of a plan."""
    copy_world(world, bench.now, world, bench.then)
    first, _, last = units_of(me, bench.tables)
    for unit in range(first, last):
        bench.then.role[world, unit] = plans.role[plan, unit - first]
        bench.then.goal[world, unit] = plans.goal[plan, unit - first]


@jit()
def play_out(world: int, me: int, plan: int, plans: Plans, bench: Bench, seed: np.uint64, horizon: int, hold: int) -> float:
    """Return what a plan comes to in one world: the share of a win, from 0 to 1, the sooner the more.

    Parameters
    ----------
    horizon
        Ticks after which a world is valued instead.
    hold
        Ticks for which the plan is held; then the team plays by its own model.
    """
    worlds, tables, rows, state = bench.then, bench.tables, bench.rows, bench.then.state
    world = as_index(world)
    _begin(world, me, plan, plans, bench)
    left = int(tables.rule[Rule.TICK_LIMIT] - state.field[world, StateField.TICK])
    n_ticks = left if left <= horizon + _PLAYED_OUT else horizon
    first, _, last = units_of(me, tables)
    shape = shape_of(tables)
    chance, is_default = seed ^ mix(np.uint64(world)), shape == DEFAULT_SHAPE
    for tick in range(n_ticks):
        place_units(world, worlds, tables, bench.desk)
        for team in range(2):
            since = tick - hold if team == me else tick
            assigns = since >= 0 and since % ASSIGN_EVERY == 0
            if assigns:
                assign_roles(world, team, worlds, bench.ways, tables, rows)
            order_team(world, team, assigns or tick == 0, worlds, bench.ways, tables, rows, bench.desk, chance, bench.orders)
        if tick == 0:
            for unit in range(first, last):
                if plans.first[plan, unit - first] != FROM_ROLE:
                    bench.orders[world, unit] = plans.first[plan, unit - first]
        if is_default:
            step_one(world, DEFAULT_SHAPE, state, bench.orders, tables, bench.work)
        else:
            _step_apart(world, shape, bench)
        if state.field[world, StateField.ENDING] != Termination.RUNNING:
            winner = int(state.field[world, StateField.WINNER])
            return 0.5 if winner < 0 else 0.5 + (0.5 if winner == me else -0.5) * (1.0 - _HASTE * tick)
    return value_of(world, me, worlds, bench.ways, tables, bench.weights, bench.features)


@jit()
def write_first_orders(me: int, plan: int, plans: Plans, bench: Bench, seed: np.uint64, out: NDArray[np.int8]) -> None:
    """Write the orders of a plan's first tick, by what the team sees: so they are the same in every world.

    Parameters
    ----------
    out
        int8, shape (own units,).
    """
    _begin(0, me, plan, plans, bench)
    first, _, last = units_of(me, bench.tables)
    chance = seed ^ mix(np.uint64(0))
    order_team_anew(0, me, bench.then, bench.ways, bench.tables, bench.rows, bench.desk, chance, bench.orders)
    for unit in range(first, last):
        order = plans.first[plan, unit - first]
        out[unit - first] = bench.orders[0, unit] if order == FROM_ROLE else order
