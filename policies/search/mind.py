"""What one seat of a planner has in mind: a blueprint, the worlds that may be, and its plans; one match at a time."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team
from policies.belief.memory import sight_of
from policies.heuristics.role_team import RoleTeam
from policies.search.climb import BEST, BLUEPRINT, LAST, N_PLANS, Effort, check, climb, is_sure
from policies.search.desk import set_posts
from policies.search.explain import Thought
from policies.search.models import ATTACK, GUARD, HOLD, HUNT, role_of_flyer
from policies.search.particles import begin, follow, lay_ground, make_weights
from policies.search.plans import FROM_ROLE, copy_plan, copy_tried_plan, lead_of, make_plans, mean_of
from policies.search.playout import make_bench, write_first_orders
from policies.search.tell import thought_of
from policies.search.ways import find_ways
from policies.tactics import roles as scripted

_SCRIPTED = {
    scripted.ATTACK: ATTACK, scripted.GUARD: GUARD, scripted.HUNT: HUNT, scripted.DECOY: ATTACK, scripted.WAIT: HOLD,
    scripted.NORTH: HOLD, scripted.SOUTH: HOLD,
}  # fmt: skip
"""What the blueprint's roles are in playouts, as far as they have one."""
_FOLLOW, _CHANCE, _CHECK, _CLIMB = (np.uint64(1 << bit) for bit in (60, 61, 62, 63))
"""Apart the words that are drawn for each."""
_LOGISTIC = 1.7
"""A logistic curve, this much steeper than usual, is the normal distribution within 0.01."""


