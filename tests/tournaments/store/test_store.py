"""The store, on each of its databases: every match once, one scheduler to a league, whatever is killed."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace

import pytest
from outcomes import changed, ended

from arena.game.types import Team, Termination
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.store.store import Store, StoredLeague, TakenError

FACTS = {"ruleset": "paper", "rules": "1", "entries": {"a": "rush", "b": "patrol"}, "clock": {}}
PROGRAM = """
import sys
from tournaments.outcome import Outcome
from tournaments.store.store import Store
from arena.game.types import Termination
from arena.policy import MatchResult
FACTS = {"ruleset": "paper", "rules": "1", "entries": {}, "clock": {}}
def end(number):
    result = MatchResult(ending=Termination.TICK_LIMIT, winner=None, score=0, ticks=9)
    return Outcome(identity=f"friday/{number:04}", blue="a", red="b", result=result, seats={})
"""
RACE = """
print("ready", flush=True)
input()
with Store(sys.argv[1]) as store:
    league = store.enter("friday", FACTS, 2)
    print(sum(store.add(league, end(number)) for number in range(40)))
"""
HOLD = """
with Store(sys.argv[1]) as store, store.lock("friday"):
    print("held", flush=True)
    input()
"""


def end(number: int, identity: str = "", **changes: object) -> Outcome:
    """Return a match that ended."""
    seats = {team: SeatOutcome(faults={"late": 1}, latency_p50_s=0.001) for team in Team}
    outcome = ended(identity or f"friday/{number:04}", "a", "b", Team.RED, seats, score=-100, ticks=17)
    return changed(outcome, **changes)


@pytest.fixture
def store(store_url: str) -> Iterator[Store]:
    with Store(store_url) as store:
        yield store


@contextmanager
def start(code: str, url: str) -> Iterator[subprocess.Popen[str]]:
    """Run a program that uses a store, in a process of its own."""
    command = [sys.executable, "-c", PROGRAM + code, url]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def read_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def test_a_match_counts_once_and_is_told_as_it_was(store: Store) -> None:
    league = store.enter("friday", FACTS, 2)

    assert store.add(league, end(1))
    assert not store.add(league, end(1, winner=None))
    assert store.outcomes(league) == [end(1)]
    assert store.identities(league) == {"friday/0001"}
    with pytest.raises(ValueError, match="void"):
        store.add(league, end(2, ending=Termination.VOID))


def test_results_are_told_in_one_order_on_every_database(store: Store) -> None:
    league = store.enter("friday", FACTS, 2)
    names = ["b", "B", "a-b", "a_b", "aab", "A", "a/b"]

    for name in names:
        store.add(league, end(0, identity=name))

    assert [outcome.identity for outcome in store.outcomes(league)] == sorted(names)


def test_a_reason_may_quote_what_is_no_text(store: Store) -> None:
    league = store.enter("friday", FACTS, 2)

    store.add(league, end(1, reason="\0 and \ud800 and ü"))

    assert store.outcomes(league)[0].result.reason == "\N{REPLACEMENT CHARACTER} and ? and ü"


def test_a_league_keeps_its_row_and_the_last_that_was_run_comes_first(store: Store) -> None:
    friday = store.enter("friday", FACTS, 2)
    store.enter("monday", FACTS, 2)

    assert store.latest().name == "monday"
    assert store.enter("friday", FACTS, 3) == replace(friday, n_pairs=3)
    assert [league.name for league in store.leagues()] == ["friday", "monday"]


def test_a_league_that_was_edited_meanwhile_is_closed_as_it_is_now(store: Store) -> None:
    before = store.enter("friday", FACTS, 2)
    edited = store.enter("friday", {**FACTS, "entries": {**FACTS["entries"], "c": "patrol"}}, 2)

    closed = store.close(before, bytes(32))

    assert "c" in edited.definition["entries"]
    assert closed == store.get("friday") == replace(edited, secret=bytes(32))


def test_processes_that_make_a_store_at_once_make_one_and_store_each_match_once(store_url: str) -> None:
    with ExitStack() as stack:
        processes = [stack.enter_context(start(RACE, store_url)) for _ in range(4)]
        assert [read_line(process) for process in processes] == ["ready"] * 4
        for process in processes:
            assert process.stdin is not None
            process.stdin.write("go\n")
            process.stdin.flush()
        n_stored = [int(read_line(process)) for process in processes]
        assert [process.wait(timeout=60) for process in processes] == [0] * 4

    assert sum(n_stored) == 40
    with Store(store_url, make=False) as store:
        assert store.count(store.latest()) == 40


def test_a_lock_keeps_a_second_scheduler_off_a_league_and_no_other(store: Store, store_url: str) -> None:
    with Store(store_url) as other, store.lock("friday"), other.lock("monday"):
        for second in (store, other):
            with pytest.raises(TakenError, match="another scheduler runs league friday"), second.lock("friday"):
                pass
    with Store(store_url) as other, other.lock("friday"):
        pass


def test_a_lock_dies_with_its_process(store: Store, store_url: str) -> None:
    with start(HOLD, store_url) as holder:
        assert read_line(holder) == "held"
        with pytest.raises(TakenError), store.lock("friday"):
            pass
        holder.kill()
        holder.wait()
        take(store)


def take(store: Store) -> None:
    """Take the lock of a league whose holder died; a server needs a moment to notice."""
    for _ in range(1_000):
        try:
            with store.lock("friday"):
                return
        except TakenError:
            continue
    raise AssertionError("the lock outlives its process")


def test_a_league_is_written_by_who_holds_its_lock_and_read_by_all(store: Store, store_url: str) -> None:
    with store.lock("friday"), Store(store_url, make=False) as reader:
        league: StoredLeague = store.enter("friday", FACTS, 2)
        assert store.add(league, end(1))
        assert not store.add(league, end(1))
        assert reader.outcomes(reader.get("friday")) == [end(1)]
