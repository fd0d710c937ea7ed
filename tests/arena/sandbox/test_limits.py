"""Limits as text."""

import pytest

from arena.errors import InputError
from arena.sandbox.limits import BEHIND_A_WALL, NO_LIMITS, Limits


def test_limits_are_changed_one_by_one() -> None:
    assert NO_LIMITS.with_(["memory_mb=500", "files=7"]) == Limits(memory_mb=500, files=7)
    assert BEHIND_A_WALL.with_(["cores=2"]).memory_mb == BEHIND_A_WALL.memory_mb
    assert NO_LIMITS.with_(BEHIND_A_WALL.assignments()) == BEHIND_A_WALL


@pytest.mark.parametrize(
    ("assignment", "says"),
    [
        ("memry_mb=5", "did you mean 'memory_mb'"),
        ("memory_mb=much", "must be a name and a whole number above 0"),
        ("memory_mb=0", "must be a name and a whole number above 0"),
        ("memory_mb", "must be a name and a whole number above 0"),
        ("memory_mb=99999999999", "must be a name and a whole number above 0"),
    ],
)
def test_what_is_no_limit_is_refused_in_a_sentence(assignment: str, says: str) -> None:
    with pytest.raises(InputError) as refused:
        NO_LIMITS.with_([assignment])

    assert says in str(refused.value)
