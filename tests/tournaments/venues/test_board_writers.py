"""A bot that finds the board in the memory that it shares with it, and writes there."""

from collections.abc import Callable
from pathlib import Path

import pytest

from arena.errors import ArenaError
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.match.time_control import TimeControl
from tournaments.fixture import plan_fixture
from tournaments.venues import local
from tournaments.venues.setting import VenueSetting

RULES = load("paper").with_({"tick_limit": 30})
WRITER = """
import gc

def act(observation):
    if observation.tick == 2:
        for one in gc.get_objects():
            if type(one).__name__ == "BatchedGame":
                n = one.n_units[0]
                enemies = slice(n, None) if int(observation.team) == 0 else slice(0, n)
                one.state.alive[:, enemies] = 0
    return [0 for unit in observation.units]
"""
HONEST = "def act(observation):\n    return [0 for unit in observation.units]\n"
Make = Callable[[str, str], VenueSetting]


@pytest.fixture
def make(tmp_path: Path, one_core: None) -> Make:
    def write(name: str, source: str) -> VenueSetting:
        bot = tmp_path / f"{name}.py"
        bot.write_text(source)
        return VenueSetting(
            ruleset=RULES, entries={name: str(bot), "rush": "rush", "patrol": "patrol"}, time_control=TimeControl(), slots=1,
            journals=tmp_path / "journals", keys=tmp_path / "keys", homes=tmp_path / "homes",
        )  # fmt: skip

    return write


def test_what_a_bot_wrote_on_the_board_is_no_result(make: Make, tmp_path: Path) -> None:
    plans = plan_fixture("cup", "writer", "patrol", 1, secret_from_seed(1))

    with pytest.raises(ArenaError) as caught:
        list(local.play(make("writer", WRITER), plans))

    assert str(caught.value) in [
        f"match {plan.identity} is not stored, and the league stops: the journal does not verify: at tick 3 its orders or its "
        f"state were changed. The board was changed by {tmp_path}/writer.py; take it out of the league, or out of "
        '"trusted", so that it plays behind a wall'
        for plan in plans
    ]


def test_a_match_of_our_own_fighters_is_not_played_twice(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    checked: list[str] = []

    def check(*arguments: object) -> None:
        checked.append(str(arguments[2].identity))  # type: ignore[attr-defined]  # a plan

    monkeypatch.setattr(local, "check_journal", check)
    setting = make("honest", HONEST)
    ours, theirs = (plan_fixture("cup", name, "patrol", 1, secret_from_seed(1)) for name in ("rush", "honest"))

    assert len(list(local.play(setting, [*ours, *theirs]))) == 4
    assert sorted(checked) == sorted(plan.identity for plan in theirs)


def test_a_stranger_s_match_that_holds_is_stored(make: Make) -> None:
    plans = plan_fixture("cup", "honest", "rush", 2, secret_from_seed(1))

    told = list(local.play(make("honest", HONEST), plans))

    assert sorted(one.identity for one in told) == sorted(plan.identity for plan in plans)
