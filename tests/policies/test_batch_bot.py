"""A file with a `BatchPolicy` plays many seats at once, as the same bot for one seat would, and fails as one would."""

from collections.abc import Callable
from pathlib import Path
from textwrap import dedent, indent

import numpy as np
import pytest

from arena.errors import PolicyError
from arena.game.keys import MatchKeys
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from arena.local.venue import MatchRecord, play
from arena.records.plan import MatchPlan
from policies import registry
from policies.batch_bot import GuardedBatch

SMALL = load_rules("paper").with_({"side": 10, "tick_limit": 15})
ALONE = "def act(observation): return [1 + (observation.tick // 3 + unit.index) % 4 for unit in observation.units]"
TOGETHER = """
import numpy as np
from arena.policy import BatchPolicy

class Together(BatchPolicy):
    sizes = []

    def act(self, observations, orders):
        self.sizes.append(len(observations))
        {}
"""
WALK = "orders[:] = 1 + (observations.tick[:, None] // 3 + np.arange(orders.shape[1])) % 4"
Played = Callable[[str], tuple[list[MatchRecord], type]]


@pytest.fixture
def played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Played:
    """Play 12 matches of a bot file, as blue, in this process; return their records, and what was loaded."""
    import sys

    monkeypatch.setattr(sys, "path", list(sys.path))

    def run(source: str) -> tuple[list[MatchRecord], type]:
        file = tmp_path / "mybot.py"
        file.write_text(source)
        loaded = []

        def load(name: str) -> object:
            loaded.append(registry.load(str(file) if name == "bot" else name))
            return loaded[-1]

        keys = [MatchKeys(map_key=bytes([n]) * 32, match_key=b"\x09" * 32) for n in range(12)]
        plans = [MatchPlan(identity=f"batch/{n:02}", blue="bot", red="rush", keys=one) for n, one in enumerate(keys)]
        records = list(play(SMALL, plans, load, n_workers=1))
        return sorted(records, key=lambda record: record.plan.identity), getattr(loaded[0], "make", object)

    return run


def together(act: str) -> str:
    return TOGETHER.format(indent(dedent(act), " " * 8).lstrip())


def test_it_plays_the_matches_that_the_same_bot_for_one_seat_plays_and_many_at_once(played: Played) -> None:
    alone, _ = played(ALONE)
    batch, kind = played(together(WALK))

    assert [record.journal for record in batch] == [record.journal for record in alone]
    assert set(kind.sizes) == {12}


def test_what_it_raises_costs_a_turn_of_its_seats_and_is_told_once_a_seat(played: Played) -> None:
    records, _ = played(together(f"{WALK}\nif (observations.tick == 4).any(): raise ValueError('lost')"))

    long = [record for record in records if record.result.ticks > 4]
    assert len(long) > 5
    for record in long:
        blue = record.faults[0]
        assert (blue.raised, blue.illegal, record.n_unreadable[0]) == (1, 0, 1)
        [(sentence, count)] = blue.reasons.values()
        assert (sentence, count) == ("tick 4: ValueError: lost (mybot.py, line 11); all its units stay", 1)
        assert "each_seat.py" not in (blue.first_traceback or "batch_bot.py")


def test_orders_that_are_none_cost_their_own_seat_alone(played: Played) -> None:
    records, _ = played(together(f"{WALK}\norders[3, 1] = 7\norders[4] = -1"))

    for number, record in enumerate(records):
        wrong = record.result.ticks if number in (3, 4) else 0
        assert record.n_unreadable[0] == record.faults[0].illegal == wrong
    [(sentence, _)] = records[3].faults[0].reasons.values()
    assert sentence == "tick 0: unit 1 is ordered 7, and an order is a number from 0 to 4; all its units stay"


def test_it_cannot_write_to_what_it_sees(played: Played) -> None:
    records, _ = played(together("observations.cell[:] = 0"))

    assert all("read-only" in sentence for record in records for sentence, _ in record.faults[0].reasons.values())
    assert all(record.faults[0].raised == record.result.ticks for record in records)


def test_a_policy_that_cannot_be_made_leaves_its_units_where_they_are(played: Played) -> None:
    records, _ = played(together(WALK) + "\n    def __init__(self, *seats): raise RuntimeError('no weights')\n")

    for record in records:
        assert record.n_unreadable[0] == record.result.ticks
        assert any("RuntimeError: no weights" in sentence for sentence, _ in record.faults[0].reasons.values())


def test_a_file_does_not_ask_to_see_the_whole_board(played: Played) -> None:
    with pytest.raises(PolicyError, match="Together sets is_cheat, which no bot file may"):
        played(together(WALK) + "\n    is_cheat = True\n")


@pytest.mark.parametrize("most", ["0", "-3", "2.5", "None", "'many'"])
def test_a_number_of_seats_that_is_none_is_refused_in_a_sentence(played: Played, most: str) -> None:
    with pytest.raises(PolicyError, match=f"Together sets most_seats to {most}; it must be a whole number from 1 on"):
        played(together(WALK) + f"\n    most_seats = {most}\n")


def test_one_seat_of_it_hears_its_match(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a pit, where each seat of each match has a process."""
    (tmp_path / "mybot.py").write_text(
        together("orders[:] = 0")
        + indent("def start(self, seats): self.told = [('start', seats.tolist())]\n", "    ")
        + indent("def end(self, seat, result): self.told.append(('end', seat))\n", "    ")
        + indent("def take_annotations(self, seat): return b'noted'\n", "    ")
    )
    import sys

    monkeypatch.setattr(sys, "path", list(sys.path))
    policy = registry.load(str(tmp_path / "mybot.py"))(SMALL, Team.BLUE, 1)
    assert isinstance(policy, GuardedBatch)
    policy.keeps_annotations = True
    policy.start(np.zeros(1, np.intp))
    policy.end(0, None)

    assert policy.take_annotations(0) == b"noted"
    assert policy._policy.told == [("start", [0]), ("end", 0)]
    assert policy._policy.keeps_annotations
