"""Plans of a team: for each unit the order of the first tick, a role and its goal; and what they came to in the worlds tried."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.jit import jit

FROM_ROLE = -1
"""Stands in `Plans.first` where the role says the first order, too."""


class Plans(NamedTuple):
    """Some plans; row i of every array is plan i."""

    first: NDArray[np.int8]
    """Shape (n, own units): the order of the first tick, or `FROM_ROLE`."""
    role: NDArray[np.int8]
    """Shape (n, own units): a `models.Role`."""
    goal: NDArray[np.int16]
    """Shape (n, own units): the cell of `Role.GO`, or -1."""
    value: NDArray[np.float32]
    """Shape (n, worlds): the share of a win in each world that it was tried in, in the order of trials."""
    n_tried: NDArray[np.int64]
    """Shape (n,): in how many worlds it was tried."""


def make_plans(n: int, n_units: int, n_worlds: int) -> Plans:
    """Return memory for plans."""
    return Plans(
        first=np.full((n, n_units), FROM_ROLE, np.int8),
        role=np.zeros((n, n_units), np.int8),
        goal=np.full((n, n_units), -1, np.int16),
        value=np.zeros((n, n_worlds), np.float32),
        n_tried=np.zeros(n, np.int64),
    )


@jit()
def copy_plan(one: int, source: Plans, other: int, target: Plans) -> None:
    """Make one plan like another, untried."""
    for unit in range(target.role.shape[1]):
        target.first[other, unit], target.role[other, unit] = source.first[one, unit], source.role[one, unit]
        target.goal[other, unit] = source.goal[one, unit]
    target.n_tried[other] = 0


@jit()
def copy_tried_plan(one: int, source: Plans, other: int, target: Plans) -> None:
    """Make one plan like another, or itself, with what it came to."""
    n_tried = source.n_tried[one]
    copy_plan(one, source, other, target)
    for k in range(n_tried):
        target.value[other, k] = source.value[one, k]
    target.n_tried[other] = n_tried


@jit()
def mean_of(plan: int, n: int, plans: Plans) -> float:
    """Return what a plan came to on average in the first n worlds."""
    total = 0.0
    for k in range(n):
        total += plans.value[plan, k]
    return total / n


@jit()
def lead_of(one: int, other: int, n: int, plans: Plans) -> tuple[float, float]:
    """Return by how much a plan is better than another in the same n worlds, and the standard error of that."""
    total, squares = 0.0, 0.0
    for k in range(n):
        lead = float(plans.value[one, k]) - float(plans.value[other, k])
        total += lead
        squares += lead * lead
    mean = total / n
    return mean, np.sqrt(max(squares / n - mean * mean, 1e-9) / n)
