"""One tick of a match as a person looks at it: boards with numbers on the units, what each was ordered, and what just happened.

A journal tells all of it. A transcript tells what one seat was shown: its own losses, and nothing of fights.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.console import clean
from arena.display.seat_memory import GroundMemory, Mask, find_losses
from arena.display.words import name_order, name_unit
from arena.game.engine import BatchedGame
from arena.game.observation import Observation
from arena.game.state import StateField
from arena.game.types import UAVS, UGVS, Team
from arena.records.journal import Journal, Mark
from arena.records.replay import replay as play_again
from arena.records.transcript import Transcript

Cell = tuple[int, int]
"""(row, column)."""
TRUTH, REMEMBERED = "the truth", "and remembers"
_CAPTURED = "captured the flag"
_FATES = (_CAPTURED, "fell", "fought")
"""From the last of `TickEvents` to the first: what counts most comes first."""
_NO_CELLS: frozenset[Cell] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pane:
    """A board with what stands over it."""

    grid: NDArray[np.int8]
    """Shape (side, side), codes of Table 2."""
    numbers: Mapping[Cell, int]
    """Of the living units whose number this view may know, by where they stand."""
    dimmed: Mask | None = None
    """Cells that are remembered alone."""
    is_drawn_on: bool = False
    """Whether it is what the fighter saw that drew."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitLine:
    """What one unit was told, and what the tick before did to it."""

    team: Team
    name: str
    """Type and number."""
    order: str
    """A word; empty where it is not known, as after the last tick."""
    fate: str = ""
    """Empty, `fought`, `fell` or `captured the flag`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Boards that are looked at together, and whose orders stand beside them."""

    name: str
    panes: tuple[str, ...]
    teams: tuple[Team, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """One tick."""

    tick: int
    title: str
    """Clean; who plays, and the public facts."""
    panes: Mapping[str, Pane]
    """By label."""
    units: tuple[UnitLine, ...]
    fought: frozenset[Cell] = _NO_CELLS
    """Where units stand that fought in the tick before this one, and live."""
    fell: frozenset[Cell] = _NO_CELLS
    """Where units fell in the tick before."""
    captured: frozenset[Cell] = _NO_CELLS
    graves: frozenset[Cell] = _NO_CELLS
    """Where units fell at any time."""
    log: tuple[str, ...] = ()
    """What the fighter logged whose match is looked at, as it wrote it: not clean."""
    drawings: Sequence[Mapping[str, Any]] = ()
    """What it drew, as `arena.annotations` shows it."""
    is_event: bool = False
    """Whether somebody looks for this tick: a fight, a fall, a capture; of a transcript, a loss or another score."""


def pane_of(team: Team) -> str:
    """Return the label of what a team sees."""
    return f"what {team.name.lower()} sees"


def views_of_journal(first: Team) -> tuple[View, ...]:
    """Return the views of a match whose truth is known; `first` is whose view comes first."""
    own, other = (View(name=team.name.lower(), panes=(pane_of(team), TRUTH), teams=(team,)) for team in (first, first.other))
    both = View(name="both", panes=(pane_of(Team.BLUE), pane_of(Team.RED)), teams=tuple(Team))
    return own, other, both, View(name="truth", panes=(TRUTH,), teams=tuple(Team))


def views_of_transcript(team: Team) -> tuple[View, ...]:
    """Return the views of what one seat was shown."""
    seen = pane_of(team)
    parts = ("seen and remembered", (seen, REMEMBERED)), ("seen", (seen,)), ("remembered", (REMEMBERED,))
    return tuple(View(name=name, panes=panes, teams=(team,)) for name, panes in parts)


def scenes_of_journal(journal: Journal) -> Iterator[Scene]:
    """Yield every tick, the state after the last among them; raises as `arena.records.replay.replay` does."""
    names = journal.header.blue, journal.header.red
    for tick, games in enumerate(play_again(journal)):
        record = journal.ticks[tick] if tick < len(journal.ticks) else None
        yield scene_of_game(games, names, None if record is None else record.orders, (0, 0) if record is None else record.marks)


def scene_of_game(
    games: BatchedGame, names: tuple[str, str], orders: bytes | None = None, marks: Sequence[int] = (0, 0)
) -> Scene:
    """Return the one game of a batch as it stands.

    Parameters
    ----------
    orders
        What was then ordered: a byte per unit, blue's first; None if nothing was.
    marks
        What each team's answer was, if no order in time (`arena.records.journal.Mark`).
    """
    rules, field, events = games.ruleset, games.state.field[0], games.events
    placed: list[_Placed] = []
    units: list[UnitLine] = []
    for unit, cell in enumerate(games.state.cell[0].tolist()):
        team, index = (Team.BLUE, unit) if unit < games.n_units[Team.BLUE] else (Team.RED, unit - games.n_units[Team.BLUE])
        kind, lives = rules.team(team)[index], bool(games.state.alive[0, unit])
        happened = [fate for fate, flags in zip(_FATES, reversed(events), strict=True) if flags[0, unit]]
        placed.append(_Placed(team, index, kind.flies, divmod(cell, rules.side), lives, happened[0] if happened else ""))
        order = "fallen" if not lives else "" if orders is None else name_order(orders[unit]) + _name_mark(Mark(marks[team]))
        units.append(UnitLine(team=team, name=f"{kind.name} {index}", order=order, fate=placed[-1].fate))
    grids, truth = games.grids(), games.truth(0)
    panes = {pane_of(team): Pane(grid=grids[team, 0], numbers=_number(placed, grids[team, 0], (team,))) for team in Team}
    return Scene(
        tick=int(field[StateField.TICK]),
        title=clean(
            f"blue {names[0]} against red {names[1]}   tick {field[StateField.TICK]} of {rules.tick_limit}   "
            f"score {field[StateField.SCORE]:+d}   units {field[StateField.BLUE_LIVING]}:{field[StateField.RED_LIVING]}"
        ),
        panes={**panes, TRUTH: Pane(grid=truth, numbers=_number(placed, truth, tuple(Team)))},
        units=tuple(units),
        fought=frozenset(one.cell for one in placed if one.fate == "fought"),
        fell=frozenset(one.cell for one in placed if one.fate == "fell"),
        captured=frozenset(one.cell for one in placed if one.fate == _CAPTURED),
        graves=frozenset(one.cell for one in placed if not one.lives),
        is_event=any(one.fate for one in placed),
    )


def scenes_of_transcript(transcript: Transcript) -> Iterator[Scene]:
    """Yield every tick that a seat was shown, with what it ordered."""
    header = transcript.header
    memory, before = GroundMemory(header.ruleset.side), None
    seat = f"pit {header.pit}, match {header.match}: {header.name} plays {header.team.name.lower()} against {header.opponent}"
    for number, seen in enumerate(transcript.observations()):
        facts = f"tick {number} of {header.ruleset.tick_limit}   score {seen.score:+d}   units {seen.living[0]}:{seen.living[1]}"
        if seen.clock_s is not None:
            facts += f"   bank {seen.clock_s:.1f} s"
        charged_us = transcript.charges_us[number]
        if charged_us is not None:
            facts += f"   charged {charged_us / 1e6:.3f} s"
        scene = _scene_of_seat(seen, before, memory, transcript.ticks[number][1], f"{clean(seat)}\n{facts}")
        notes = transcript.annotations[number]
        yield replace(scene, log=tuple(notes["log"]), drawings=notes["draw"])
        before = seen


def _scene_of_seat(seen: Observation, before: Observation | None, memory: GroundMemory, orders: bytes, title: str) -> Scene:
    fell = find_losses(before, seen)
    placed = [
        _Placed(seen.team, unit.index, unit.flies, (unit.row, unit.column), unit.alive, "fell" if unit in fell else "")
        for unit in seen.units
    ]
    units = [
        UnitLine(team=seen.team, name=name_unit(unit), order=name_order(order) if unit.alive else "fallen", fate=one.fate)
        for unit, order, one in zip(seen.units, orders, placed, strict=True)
    ]
    grid = seen.grid
    known, is_hidden = memory.recall(seen)
    numbers = _number(placed, grid, (seen.team,))
    return Scene(
        tick=seen.tick,
        title=title,
        panes={
            pane_of(seen.team): Pane(grid=grid, numbers=numbers, is_drawn_on=True),
            REMEMBERED: Pane(grid=known, numbers=numbers, dimmed=is_hidden, is_drawn_on=True),
        },
        units=tuple(units),
        fell=frozenset(one.cell for one in placed if one.fate),
        graves=frozenset(one.cell for one in placed if not one.lives),
        is_event=before is not None and (bool(fell) or before.score != seen.score or before.living != seen.living),
    )


class _Placed(NamedTuple):
    """A unit on the board."""

    team: Team
    number: int
    flies: bool
    cell: Cell
    lives: bool
    fate: str


def _number(placed: Sequence[_Placed], grid: NDArray[np.int8], teams: tuple[Team, ...]) -> dict[Cell, int]:
    """Return the numbers of those units of some teams that a board shows; of several in a cell it shows the first."""
    codes = (UGVS, UAVS)
    shown = [one for one in placed if one.lives and one.team in teams and grid[one.cell] == codes[one.flies][one.team]]
    return {one.cell: one.number for one in reversed(shown)}


def _name_mark(mark: Mark) -> str:
    return f" ({mark.name.lower()})" if mark and mark.name else ""
