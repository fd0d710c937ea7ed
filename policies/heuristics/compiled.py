"""A fighter whose thinking is one kernel over all its seats."""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.jit import compile_for
from arena.policy import BatchPolicy, Orders
from policies.belief.memory import sight_of
from policies.belief.team_rules import team_rules


class CompiledPolicy(BatchPolicy):
    """Calls the kernel of its class.

    Parameters
    ----------
    memory
        Named tuples of arrays: what the kernel takes between a `Sight` and `TeamRules`; the orders to write come last.
    """

    kernel: ClassVar[Callable[..., None]]

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int, *memory: tuple[Any, ...]) -> None:
        super().__init__(ruleset, team, n_seats)
        self._orders = np.zeros((n_seats, len(ruleset.team(team))), np.int8)
        self._arguments = (*memory, team_rules(ruleset, team), self._orders)
        self._compiled: Callable[..., None] | None = None

    def act(self, observations: Observations, orders: Orders) -> None:
        """Write the orders of all seats."""
        sight = sight_of(observations)
        if self._compiled is None:
            self._compiled = compile_for(type(self).kernel, sight, *self._arguments)
        self._compiled(sight, *self._arguments)
        orders[:] = self._orders
