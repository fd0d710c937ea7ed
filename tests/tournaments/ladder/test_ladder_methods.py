"""Which ladders there are."""

from importlib.metadata import EntryPoint

import pytest

from arena.errors import UnknownNameError
from tournaments import plug_ins
from tournaments.ladder import methods
from tournaments.ladder.ladder import open_ladder
from tournaments.ladder.methods import find_ladder


def test_our_own_ladder_is_there_beside_those_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    glicko = EntryPoint("glicko", "json:loads", methods.GROUP)
    monkeypatch.setattr(plug_ins, "entry_points", lambda group: [glicko] if group == methods.GROUP else [])

    assert find_ladder() is open_ladder
    assert find_ladder("glicko") is glicko.load()


def test_a_ladder_that_nobody_installed_is_named_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="unknown ladder 'openskil'; did you mean 'openskill'"):
        find_ladder("openskil")
