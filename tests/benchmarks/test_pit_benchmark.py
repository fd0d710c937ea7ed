"""The benchmark of a pit: what it gives, tried with sizes that measure nothing."""

from collections.abc import Callable

import pytest

from arena.errors import InputError
from benchmarks import pit


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("RUN_S", 0.2), ("_WARM_S", 0.1), ("_RUNS", 1), ("_FIRST", 1)):
        monkeypatch.setattr(pit, name, value)


def test_bare_zenoh_turns_as_a_pit_does() -> None:
    seen = pit._measure_bare(2)

    assert seen["turns_per_s"] > 0
    assert 0 < seen["p50_ms"] <= seen["p99_ms"]


def test_a_pit_is_measured_as_fast_as_can_be_and_under_a_clock(size: Callable[[int, int], int]) -> None:
    if size(0, 1) == 0:
        pytest.skip("it starts several pits")
    results = pit.run(lambda _: None, matches="2", workers=2, turn_time=0.2)

    found = results["matches_2"]
    assert found["as_fast_as_can_be"]["ratio"] > 0
    assert found["under_a_clock"]["turns_per_s"] > 0
    assert found["under_a_clock"]["late_by_the_load"] + 10 > found["under_a_clock"]["late"]
    assert "kb_a_match" in found["under_a_clock"]


@pytest.mark.parametrize("text", ["", "0", "1,", "1;2", "many", "10001", "-1", "1.5"])
def test_matches_that_cannot_be_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"it must be numbers of matches from 1 to 10000, as in 1,8,64$"):
        pit.read_numbers(text)

    assert pit.read_numbers("1, 8,64") == [1, 8, 64]
