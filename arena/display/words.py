"""Units, orders and what befell a seat, in words."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from arena.display.seat_memory import find_losses
from arena.game.observation import EnemyUnit, Observation, OwnUnit
from arena.game.types import Action, Team, Termination

if TYPE_CHECKING:
    from arena.policy import MatchResult


def name_order(order: int) -> str:
    """Return an order, a byte as transcripts and journals hold it, as a word."""
    return Action(order).name.lower() if order in tuple(Action) else "nothing"


def name_unit(unit: OwnUnit) -> str:
    """Return a unit's type and number."""
    return f"{unit.type} {unit.index}"


def format_losses(seen: Sequence[Observation]) -> Iterator[str]:
    """Yield a line for each own unit that fell, with the enemies in sight when it was last told, and one on all sightings."""
    for before, after in pairwise(seen):
        for unit in find_losses(before, after):
            yield f"tick {after.tick}: {name_unit(unit)} fell at {_place(unit)}; in sight before: {_list(before.enemies)}"
    yield f"enemies were in sight at {_spans([one.tick for one in seen if one.enemies])}"


def format_last_tick(seen: Sequence[Observation], result: "MatchResult") -> str:
    """Return what the last tick changed, of which a seat is shown nothing: its last observation is of the tick before."""
    if result.ending in (Termination.FORFEIT, Termination.VOID):
        return f"the pit ruled: {result.reason or 'no reason given'}"
    if not seen:
        return "nothing was seen of this match"
    last, when = seen[-1], f"in tick {result.ticks}"
    won, lost = result.winner in (None, last.team), result.winner in (None, last.team.other)
    parts = []
    if result.ending is Termination.CAPTURE:
        if lost:
            parts.append(f"the own flag{_flag(seen, last.team)} was captured; {_captor(seen)}")
        if won:
            parts.append(f"the enemy's flag{_flag(seen, last.team.other)} was captured")
    elif result.ending is Termination.ELIMINATION:
        if lost:
            fallen = [unit for unit in last.units if unit.alive and not unit.flies]
            parts.append(f"the last own units fell: {_list(fallen)}; in sight before: {_list(last.enemies)}")
        if won:
            parts.append("the last enemy units fell")
    else:
        own, enemy = last.living
        change = "stayed at" if result.score == last.score else f"went from {last.score:+d} to"
        parts.append(f"the tick limit came, the score {change} {result.score:+d}; {own} own and {enemy} enemy units lived before")
    if last.tick + 1 < result.ticks:
        parts.append(f"the last that the seat was shown is tick {last.tick}")
    return f"{when} {'; '.join(parts)}"


def _place(unit: OwnUnit | EnemyUnit) -> str:
    return f"({unit.row}, {unit.column})"


def _list(units: Sequence[OwnUnit | EnemyUnit]) -> str:
    named = ((name_unit(unit) if isinstance(unit, OwnUnit) else unit.type, _place(unit)) for unit in units)
    return ", ".join(f"{name} at {place}" for name, place in named) or "nobody"


def _find_flag(seen: Sequence[Observation], team: Team) -> tuple[int, int] | None:
    return next((place for one in seen if (place := one.find_flag(team)) is not None), None)


def _flag(seen: Sequence[Observation], team: Team) -> str:
    place = _find_flag(seen, team)
    return ", which was never in sight," if place is None else f" at {place}"


def _captor(seen: Sequence[Observation]) -> str:
    """Return who stood a step from the own flag in the last observation."""
    place = _find_flag(seen, seen[-1].team)
    walkers = [unit for unit in seen[-1].enemies if not unit.flies]
    beside = [] if place is None else [one for one in walkers if abs(one.row - place[0]) + abs(one.column - place[1]) <= 1]
    return f"in sight beside it before: {_list(beside)}"


def _spans(ticks: Sequence[int]) -> str:
    """Return ticks as spans: "ticks 3 to 7, 9"."""
    known = set(ticks)
    starts, ends = ([tick for tick in ticks if tick + step not in known] for step in (-1, 1))
    spans = [str(start) if start == end else f"{start} to {end}" for start, end in zip(starts, ends, strict=True)]
    return f"{'tick' if len(known) == 1 else 'ticks'} {', '.join(spans)}" if spans else "no tick"
