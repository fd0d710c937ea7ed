"""Strangers behind walls in the venue `local`: they are kept away from the board, and what they meet is counted against them."""

from pathlib import Path

import pytest

import arena.sandbox.process
from arena.errors import InputError
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.game.types import Team
from arena.match.time_control import TimeControl
from arena.sandbox.limits import BEHIND_A_WALL, NO_LIMITS
from arena.sandbox.process import Sandbox
from tournaments.fixture import plan_fixture
from tournaments.outcome import Outcome
from tournaments.venues import local
from tournaments.venues.setting import VenueSetting

RULES = load("paper").with_({"tick_limit": 12})
BOTS = {
    "spy": """
import gc, pathlib
def act(observation):
    if any(type(one).__name__ == "BatchedGame" for one in gc.get_objects()) or pathlib.Path({home!r}).exists():
        raise SystemExit("seen")
    return [1] * len(observation.units)
""",
    "hog": """
def act(observation):
    if observation.tick == 3:
        bytearray(1 << 30)
    return [0] * len(observation.units)
""",
    "stuck": """
import time
def act(observation):
    while observation.tick == 5:
        time.sleep(1)
    return [0] * len(observation.units)
""",
    "wrong": """
def act(observation):
    return [1 / 0] * len(observation.units)
""",
}


def make_setting(folder: Path, *names: str, has_wall: bool = True) -> VenueSetting:
    (folder / "notes").touch()
    for name in names:
        (folder / f"{name}.py").write_text(BOTS[name].replace("{home!r}", repr(str(folder / "notes"))))
    sandbox = Sandbox(has_wall=has_wall, limits=BEHIND_A_WALL.with_(["memory_mb=400"]) if has_wall else NO_LIMITS)
    return VenueSetting(
        ruleset=RULES, entries={name: str(folder / f"{name}.py") for name in names} | {"rush": "rush"},
        time_control=TimeControl(turn_time_s=0.5, bank_s=0.5), slots=1, journals=folder / "journals", keys=folder / "keys",
        homes=folder / "homes", sandboxes=dict.fromkeys(names, sandbox),
    )  # fmt: skip


def play(setting: VenueSetting, name: str) -> Outcome:
    [outcome] = local.play(setting, plan_fixture("walls", name, "rush", 1, secret_from_seed(1))[:1])
    return outcome


def faults(outcome: Outcome, name: str) -> dict[str, int]:
    return outcome.seats[Team.BLUE if outcome.blue == name else Team.RED].faults


@pytest.mark.usefixtures("one_core")
def test_a_stranger_sees_neither_the_board_nor_files_and_whoever_is_trusted_plays_beside_the_board(tmp_path: Path) -> None:
    behind, beside = (play(make_setting(tmp_path, "spy", has_wall=has_wall), "spy") for has_wall in (True, False))

    assert faults(behind, "spy") == {}
    assert behind.identity == beside.identity


@pytest.mark.usefixtures("one_core")
def test_limits_and_turns_without_an_answer_and_exceptions_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    setting = make_setting(tmp_path, "hog", "stuck", "wrong")
    hog, wrong = play(setting, "hog"), play(setting, "wrong")
    monkeypatch.setattr(local, "TURN_S", 0.1)
    stuck = play(setting, "stuck")

    assert faults(hog, "hog") == {"unreadable": hog.result.ticks - 3, "memory limit": 1}
    assert faults(stuck, "stuck") == {"unreadable": stuck.result.ticks - 5, "late": 1}
    assert faults(wrong, "wrong") == {"unreadable": wrong.result.ticks}
    assert not any(faults(outcome, "rush") for outcome in (hog, stuck, wrong))


def test_where_no_wall_can_be_built_it_is_said_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arena.sandbox.process, "why_no_wall", lambda: "bubblewrap is missing")

    with pytest.raises(InputError, match=r"^no sandbox can be made: bubblewrap is missing; or go without it") as error:
        play(make_setting(tmp_path, "wrong"), "wrong")

    assert "\n" not in str(error.value)
