"""A fighter by itself, under rules that give red no units: how often it takes the flag, and how straight it goes there."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from arena.errors import InputError
from arena.game.engine import BatchedGame
from arena.game.keys import secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.state import StateField
from arena.game.types import Team, Termination
from arena.local.venue import play
from arena.records.plan import MatchPlan
from policies.registry import load_entry
from policies.tactics.paths import flood
from tournaments.evaluation.evaluate import CANDIDATE
from tournaments.fixture import plan_fixture


@dataclass(frozen=True, slots=True, kw_only=True)
class Alone:
    """How a fighter did with nobody in its way."""

    matches: int
    captures: int
    ticks: float
    """Mean length of a match."""
    shortest: float
    """Mean ticks that the unit nearest to the flag would have needed on the shortest way, over the same matches."""

    @property
    def detour(self) -> float:
        """Ticks taken for each that was needed."""
        return self.ticks / self.shortest

    def to_dict(self) -> dict[str, Any]:
        """Return all of it, as JSON has it."""
        return {**asdict(self), "detour": self.detour}


def play_alone(
    ruleset: Ruleset, fighter: str, *, matches: int, seed: int, advance: Callable[[int], None], workers: int | None
) -> Alone:
    """Play some matches on maps that no training used; `advance` is told how many more were played.

    Raises
    ------
    InputError
        Blue has nobody who could walk to the flag.
    """
    if not any(unit.step and not unit.flies for unit in ruleset.team(Team.BLUE)):
        raise InputError(f"ruleset {ruleset.name}: blue has no unit that walks, so that nobody could take the flag")
    plans = plan_fixture("evaluation", CANDIDATE, CANDIDATE, matches, secret_from_seed(seed))[::2]
    captures = ticks = 0
    for record in play(ruleset, plans, partial(load_entry, {CANDIDATE: fighter}), n_workers=workers):
        captures += record.result.ending is Termination.CAPTURE
        ticks += record.result.ticks
        advance(1)
    return Alone(
        matches=matches, captures=captures, ticks=ticks / matches, shortest=float(np.mean(shortest_ways(ruleset, plans)))
    )


def shortest_ways(ruleset: Ruleset, plans: list[MatchPlan]) -> list[int]:
    """Return, for each match, the ticks of the shortest way to the flag from the nearest of blue's units on foot."""
    games, n_cells = BatchedGame(ruleset, len(plans)), ruleset.side**2
    games.start(range(len(plans)), [plan.keys for plan in plans])
    walkers = {index: unit.step for index, unit in enumerate(ruleset.team(Team.BLUE)) if unit.step and not unit.flies}
    far, work = np.zeros((len(plans), n_cells), np.int16), np.zeros((19, 64), np.uint64)
    nearest = []
    for game, fact in enumerate(games.state.field):
        flood(games.state.ground, game, ruleset.side, int(fact[StateField.RED_FLAG]), far, work)
        cells = games.state.cell[game]
        nearest.append(min(-(-int(far[game, cells[unit]]) // step) for unit, step in walkers.items()))
    return nearest
