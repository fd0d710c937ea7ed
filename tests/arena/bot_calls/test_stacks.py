"""Where a bot is, in words."""

import pytest

from arena.bot_calls import stacks

ASKED = ("/arena/asks.py", 7, "_call")


def test_a_stack_is_told_from_the_bot_s_own_file_inwards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stacks, "OURS", {ASKED[0]})
    inner = [("/lib/deep.py", n, f"f{n}") for n in range(9, 0, -1)]

    told = stacks.describe_stack(
        "tick 3 of match m as blue", [*inner, ("/my/bot.py", 5, "act"), ASKED, ("/arena/venue.py", 1, "<module>")]
    )

    assert told.splitlines() == [
        "bot.py is at tick 3 of match m as blue: line 5 in act",
        "    ...",
        *(f"    deep.py, line {n} in f{n}" for n in range(5, 10)),
    ]


def test_of_a_program_it_is_told_what_it_was_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stacks, "OURS", {ASKED[0]})

    assert (
        stacks.describe_stack("tick 3 of match m as blue", [ASKED])
        == "a bot was asked at tick 3 of match m as blue, and has not answered"
    )
