"""Playing a journal again gives the match that was played, tick by tick."""

from collections.abc import Callable

import numpy as np
import pytest

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import RULESETS, Ruleset, load
from arena.game.state import StateField
from arena.game.types import Team, Termination
from arena.local.venue import MatchRecord, play_batch
from arena.policy import BatchFactory, MatchResult
from arena.records.journal import read_journal, write_ending
from arena.records.plan import MatchPlan
from arena.records.replay import BrokenChainError, match_result, replay, verify
from policies import registry


def test_it_yields_the_start_and_every_tick(small_rules: Ruleset, played: Callable[..., MatchRecord]) -> None:
    record = played(small_rules)
    assert record.journal is not None

    ticks = [int(games.state.field[0, StateField.TICK]) for games in replay(read_journal(record.journal))]

    assert ticks == list(range(record.result.ticks + 1))


def test_it_ends_as_the_match_did(small_rules: Ruleset, played: Callable[..., MatchRecord]) -> None:
    for number in range(20):
        record = played(small_rules, f"small/{number}")
        assert record.journal is not None

        *_, games = replay(read_journal(record.journal))

        assert match_result(games, 0) == record.result


def test_the_same_states_come_back(planned: Callable[..., MatchPlan]) -> None:
    """What a replay shows is compared with games that are stepped beside it, not with the chain."""
    rules, rush = load("paper"), registry.load("rush")
    [record] = play_batch(rules, [planned("paper/0")], rush, rush)
    assert record.journal is not None
    journal = read_journal(record.journal)
    games = BatchedGame(rules, 1)
    games.start([0], [record.plan.keys])

    for number, again in enumerate(replay(journal)):
        assert (again.digestible() == games.digestible()).all()
        assert (again.grids() == games.grids()).all()
        if number < len(journal.ticks):
            games.step(np.frombuffer(journal.ticks[number].orders, np.int8)[None])


@pytest.mark.parametrize("fighter", registry.SCRIPTS)  # a journal holds orders, however long somebody thought about them
@pytest.mark.parametrize("name", RULESETS)
def test_every_journal_of_every_fighter_verifies(
    name: str, fighter: str, planned: Callable[..., MatchPlan], size: Callable[[int, int], int]
) -> None:
    plans = [planned(f"{name}/{fighter}/{number}") for number in range(size(4, 200))]

    for record in play_batch(load(name), plans, registry.load(fighter), registry.load("random")):
        assert record.journal is not None
        assert verify(read_journal(record.journal)) == record.result.ticks


def test_the_canonical_bytes_are_kept(every_tick: Callable[[list[int]], BatchFactory]) -> None:
    """Another hash here means that old journals no longer verify: RULES_VERSION or the journal's first line must rise."""
    plan = MatchPlan(identity="fixed", blue="a", red="b", keys=MatchKeys(map_key=bytes(32), match_key=bytes(range(32))))
    [record] = play_batch(load("paper"), [plan], every_tick([1, 2, 3, 4, 2, 4]), every_tick([2, 2, 4, 4, 1, 3]))
    assert record.journal is not None

    assert read_journal(record.journal).canonical_hash == "a145783811ad840abe6375936463280d365a346d29045080785f48a5e649d690"


def test_a_ruled_ending_may_come_before_the_game_s_own(small_journal: bytes) -> None:
    journal = read_journal(small_journal)
    first_ticks = small_journal[: small_journal.index(journal.ticks[1].chain) + 32]
    forfeit = MatchResult(ending=Termination.FORFEIT, winner=Team.RED, score=-100, ticks=2, reason="blue vanished")
    wrong = MatchResult(ending=Termination.FORFEIT, winner=Team.RED, score=-100, ticks=3, reason="blue vanished")

    assert verify(read_journal(first_ticks + write_ending(journal.ticks[1].chain, forfeit))) == 2
    with pytest.raises(BrokenChainError, match="its ending was changed"):
        verify(read_journal(first_ticks + write_ending(journal.ticks[1].chain, wrong)))


def test_a_claimed_end_that_the_rules_do_not_know_is_refused(small_journal: bytes) -> None:
    journal = read_journal(small_journal)
    first_ticks = small_journal[: small_journal.index(journal.ticks[0].chain) + 32]
    claimed = MatchResult(ending=Termination.CAPTURE, winner=Team.RED, score=-100, ticks=1)

    with pytest.raises(BrokenChainError, match="it claims an ending at tick 1, and the match goes on there"):
        verify(read_journal(first_ticks + write_ending(journal.ticks[0].chain, claimed)))
