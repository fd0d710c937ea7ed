"""Fair clocks: who thinks within its time is never late, however many of its matches run at once, and nobody calls it gone."""

from collections import Counter
from pathlib import Path

import pytest

from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.game.types import Team, Termination
from arena.match.time_control import TimeControl
from tournaments.fixture import plan_fixture
from tournaments.outcome import Outcome
from tournaments.venues.network import play
from tournaments.venues.setting import VenueSetting

RULES = load("paper").with_({"tick_limit": 12})
SLOW = """
import time
def act(seen):
    time.sleep({seconds})
    return [(seen.tick + unit) % 5 for unit in range(len(seen.units))]
"""


def play_slow(folder: Path, seconds: str, slots: int, time_control: TimeControl) -> tuple[list[Outcome], Counter[str]]:
    """Let a slow bot play `rush` in so many matches at once; return how they ended, and what was counted of it."""
    (folder / "slow.py").write_text(SLOW.format(seconds=seconds))
    setting = VenueSetting(
        ruleset=RULES, entries={"rush": "rush", "slow": str(folder / "slow.py")}, time_control=time_control, slots=slots,
        journals=folder / "journals", keys=folder / "keys", homes=folder / "homes",
    )  # fmt: skip
    plans = plan_fixture("clocks", "rush", "slow", max(slots // 2, 1), secret_from_seed(3))
    outcomes = list(play(setting, plans))
    faults: Counter[str] = Counter()
    for outcome in outcomes:
        faults.update(outcome.seats[Team.BLUE if outcome.blue == "slow" else Team.RED].faults)
    return outcomes, faults


@pytest.mark.parametrize("slots", [1, 4, 16])
def test_who_takes_a_third_of_its_time_is_never_late_at_any_number_of_slots(slots: int, tmp_path: Path) -> None:
    outcomes, faults = play_slow(tmp_path, "0.3", slots, TimeControl(turn_time_s=1.0, bank_s=10.0))

    assert len(outcomes) == max(slots // 2, 1) * 2
    assert faults == {}
    assert not any(outcome.result.ending is Termination.FORFEIT for outcome in outcomes)
    # One after the other, sixteen seats would have answered after 4.8 s.
    assert max(seat.latency_p50_s or 0.0 for outcome in outcomes for seat in outcome.seats.values()) < 1.0


def test_who_thinks_for_longer_than_a_client_is_silent_is_late_and_never_gone(tmp_path: Path) -> None:
    seconds = "6.0 if seen.tick == 2 else 0"

    _, faults = play_slow(tmp_path, seconds, 2, TimeControl(turn_time_s=1.0, bank_s=0.0))

    assert set(faults) == {"late"}
