"""What a page is told of a tick: what happened in it, as the game says, and as far as a spectator can know."""

import json
from typing import Any

import numpy as np
import pytest
from worlds import lay, random_orders, rules_for

from arena.display.frame import describe_rules, find_events, orders_to_text
from arena.game.engine import BatchedGame
from arena.game.ruleset import load
from arena.game.types import Team

CROWD = """
    . . U . u . . f
    . U . . u . . .
    . . U # . u . .
    . U . . . u . .
    . . . U u . . .
    . . . . . # . .
    . U # . u . . .
    F . . A a . . .
"""


def units_of(games: BatchedGame) -> list[list[tuple[int, int, bool]]]:
    every = [
        (*divmod(int(cell), games.ruleset.side), bool(alive))
        for cell, alive in zip(games.state.cell[0], games.state.alive[0], strict=True)
    ]
    return [every[: games.n_units[Team.BLUE]], every[games.n_units[Team.BLUE] :]]


@pytest.mark.parametrize("base", ["paper", "gym-cap"])
def test_a_spectator_finds_the_fights_and_falls_that_the_game_reports(base: str) -> None:
    rng, kinds = np.random.default_rng(0), set()
    for seed in range(20):
        games = lay(rules_for(CROWD, base), seed=seed)
        for _ in range(12):
            before = units_of(games)
            is_running = not games.is_over[0]
            games.step(random_orders(rng, games))
            found: dict[str, Any] = dict(find_events(games.ruleset, before, units_of(games)))
            for name in ("fought", "fell") if is_running else ():
                flags = getattr(games.events, name)[0]
                n_blue = games.n_units[Team.BLUE]
                told = [(int(unit >= n_blue), unit - n_blue * (unit >= n_blue)) for unit in np.flatnonzero(flags).tolist()]
                assert found[name] == told
                kinds |= {name} if told else set()

    assert kinds == {"fought", "fell"}


def test_nothing_has_happened_before_the_first_tick() -> None:
    games = lay(rules_for(CROWD))

    assert not np.concatenate(games.events).any()
    assert find_events(games.ruleset, None, units_of(games)) == {"fought": [], "fell": [], "captured": []}


@pytest.mark.parametrize(("name", "reach"), [("paper", 4), ("gym-cap", 3)])
def test_the_rules_say_how_far_each_type_hits(name: str, reach: int) -> None:
    kinds = json.loads(json.dumps(describe_rules(load(name))))["kinds"]

    assert (kinds["ugv"]["reach"], kinds["uav"]["reach"]) == (reach, -1)


def test_an_order_is_told_as_what_it_comes_to() -> None:
    assert orders_to_text(bytes([0, 1, 2, 3, 4, 5, 255])) == "0123400"
