"""How many matches an entry plays at once: as many as the machine can think for."""

import pytest

from arena.match.time_control import TimeControl
from tournaments.running.slots import MOST, choose_slots, explain_slots

ONE_S = TimeControl(turn_time_s=1.0)


@pytest.mark.parametrize(
    ("think_s", "n_cores", "slots"),
    [
        ({}, 2, MOST),
        ({"quick": 0.001}, 2, MOST),
        ({"slow": 0.3}, 2, 3),  # three at once take 0.9 s of the 1 s that half of two processors give a turn
        ({"slow": 0.3}, 16, MOST),
        ({"slow": 0.3, "slower": 0.5}, 2, 1),
        ({"late": 2.0}, 2, 1),
    ],
)
def test_all_that_think_at_once_have_the_time_for_it(think_s: dict[str, float], n_cores: int, slots: int) -> None:
    assert choose_slots(think_s, ONE_S, n_cores) == slots


def test_who_has_all_the_time_in_the_world_plays_as_many_as_anybody() -> None:
    assert choose_slots({"late": 200.0}, TimeControl(turn_time_s=None), 1) == MOST


def test_it_is_said_who_is_slow_and_what_that_means() -> None:
    think_s = {"quick": 0.001, "slow": 0.3}

    assert explain_slots(MOST, think_s) == ""
    assert explain_slots(3, think_s).startswith("each entry plays 3 matches at once, since slow thinks for 0.3 s a turn;")
    assert explain_slots(1, think_s).startswith("each entry plays one match at once, since slow")