class Mind:
    """Thinks for one seat.

    Parameters
    ----------
    n_worlds
        How many worlds that may be are kept.
    n_lines
        How many lines of thought there are, each with the same share of the budget: what comes of them does not depend on how
        many processors carry them.
    """

    def __init__(self, ruleset: Ruleset, team: Team, n_worlds: int, n_lines: int) -> None:
        self._ruleset, self._team = ruleset, team
        self.blueprint = RoleTeam(ruleset, team, 1)
        bench = make_bench(ruleset, n_worlds)
        self.benches = [bench, *(make_bench(ruleset, n_worlds, bench) for _ in range(n_lines - 1))]
        n_units = len(ruleset.team(team))
        self.plans = [make_plans(N_PLANS, n_units, n_worlds) for _ in self.benches]
        self._weights = make_weights(n_worlds)
        self._flies = [unit.flies for unit in ruleset.team(team)]
        self._orders = np.zeros((1, n_units), np.int8)
        self.start()

    def start(self) -> None:
        """Forget the match before."""
        self.blueprint.start(np.zeros(1, np.intp))
        self._walkable: NDArray[np.uint64] | None = None
        self.taken = BLUEPRINT
        self._has_thought, self._seed = False, np.uint64(0)

    def act(self, observations: Observations, effort: Effort, pool: ThreadPoolExecutor | None) -> NDArray[np.int8]:
        """Return the orders of a tick, int8 of shape (own units,), in memory that the next call overwrites.

        Parameters
        ----------
        observations
            Of this seat alone.
        effort
            With a budget of 0, the orders are the blueprint's.
        pool
            Carries the lines of thought, if there are several.
        """
        self.take_in(observations, effort)
        if self._has_thought:
            self._think(effort, pool)
        orders: NDArray[np.int8] = self._orders[0]
        return orders

    def tell(self) -> Thought:
        """Return what it thought about the tick that it has just answered."""
        bench, plans = self.benches[0], self.plans[0]
        return thought_of(self._ruleset, self._team, self.blueprint.belief, bench, plans, self.taken, self._orders[0])

    def hear(self, orders: NDArray[np.int8]) -> None:
        """Take other orders for those that were carried out in the last tick, int8 of shape (own units,)."""
        self._orders[0] = orders

    def first_steps(self) -> NDArray[np.float32]:
        """Return the chances of each unit's orders in the tick that it has just answered; shape (own units, actions).

        The best plan's orders have the chance that it is better than the blueprint, by its lead in the worlds in which both were
        tried and the standard error of that; the blueprint's have the rest.
        """
        plans, everyone = self.plans[0], np.arange(len(self._flies))
        chances = np.zeros((len(self._flies), len(Action)), np.float32)
        if not self._has_thought:
            chances[everyone, self._orders[0]] = 1
            return chances
        lead, error = lead_of(BEST, BLUEPRINT, int(min(plans.n_tried[BEST], plans.n_tried[BLUEPRINT])), plans)
        is_better = 0.5 + 0.5 * np.tanh(0.5 * _LOGISTIC * lead / error)
        best = np.zeros_like(self._orders[0])
        write_first_orders(int(self._team), BEST, plans, self.benches[0], self._seed ^ _CHANCE, best)
        chances[everyone, plans.first[BLUEPRINT]] += 1 - is_better
        chances[everyone, best] += is_better
        return chances

    def _think(self, effort: Effort, pool: ThreadPoolExecutor | None) -> None:
        effort = effort.within(self.plans[0].value.shape[1])
        self._climb(effort, pool, self._seed)
        self.carry_out(BEST if is_sure(BEST, self.plans[0], effort) else BLUEPRINT)

    def take_in(self, observations: Observations, effort: Effort) -> None:
        """Let the worlds that may be go on with what the seat is shown, and write the blueprint's orders as a plan."""
        last_orders = self._orders[0].copy()
        self.blueprint.act(observations, self._orders)
        self.taken, self._has_thought = BLUEPRINT, effort.budget > 0
        if self._has_thought:
            self._follow(observations, effort, last_orders)

    def _follow(self, observations: Observations, effort: Effort, last_orders: NDArray[np.int8]) -> None:
        sight, belief, me, bench = sight_of(observations), self.blueprint.belief, int(self._team), self.benches[0]
        seed, plans, is_first = observations.seed[0], self.plans[0], self._walkable is None
        self._seed = seed
        is_drawn = is_first or not effort.filters
        if self._walkable is None or (belief.walkable[0] != self._walkable).any():
            self._walkable = belief.walkable[0].copy()
            find_ways(belief, self._ruleset.side, bench.tables, bench.ways)
            lay_ground(me, belief, bench)
        if is_drawn:
            for line in self.benches:
                set_posts(line.desk, self._ruleset, self._team, int(belief.forward[0]))
                line.desk.shown[me] |= effort.sees_all
            begin(me, belief, bench, seed ^ _FOLLOW)
        follow(me, sight, belief, last_orders, is_drawn, effort.mutates, bench, self._weights, seed ^ _FOLLOW)
        self._write_blueprint()
        if is_first:
            copy_plan(BLUEPRINT, plans, LAST, plans)

    def carry_out(self, plan: int) -> NDArray[np.int8]:
        """Return the orders of a plan, as `act` does; the plan that the next tick remembers is `BEST`."""
        plans, bench = self.plans[0], self.benches[0]
        self.taken = plan
        write_first_orders(int(self._team), plan, plans, bench, self._seed ^ _CHANCE, self._orders[0])
        copy_plan(BEST, plans, LAST, plans)
        plans.first[LAST] = FROM_ROLE
        orders: NDArray[np.int8] = self._orders[0]
        return orders

    def _write_blueprint(self) -> None:
        """Write the blueprint's orders as a plan, to be gone on with by roles like its own."""
        plans, n_flyers = self.plans[0], 0
        plans.first[BLUEPRINT], plans.goal[BLUEPRINT] = self._orders[0], -1
        for unit, flies in enumerate(self._flies):
            plans.role[BLUEPRINT, unit] = _SCRIPTED.get(int(self.blueprint.plan.role[unit]), ATTACK)
            if flies:
                plans.role[BLUEPRINT, unit] = role_of_flyer(n_flyers)
                n_flyers += 1

    def _climb(self, effort: Effort, pool: ThreadPoolExecutor | None, seed: np.uint64) -> None:
        """Leave the best plan of all lines of thought in the first."""
        me, n_lines = int(self._team), len(self.benches)
        share, checks = effort._replace(budget=effort.budget // n_lines), seed ^ (_CHECK if effort.checks else _CHANCE)
        for plans in self.plans[1:]:
            for plan in (BLUEPRINT, LAST):
                copy_plan(plan, self.plans[0], plan, plans)

        def think(line: int) -> None:
            plans, bench = self.plans[line], self.benches[line]
            climb(me, plans, bench, share, seed ^ _CHANCE, seed ^ _CLIMB ^ np.uint64(line))
            check(BEST, me, plans, bench, effort, checks)
            if line == 0:
                check(BLUEPRINT, me, plans, bench, effort, checks)

        list((pool.map if pool else map)(think, range(n_lines)))
        best = max(range(n_lines), key=lambda line: mean_of(BEST, effort.most, self.plans[line]))
        copy_tried_plan(BEST, self.plans[best], BEST, self.plans[0])
