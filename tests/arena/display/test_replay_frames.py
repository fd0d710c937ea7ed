"""A journal as frames: what a page is told is what the match, played again, was."""

from pathlib import Path

import numpy as np
import pytest

from arena.display.replay_frames import describe_match
from arena.errors import JournalError
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.game.types import Team
from arena.local.venue import play
from arena.records.journal import load_journal
from arena.records.replay import replay
from policies.registry import load as load_policy
from tournaments.fixture import plan_fixture

CODES = "?012345678"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    plans = plan_fixture("friday", "rush", "random", 1, secret_from_seed(3))[:1]
    list(play(load("paper"), plans, load_policy, journals=tmp_path, n_workers=1))
    (path,) = tmp_path.glob("*.journal")
    return path


def test_every_tick_is_told_as_it_was(file: Path) -> None:
    journal = load_journal(file)
    told = describe_match(file.read_bytes())

    assert told["broken"] is None
    assert told["names"] == [journal.header.blue, journal.header.red]
    assert journal.ending is not None
    assert told["ending"] == journal.ending.to_dict()
    assert len(told["ticks"]) == len(journal.ticks) + 1
    told_orders = [tick["orders"] and "".join(tick["orders"]) for tick in told["ticks"]]
    assert told_orders == [*("".join(map(str, tick.orders)) for tick in journal.ticks), None]
    living = [[1] * 6] * 2
    for tick, games in zip(told["ticks"], replay(journal), strict=True):
        before, living = living, [[alive for _, _, alive in team] for team in tick["units"]]
        fell = [[team, unit] for team in Team for unit in range(6) if before[team][unit] and not living[team][unit]]
        assert tick["events"]["fell"] == fell
        assert all(unit in tick["events"]["fought"] for unit in fell)
        assert bool(tick["events"]["captured"]) == (told["ending"]["ending"] == "capture" and tick is told["ticks"][-1])
        boards = [games.truth(0), *(games.grids()[team, 0] for team in Team)]
        for text, board in zip([tick["truth"], *tick["seen"]], boards, strict=True):
            assert np.array_equal(np.array([CODES.index(letter) - 1 for letter in text]), board.ravel())
        units = [(row * 20 + column, alive) for team in tick["units"] for row, column, alive in team]
        assert units == list(zip(games.state.cell[0].tolist(), games.state.alive[0].tolist(), strict=True))


def test_a_journal_that_was_changed_is_told_up_to_there(file: Path) -> None:
    journal, data = load_journal(file), file.read_bytes()

    told = describe_match(data.replace(journal.ticks[3].chain, bytes(32)))

    assert told["broken"]["tick"] == 4
    assert [tick["tick"] for tick in told["ticks"]] == [0, 1, 2, 3]


def test_a_match_that_is_not_over_is_not_told(file: Path) -> None:
    data = file.read_bytes()
    last = load_journal(file).ticks[-1].chain

    with pytest.raises(JournalError, match="the match is not over"):
        describe_match(data[: data.index(last) + len(last)])
