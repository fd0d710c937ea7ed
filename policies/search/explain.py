"""What a planner believed, weighed and took on one tick, as annotations: lines for the log, heat maps, and ways over the board.

Pure: a `Thought` goes in. It is made where somebody asks for it alone (`BatchPolicy.explains`), and no order depends on it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from arena.annotations import Annotations

_COLOURS = ("red", "orange", "purple", "blue")
"""Of the enemies, each the same on every tick."""
_FLAG_COLOUR, _WAY_COLOUR = "yellow", "green"
_MOST_PLANS, _MOST_MODELS, _MOST_WAY_CELLS = 6, 6, 40
_LEAST_SHARE = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class WeighedPlan:
    """A plan, and what it was worth in the worlds that it was tried in."""

    name: str
    value: float
    """Mean over its worlds."""
    error: float
    """Standard error of `value`."""
    n_worlds: int

    @classmethod
    def of(cls, name: str, values: NDArray[np.floating[Any]]) -> Self:
        """Return a plan by what it was worth in each world that it was tried in, at least one; shape (worlds,)."""
        return cls(name=name, value=float(values.mean()), error=float(values.std() / len(values) ** 0.5), n_worlds=len(values))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Thought:
    """What a planner knew and did on one tick. A cell is row x side + column."""

    side: int
    enemies: Sequence[str]
    """A name for each enemy unit, its type and number, as in "ugv 0"."""
    worlds: NDArray[np.int16]
    """Shape (worlds, enemies): the cell of each enemy in worlds that are equally likely; negative where it has fallen."""
    in_sight: NDArray[np.bool_]
    """Shape (cells,): what the seat sees now. An enemy that stands there is no guess."""
    flag_cells: NDArray[np.int16] | None = None
    """Where the enemy's flag may lie, a cell as often as it is likely; None once the flag was seen."""
    models: Mapping[str, float] = field(default_factory=dict)
    """The share of each model of the opponent."""
    plans: Sequence[WeighedPlan] = ()
    taken: int = 0
    """The number in `plans` of the plan whose orders were given."""
    ways: Mapping[int, Sequence[int]] = field(default_factory=dict)
    """By own unit, the cells that it goes through by the plan taken, from where it stands to its target."""
    remarks: Sequence[str] = ()
    """What else there is to say, a sentence each."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Map:
    """Where an enemy may be, or several are."""

    label: str
    shares: NDArray[np.float64]
    """Shape (cells,): of the worlds; of several enemies, how many are expected there."""
    names: Sequence[str]


def explain(thought: Thought) -> Annotations:
    """Return a thought as annotations: one heat map for each unseen enemy, or for several where there is no room for so many."""
    notes = Annotations(thought.side)
    for group in _GROUPS:
        labels = list(dict.fromkeys(map(group, thought.enemies)))
        colours = {label: _COLOURS[number % len(_COLOURS)] for number, label in enumerate(labels)}
        notes = _note(thought, _combine(_unseen(thought), group), colours)
        if notes.is_whole:
            break
    return notes


def _unseen(thought: Thought) -> Iterator[_Map]:
    """Yield where each enemy may be that is out of sight in some world."""
    n_worlds = max(len(thought.worlds), 1)
    for name, cells in zip(thought.enemies, thought.worlds.T, strict=True):
        alive = cells[cells >= 0]
        hidden = alive[~thought.in_sight[alive]]
        if hidden.size:
            shares = np.bincount(hidden, minlength=thought.side**2) / n_worlds
            yield _Map(label=name, shares=shares, names=(name,))


_GROUPS: tuple[Callable[[str], str], ...] = (
    lambda name: name,
    lambda name: f"every {name.partition(' ')[0]}",
    lambda name: "every enemy",
)
"""What the map is called that an enemy of some name is shown on, from one map for each to one for all."""


def _combine(maps: Iterator[_Map], group: Callable[[str], str]) -> Iterator[_Map]:
    """Yield maps of which those that are called alike are one."""
    by_label: dict[str, list[_Map]] = {}
    for one in maps:
        by_label.setdefault(group(one.label), []).append(one)
    for label, alike in by_label.items():
        shares = np.sum([one.shares for one in alike], axis=0)
        yield _Map(label=label, shares=shares, names=[name for one in alike for name in one.names])


def _note(thought: Thought, maps: Iterator[_Map], colours: Mapping[str, str]) -> Annotations:
    notes = Annotations(thought.side)
    for line in (*thought.remarks, *_list_plans(thought), *_list_models(thought.models)):
        notes.log(line)
    for one in maps:
        notes.log(_describe(f"{one.label} ({colours[one.label]})", one.shares, thought.side))
        if list(one.names) != [one.label]:
            notes.log(f"  is one map for {', '.join(one.names)}, since there is no room for more")
        strength = min(float(one.shares.sum()), 1.0)  # faint, where it has hardly a chance to be there at all
        heat = np.ceil(one.shares / one.shares.max() * strength * 255).astype(np.uint8)
        notes.draw.heat(heat.tobytes(), colours[one.label], one.label)
    if thought.flag_cells is not None and thought.flag_cells.size:
        shares = np.bincount(thought.flag_cells.ravel(), minlength=thought.side**2) / thought.flag_cells.size
        notes.log(_describe(f"their flag ({_FLAG_COLOUR})", shares, thought.side))
        notes.draw.heat(shares, _FLAG_COLOUR, "their flag")
    for unit, way in thought.ways.items():
        cells = [divmod(int(cell), thought.side) for cell in way[:_MOST_WAY_CELLS]]
        if len(cells) > 1:
            notes.draw.path(cells, _WAY_COLOUR)
        if cells:
            notes.draw.cell(*cells[-1], _WAY_COLOUR, str(unit))
    return notes


def _list_plans(thought: Thought) -> Iterator[str]:
    """Yield the best plans as lines, the one taken among them."""
    if not thought.plans:
        return
    order = sorted(range(len(thought.plans)), key=lambda number: -np.nan_to_num(thought.plans[number].value, nan=-np.inf))
    shown = order[:_MOST_PLANS]
    if thought.taken not in shown:
        shown[-1] = thought.taken
    yield f"weighed {len(order)} {'plan' if len(order) == 1 else 'plans'}: value, standard error, worlds; > was taken"
    for number in shown:
        plan = thought.plans[number]
        mark = ">" if number == thought.taken else " "
        yield f"{mark} {plan.value:.3f} +-{plan.error:.3f} {plan.n_worlds:4d}  {plan.name}"


def _list_models(models: Mapping[str, float]) -> Iterator[str]:
    """Yield a line with the likeliest models, if there are any."""
    shares = sorted(models.items(), key=lambda item: -item[1])[:_MOST_MODELS]
    told = ", ".join(f"{name} {share:.2f}" for name, share in shares if share >= _LEAST_SHARE)
    if told:
        yield f"they play like: {told}"


def _describe(what: str, shares: NDArray[np.float64], side: int) -> str:
    """Return a map in words: on how many cells, which is the likeliest, and whether there is anything on it at all."""
    row, column = divmod(int(shares.argmax()), side)
    line = f"{what}: {np.count_nonzero(shares)} cells, likeliest ({row}, {column}) with {shares.max():.2f}"
    return line if shares.sum() > 1 - _LEAST_SHARE else f"{line}; alive and out of sight in {shares.sum():.2f} of the worlds"
