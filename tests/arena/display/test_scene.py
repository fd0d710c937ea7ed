"""The ticks of a match as the player gets them: against the rules played again."""

from collections.abc import Callable

import numpy as np
import pytest
from worlds import lay, rules_for

from arena.display.scene import TRUTH, pane_of, scene_of_game, scenes_of_journal
from arena.game.ruleset import load
from arena.game.types import UAVS, UGVS, Team
from arena.local.venue import play_batch
from arena.records.journal import Journal, read_journal
from arena.records.plan import MatchPlan
from arena.records.replay import replay
from policies import registry

STACK = """
F....u
......
.A....
......
......
U....f
"""


@pytest.fixture(scope="module")
def journals(planned: Callable[..., MatchPlan]) -> list[Journal]:
    plans = [planned(f"scene/{number}", "rush", "squad") for number in range(6)]
    records = play_batch(load("paper"), plans, registry.load("rush"), registry.load("squad"))
    return [read_journal(record.journal or b"") for record in records]


def test_scenes_tell_what_the_rules_did(journals: list[Journal]) -> None:
    n_events = 0
    for journal in journals:
        for scene, games in zip(scenes_of_journal(journal), replay(journal), strict=True):
            events, alive = games.events, games.state.alive[0]
            told = {"fought": events.fought[0] & ~events.fell[0], "fell": events.fell[0], "captured the flag": events.captured[0]}
            for fate, flags in told.items():
                assert [unit.fate == fate for unit in scene.units] == (
                    flags & ~(told["captured the flag"] & (fate != "captured the flag"))
                ).tolist()
            assert scene.is_event == any(flags.any() for flags in told.values())
            assert [unit.order == "fallen" for unit in scene.units] == [not lives for lives in alive]
            n_events += scene.is_event
    assert n_events > 5


def test_orders_are_those_that_come_next(journals: list[Journal]) -> None:
    journal = journals[0]
    *scenes, last = scenes_of_journal(journal)

    words = ["stay", "north", "east", "south", "west"]
    for scene, tick in zip(scenes, journal.ticks, strict=True):
        told = [
            (unit.order, words[order]) for unit, order in zip(scene.units, tick.orders, strict=True) if unit.order != "fallen"
        ]
        assert all(said == played for said, played in told)
    assert {unit.order for unit in last.units} <= {"", "fallen"}


def test_a_number_is_of_the_unit_that_the_board_shows(journals: list[Journal]) -> None:
    n_numbers = 0
    for journal in journals:
        for scene, games in zip(scenes_of_journal(journal), replay(journal), strict=True):
            n_blue, side = games.n_units[Team.BLUE], games.ruleset.side
            for label, pane in scene.panes.items():
                for cell, number in pane.numbers.items():
                    team = Team.BLUE if pane.grid[cell] in (UGVS[Team.BLUE], UAVS[Team.BLUE]) else Team.RED
                    unit = number + n_blue * (team is Team.RED)
                    assert divmod(int(games.state.cell[0, unit]), side) == cell
                    assert games.state.alive[0, unit]
                    assert label in (TRUTH, pane_of(team))
                    n_numbers += 1
    assert n_numbers > 100


def test_an_order_that_did_not_count_says_why() -> None:
    games = lay(rules_for(STACK, uav={"sight": 1, "step": 1}))

    scene = scene_of_game(games, ("a\x1b", "b"), bytes([0, 1, 3]), (1, 2))

    assert [unit.order for unit in scene.units] == ["stay (late)", "north (late)", "south (unreadable)"]
    assert [unit.name for unit in scene.units] == ["ugv 0", "uav 1", "ugv 0"]
    assert scene.title.startswith(r"blue a\x1b against red b   tick 0 of 100")


def test_a_unit_that_stands_under_another_has_no_number() -> None:
    """Blue's UAV flies over its own UGV: the board shows the UGV, and so does the number."""
    games = lay(rules_for(STACK, uav={"sight": 1, "step": 1}))
    games.state.cell[0, 1] = games.state.cell[0, 0]

    scene = scene_of_game(games, ("a", "b"))

    assert scene.panes[TRUTH].numbers == {(5, 0): 0, (0, 5): 0}
    assert np.array_equal(scene.panes[TRUTH].grid, games.truth(0))
