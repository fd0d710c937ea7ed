"""Playouts: worlds played on by the rules' own functions, both teams by roles, to the end of the match or to a horizon."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.game.engine import WORK_SHAPE, tables_of
from arena.game.fight import fight, judge
from arena.game.kernel import DEFAULT_SHAPE
from arena.game.move import move
from arena.game.ruleset import Ruleset
from arena.game.state import Rule, Shape, State, StateField, Tables
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


@jit(inline=True)
def _step_inline(
    world: int, shape: Shape, state: State, orders: NDArray[np.int8], tables: Tables, work: NDArray[np.int64]
) -> None:
    """Play a tick of one world by the rules."""
    move(world, shape, state, orders, tables, work)
    fight(world, shape, state, tables, work)
    judge(world, shape, state, tables)


@jit()
def _step(world: int, shape: Shape, state: State, orders: NDArray[np.int8], tables: Tables, work: NDArray[np.int64]) -> None:
    """`_step_inline`, apart: for all boards but the default, whose sizes the compiler knows where it is inlined."""
    _step_inline(world, shape, state, orders, tables, work)


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
    copy_world(world, bench.now, world, worlds)
    left = int(tables.rule[Rule.TICK_LIMIT] - state.field[world, StateField.TICK])
    n_ticks = left if left <= horizon + _PLAYED_OUT else horizon
    first, _, last = units_of(me, tables)
    for unit in range(first, last):
        worlds.role[world, unit], worlds.goal[world, unit] = plans.role[plan, unit - first], plans.goal[plan, unit - first]
    shape = (
        tables.rule[Rule.SIDE], tables.rule[Rule.BLUE_UNITS], tables.rule[Rule.BLUE_WALKERS], tables.rule[Rule.RED_UNITS],
        tables.rule[Rule.RED_WALKERS],
    )  # fmt: skip
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
            _step_inline(world, DEFAULT_SHAPE, state, bench.orders, tables, bench.work)
        else:
            _step(world, shape, state, bench.orders, tables, bench.work)
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
    worlds = bench.then
    copy_world(0, bench.now, 0, worlds)
    first, _, last = units_of(me, bench.tables)
    for unit in range(first, last):
        worlds.role[0, unit], worlds.goal[0, unit] = plans.role[plan, unit - first], plans.goal[plan, unit - first]
    chance = seed ^ mix(np.uint64(0))
    order_team_anew(0, me, worlds, bench.ways, bench.tables, bench.rows, bench.desk, chance, bench.orders)
    for unit in range(first, last):
        order = plans.first[plan, unit - first]
        out[unit - first] = bench.orders[0, unit] if order == FROM_ROLE else order
