"""The state machine, without a network and without a clock: time is what a test says it is."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import JournalError
from arena.game.keys import MatchKeys
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team, Termination
from arena.match.effects import Ask, Effect, End, Publish, Write
from arena.match.match import WIN, Match, Phase
from arena.match.time_control import TimeControl
from arena.protocol.observation_codec import ObservationReader
from arena.records.journal import Header, Journal, Mark, read_journal, whole_part
from arena.records.replay import verify

BLUE, RED = Team
N_UNITS = 3
SMALL = load("paper").with_(
    {
        "side": 8,
        "tick_limit": 6,
        "obstacles": False,
        "units": {"ugv": {"blue": 2, "red": 2, "attack": 0}, "uav": {"blue": 1, "red": 1}},
    }
)
"""Two walkers that cannot fight, and an eye; six ticks."""
HEADER = Header(
    identity="test/0", blue="ann", red="bob", ruleset=SMALL, keys=MatchKeys(map_key=bytes(32), match_key=b"\x01" * 32)
)
TERMS = TimeControl(turn_time_s=1.0, bank_s=2.0, grace_s=10.0, most_missed=3)
STAY = bytes(N_UNITS)


class Table:
    """A match, all that it ordered to be done, and the journal that came of it."""

    def __init__(self, *, time_control: TimeControl = TERMS, ruleset: Ruleset = SMALL, now_s: float = 0.0) -> None:
        self.match = Match(replace(HEADER, ruleset=ruleset), time_control, now_s)
        self.journal = self.match.start_record
        self.events: list[Effect] = []

    def do(self, events: list[Effect]) -> list[str]:
        """Carry out events, and return them in words."""
        self.events += events
        self.journal += b"".join(event.data for event in events if isinstance(event, Write))
        return [word(event) for event in events]

    def begin(self, now_s: float = 0.0) -> "Table":
        for team in Team:
            self.do(self.match.ready(team, now_s))
        return self

    def play(self, now_s: float, blue: bytes = STAY, red: bytes = STAY) -> list[str]:
        """Let both answer the current tick at once."""
        tick = self.match.tick
        self.do(self.match.submit(BLUE, tick, blue, now_s))
        return self.do(self.match.submit(RED, tick, red, now_s))

    def read(self) -> Journal:
        return read_journal(self.journal)

    def clock_s(self, team: Team) -> float | None:
        """Return the clock that a team was shown last."""
        shown = [event for event in self.events if isinstance(event, Ask) and event.team is team][-1]
        return (
            ObservationReader(self.match.header.ruleset, team).read(shown.observation).seat(0, self.match.header.ruleset).clock_s
        )

    def cells(self) -> list[int]:
        return [int(cell) for team in Team for cell in self.match._games.observe()[team].cell[0]]


def word(event: Effect) -> str:
    if isinstance(event, Ask):
        return f"ask {event.team.name.lower()} {event.tick}"
    return type(event).__name__.lower()


# Before the first tick


def test_nobody_is_asked_before_both_are_ready() -> None:
    table = Table()

    assert table.do(table.match.ready(RED, 1.0)) == []
    assert table.do(table.match.ready(RED, 2.0)) == []
    assert table.match.phase is Phase.WAITING
    assert table.do(table.match.ready(BLUE, 3.0)) == ["ask blue 0", "ask red 0", "publish"]
    assert table.match.phase is Phase.PLAYING


def test_orders_before_the_match_begins_are_stale() -> None:
    table = Table()
    table.do(table.match.ready(RED, 0.0))

    table.do(table.match.submit(RED, 0, STAY, 0.0))

    assert table.match.record(RED).stale == 1


@pytest.mark.parametrize(("there", "winner"), [(BLUE, BLUE), (RED, RED), (None, None)])
def test_who_is_not_ready_in_time_forfeits(there: Team | None, winner: Team | None) -> None:
    table = Table()
    if there is not None:
        table.do(table.match.ready(there, 1.0))

    assert table.do(table.match.advance(9.9)) == []
    assert table.do(table.match.advance(10.0)) == ["write", "end"]

    result = table.match.result
    assert result is not None
    assert (result.ending, result.winner, result.ticks) == (Termination.FORFEIT, winner, 0)
    assert result.score == {BLUE: WIN, RED: -WIN, None: 0}[winner]
    assert (
        result.reason
        == {
            BLUE: "red did not get ready in time",
            RED: "blue did not get ready in time",
            None: "blue and red did not get ready in time",
        }[winner]
    )
    assert verify(table.read()) == 0


def test_a_seat_that_leaves_before_the_first_tick_must_get_ready_again() -> None:
    table = Table()
    table.do(table.match.ready(BLUE, 0.0))
    table.do(table.match.leave(BLUE, 1.0))

    assert table.do(table.match.ready(RED, 2.0)) == []
    assert table.do(table.match.ready(BLUE, 3.0)) == ["ask blue 0", "ask red 0", "publish"]


def test_the_grace_is_whole_again_once_the_match_begins() -> None:
    table = Table().begin(now_s=9.0)

    table.do(table.match.leave(BLUE, 9.0))

    assert table.do(table.match.advance(18.9)) == []
    assert table.do(table.match.advance(19.0)) == ["write", "end"]


# A tick


def test_a_tick_is_written_before_anybody_is_asked_for_the_next() -> None:
    table = Table().begin()

    assert table.do(table.match.submit(BLUE, 0, STAY, 0.1)) == []
    assert table.do(table.match.submit(RED, 0, STAY, 0.2)) == ["write", "ask blue 1", "ask red 1", "publish"]
    assert table.match.tick == 1


def test_a_match_ends_by_its_rules_and_its_journal_verifies() -> None:
    table = Table().begin()
    words = [table.play(now_s=float(tick)) for tick in range(6)]

    assert words[-1] == ["write", "write", "end"]
    assert table.match.result is not None
    assert (table.match.result.ending, table.match.result.ticks) == (Termination.TICK_LIMIT, 6)
    assert table.match.phase is Phase.OVER
    assert verify(table.read()) == 6
    assert isinstance(table.events[-1], End)


def test_after_the_end_nothing_happens_any_more() -> None:
    table = Table().begin()
    table.do(table.match.void("a test"))

    assert table.match.ready(BLUE, 1.0) == []
    assert table.match.leave(BLUE, 1.0) == []
    assert table.match.submit(BLUE, 0, STAY, 1.0) == []
    assert table.match.advance(1e9) == []
    assert not table.match.is_away(BLUE)
    assert not any(table.match.record(BLUE).faults().values()), "the ending crossed it on its way"


def test_the_public_facts_are_those_of_the_state() -> None:
    table = Table().begin()

    assert table.match.facts == (3, 3, 0)
    assert sum(isinstance(event, Publish) for event in table.events) == 1


def test_the_first_answer_counts_and_a_second_is_stale() -> None:
    table, other = Table().begin(), Table().begin()

    table.do(table.match.submit(BLUE, 0, b"\x01\x01\x01", 0.1))
    table.do(table.match.submit(BLUE, 0, b"\x03\x03\x03", 0.2))
    table.do(table.match.submit(RED, 0, STAY, 0.3))
    other.play(0.3, blue=b"\x01\x01\x01")

    assert table.journal == other.journal
    assert table.match.record(BLUE).stale == 1
    assert other.match.record(BLUE).stale == 0


@pytest.mark.parametrize("tick", [-1, 0, 2, 10**18, -(2**63)])
def test_orders_for_another_tick_are_ignored_and_counted(tick: int) -> None:
    table = Table().begin()
    table.play(0.0)

    assert table.do(table.match.submit(RED, tick, b"\x01\x01\x01", 0.1)) == []
    assert table.match.record(RED).stale == 1
    assert table.match.tick == 1


@pytest.mark.parametrize(
    ("given_orders", "played"),
    [
        (b"", [0, 0, 0]),
        (b"\x01", [1, 0, 0]),
        (b"\x01\x02\x03\x04", [1, 2, 3]),
        (b"\x01" * 60_000, [1, 1, 1]),
        (b"\x05\x02\x03", [0, 2, 3]),
        (b"\xff\xff\xff", [0, 0, 0]),
        (b"\x80\x7f\x04", [0, 0, 4]),
    ],
)
def test_orders_that_are_not_one_action_per_unit_let_those_units_stay(given_orders: bytes, played: list[int]) -> None:
    table = Table().begin()

    table.play(0.0, red=given_orders)

    tick = table.read().ticks[0]
    assert list(tick.orders) == [0, 0, 0, *played]
    assert tick.marks == (Mark(0), Mark.UNREADABLE)
    assert table.match.record(RED).faults() == {"late": 0, "unreadable": 1, "stale": 0, "garbled": 0, "forged": 0, "vanished": 0}


def test_a_mark_is_of_its_own_tick_alone() -> None:
    table = Table().begin()
    table.play(0.0, blue=b"")
    table.play(0.0)

    assert [tick.marks for tick in table.read().ticks] == [(Mark.UNREADABLE, Mark(0)), (Mark(0), Mark(0))]


def test_what_was_ordered_before_a_missing_answer_is_not_played_again() -> None:
    table = Table().begin()
    table.play(0.0, blue=b"\x01\x01\x01")
    table.play(0.0, blue=b"\x02")

    assert list(table.read().ticks[1].orders) == [2, 0, 0, 0, 0, 0]


def test_what_is_no_message_is_counted() -> None:
    table = Table().begin()

    table.match.count_garbled(RED)

    assert table.match.record(RED).garbled == 1


# Time


def test_a_late_seat_stays_and_the_match_goes_on() -> None:
    table = Table().begin()
    table.do(table.match.submit(BLUE, 0, b"\x01\x01\x01", 0.5))

    assert table.do(table.match.advance(2.99)) == []
    assert table.do(table.match.advance(3.0)) == ["write", "ask blue 1", "ask red 1", "publish"]

    tick = table.read().ticks[0]
    assert (list(tick.orders[3:]), tick.marks) == ([0, 0, 0], (Mark(0), Mark.LATE))
    assert table.match.record(RED).late == 1


@pytest.mark.parametrize("is_over", [False, True])
def test_the_answer_to_a_turn_that_was_ruled_late_counts_no_more_and_another_is_stale(is_over: bool) -> None:
    table = Table().begin()
    if is_over:  # else the match still waits for the other seat
        table.do(table.match.submit(BLUE, 0, STAY, 0.1))
    else:
        table.do(table.match.leave(BLUE, 0.1))
    table.do(table.match.advance(3.0))
    assert table.match.tick == is_over

    table.do(table.match.submit(RED, 0, b"\x01\x01\x01", 3.1))
    faults = {"late": is_over, "unreadable": 0, "stale": 0, "garbled": 0, "forged": 0, "vanished": 0}
    assert table.match.record(RED).faults() == faults
    table.do(table.match.submit(RED, 0, b"\x02\x02\x02", 3.2))

    assert table.match.record(RED).faults() == {**faults, "stale": 1}


def test_a_copy_of_orders_that_count_is_no_fault() -> None:
    table = Table().begin()
    for _ in range(3):
        table.do(table.match.submit(BLUE, 0, b"\x01\x09", 0.1))
    table.do(table.match.submit(RED, 0, STAY, 0.3))
    table.do(table.match.submit(BLUE, 0, b"\x01\x09", 0.4))

    assert table.match.record(BLUE).faults() == {
        "late": 0, "unreadable": 1, "stale": 0, "garbled": 0, "forged": 0, "vanished": 0
    }  # fmt: skip


# Seeing one's history again


def test_a_seat_that_catches_up_is_asked_when_it_is_ready_and_its_clock_starts_then() -> None:
    table = Table(time_control=replace(TERMS, grace_s=100.0)).begin()
    for _ in range(5):
        table.play(0.0)
    table.do(table.match.submit(BLUE, 5, STAY, 0.0))
    table.do(table.match.leave(RED, 0.0))

    assert table.do(table.match.catch_up(RED, 5, 50.0)) == []
    assert not table.match.is_away(RED)
    assert table.do(table.match.advance(54.9)) == []
    assert table.do(table.match.ready(RED, 54.9)) == ["ask red 5"]
    assert table.do(table.match.advance(57.8)) == []
    assert table.do(table.match.advance(57.9))[0] == "write"


def test_who_catches_up_for_longer_than_its_turn_time_for_each_tick_is_asked_ready_or_not() -> None:
    table = Table().begin()
    for _ in range(5):
        table.play(0.0)
    table.do(table.match.submit(BLUE, 5, STAY, 0.0))
    table.do(table.match.leave(RED, 0.0))
    table.do(table.match.catch_up(RED, 2, 1.0))

    assert table.do(table.match.advance(2.9)) == []
    assert table.do(table.match.advance(3.0)) == ["ask red 5"]
    assert table.do(table.match.advance(5.9)) == []
    assert table.do(table.match.advance(6.0))[0] == "write"


def test_who_comes_back_again_and_again_has_its_turn_time_for_each_tick_once() -> None:
    table = Table(time_control=replace(TERMS, grace_s=1e9)).begin()
    for _ in range(5):
        table.play(0.0)
    table.do(table.match.submit(BLUE, 5, STAY, 0.0))
    table.do(table.match.leave(RED, 0.0))
    for now_s in (10.0, 20.0):
        table.do(table.match.catch_up(RED, 5, now_s + 1.0))
        table.do(table.match.leave(RED, now_s + 3.0))

    assert table.do(table.match.catch_up(RED, 5, 30.0)) == []
    assert table.do(table.match.advance(30.9)) == []
    assert table.do(table.match.advance(31.0)) == ["ask red 5"]
    table.do(table.match.leave(RED, 31.0))
    assert table.do(table.match.catch_up(RED, 5, 32.0)) == ["ask red 5"]


def test_orders_of_a_seat_that_catches_up_count() -> None:
    table = Table().begin()
    table.play(0.0)
    table.do(table.match.catch_up(RED, 1, 0.0))
    table.do(table.match.submit(BLUE, 1, STAY, 0.5))

    assert table.do(table.match.submit(RED, 1, STAY, 0.5)) == ["write", "ask blue 2", "ask red 2", "publish"]


def test_a_resumed_match_waits_for_who_catches_up() -> None:
    table = Table().begin()
    for _ in range(3):
        table.play(0.0)
    resumed = resume(table.journal, TERMS, 100.0)

    resumed.do(resumed.match.ready(BLUE, 101.0))
    assert resumed.do(resumed.match.catch_up(RED, 3, 101.0)) == []
    assert resumed.do(resumed.match.advance(103.9)) == []
    assert resumed.do(resumed.match.advance(104.0)) == ["ask blue 3", "ask red 3", "publish"]


def test_without_a_clock_who_catches_up_is_waited_for() -> None:
    table = Table(time_control=replace(TERMS, turn_time_s=None)).begin()
    table.play(0.0)
    table.do(table.match.catch_up(RED, 1, 0.0))

    assert table.do(table.match.advance(1e9)) == []


def test_the_bank_pays_for_what_a_turn_takes_too_long_and_the_clock_is_shown() -> None:
    table = Table().begin()
    assert table.clock_s(BLUE) == 2.0

    table.do(table.match.submit(RED, 0, STAY, 0.9))
    table.do(table.match.submit(BLUE, 0, STAY, 1.5))

    assert table.clock_s(BLUE) == 1.5
    assert table.clock_s(RED) == 2.0


def test_an_empty_bank_leaves_the_turn_time() -> None:
    table = Table().begin()
    table.do(table.match.advance(3.0))
    assert table.clock_s(BLUE) == 0.0

    assert table.do(table.match.advance(3.99)) == []
    assert table.do(table.match.advance(4.0))[0] == "write"


def test_no_order_is_charged_more_than_the_bank_holds() -> None:
    table = Table().begin()

    table.play(now_s=50.0)

    assert table.clock_s(BLUE) == 0.0
    assert table.match.record(BLUE).latencies_s == [50.0]


def test_without_a_clock_nobody_is_ever_late() -> None:
    table = Table(time_control=replace(TERMS, turn_time_s=None)).begin()

    assert table.clock_s(BLUE) is None
    assert table.do(table.match.advance(1e9)) == []
    assert table.play(1e9) == ["write", "ask blue 1", "ask red 1", "publish"]
    assert table.clock_s(RED) is None


@pytest.mark.parametrize("idle", [(BLUE,), (RED,), (BLUE, RED)])
def test_turns_missed_in_a_row_forfeit(idle: tuple[Team, ...]) -> None:
    table = Table().begin()
    now_s = 0.0
    while table.match.phase is Phase.PLAYING:
        for team in set(Team) - set(idle):
            table.do(table.match.submit(team, table.match.tick, STAY, now_s))
        now_s += 3.0
        table.do(table.match.advance(now_s))

    result = table.match.result
    assert result is not None
    assert (result.ending, result.ticks) == (Termination.FORFEIT, 2)
    assert result.winner is (None if len(idle) == 2 else idle[0].other)
    assert "missed 3 turns in a row" in result.reason
    assert verify(table.read()) == 2


def test_an_answer_in_time_ends_a_row_of_missed_turns() -> None:
    table = Table().begin()
    now_s = 0.0
    for is_late in (True, True, False, True, True, False):
        if is_late:
            now_s += 3.0
            table.do(table.match.advance(now_s))
        else:
            table.play(now_s)

    assert table.match.result is not None
    assert table.match.result.ending is Termination.TICK_LIMIT
    assert table.match.record(BLUE).late == 4


def test_asking_to_be_asked_again_does_not_turn_back_the_clock() -> None:
    """A seat that says *ready* over and over would else think for ever."""
    table = Table().begin()
    table.do(table.match.submit(BLUE, 0, STAY, 0.0))

    assert table.do(table.match.ready(RED, 2.9)) == ["ask red 0"]
    assert table.do(table.match.advance(3.0))[0] == "write"
    assert table.match.record(RED).late == 1


def test_who_has_answered_is_not_asked_again() -> None:
    table = Table().begin()
    table.do(table.match.submit(BLUE, 0, STAY, 0.0))

    assert table.do(table.match.ready(BLUE, 0.5)) == []


# Leaving and coming back


def test_a_seat_that_comes_back_is_asked_and_its_clock_goes_on_where_it_stood() -> None:
    table = Table().begin()
    table.do(table.match.submit(BLUE, 0, STAY, 0.0))
    table.do(table.match.leave(RED, 0.5))
    assert table.match.is_away(RED)

    assert table.do(table.match.advance(9.0)) == []
    assert table.do(table.match.ready(RED, 9.5)) == ["ask red 0"]
    assert table.do(table.match.advance(11.9)) == []
    assert table.do(table.match.advance(12.0))[0] == "write"
    assert table.match.record(RED).faults() == {"late": 1, "unreadable": 0, "stale": 0, "garbled": 0, "forged": 0, "vanished": 1}


def test_leaving_and_coming_back_at_once_wins_no_time() -> None:
    table = Table().begin()
    table.do(table.match.submit(BLUE, 0, STAY, 0.0))
    for now_s in (0.9, 1.8, 2.7):
        table.do(table.match.leave(RED, now_s))
        table.do(table.match.ready(RED, now_s))

    assert table.do(table.match.advance(3.0))[0] == "write"


def test_the_clock_of_a_tick_that_began_while_a_seat_was_away_begins_when_it_is_back() -> None:
    table = Table().begin()
    table.do(table.match.submit(RED, 0, STAY, 0.0))
    table.do(table.match.leave(RED, 0.1))
    assert table.do(table.match.submit(BLUE, 0, STAY, 0.5)) == ["write", "ask blue 1", "publish"]
    table.do(table.match.submit(BLUE, 1, STAY, 0.6))

    assert table.do(table.match.ready(RED, 8.0)) == ["ask red 1"]
    assert table.do(table.match.advance(10.9)) == []
    assert table.do(table.match.advance(11.0))[0] == "write"


def test_grace_is_charged_in_total() -> None:
    table = Table(time_control=replace(TERMS, turn_time_s=None)).begin()
    table.do(table.match.leave(RED, 0.0))
    table.do(table.match.ready(RED, 6.0))
    table.do(table.match.leave(RED, 100.0))

    assert table.do(table.match.advance(103.9)) == []
    assert table.do(table.match.advance(104.0)) == ["write", "end"]
    assert table.match.result is not None
    assert (table.match.result.winner, table.match.result.reason) == (BLUE, "red did not come back in time")
    assert table.match.record(RED).vanished == 2


def test_leaving_twice_is_leaving_once() -> None:
    table = Table().begin()
    table.do(table.match.leave(RED, 0.0))
    table.do(table.match.leave(RED, 9.0))

    assert table.match.record(RED).vanished == 1
    assert table.do(table.match.advance(10.0)) == ["write", "end"]


def test_both_away_is_a_draw_whoever_left_first() -> None:
    table = Table().begin()
    table.do(table.match.leave(BLUE, 0.0))
    table.do(table.match.leave(RED, 9.0))

    table.do(table.match.advance(10.0))

    assert table.match.result is not None
    assert (table.match.result.ending, table.match.result.winner, table.match.result.score) == (Termination.FORFEIT, None, 0)
    assert verify(table.read()) == 0


def test_orders_of_a_seat_that_was_said_to_be_gone_bring_it_back() -> None:
    """Presence is a hint that can be forged or come late."""
    table = Table().begin()
    table.do(table.match.leave(RED, 0.0))

    table.do(table.match.submit(RED, 0, STAY, 1.0))

    assert not table.match.is_away(RED)
    assert table.do(table.match.submit(BLUE, 0, STAY, 1.0)) == ["write", "ask blue 1", "ask red 1", "publish"]


def test_history_is_what_was_shown_and_what_was_played() -> None:
    table = Table().begin()
    table.play(0.0, blue=b"\x01\x02\x03", red=b"\x04")
    table.play(0.0)

    for team, first in ((BLUE, b"\x01\x02\x03"), (RED, b"\x04\x00\x00")):
        shown = [event.observation for event in table.events if isinstance(event, Ask) and event.team is team]
        assert table.match.history(team, 0) == (shown[:2], [first, STAY])
        assert table.match.history(team, 1) == (shown[1:2], [STAY])
        assert table.match.history(team, 2) == ([], [])
        assert table.match.history(team, 10**30) == ([], [])


def test_history_says_the_time_that_each_turn_had_and_goes_on_for_who_comes_back_again() -> None:
    table = Table().begin()
    for at_s in (0.0, 1.5, 4.0):  # each turn takes longer than its time, and the bank pays
        table.play(at_s)
        for team in (BLUE, RED):
            shown = [event.observation for event in table.events if isinstance(event, Ask) and event.team is team]
            assert table.match.history(team, 0)[0] == shown[: table.match.tick]
    assert len({shown[:16] for shown in table.match.history(BLUE, 0)[0]}) == 3


def test_void_is_no_score() -> None:
    table = Table().begin()
    table.play(0.0)

    assert table.do(table.match.void("the pit burnt down")) == ["write", "end"]
    assert table.match.result is not None
    assert (table.match.result.ending, table.match.result.winner, table.match.result.score) == (Termination.VOID, None, 0)
    assert verify(table.read()) == 1


# A referee that was killed

ANSWERS = st.one_of(
    st.binary(min_size=N_UNITS, max_size=N_UNITS).map(lambda data: bytes(byte % 5 for byte in data)), st.binary(max_size=5)
)
SCRIPTS = st.lists(st.tuples(st.one_of(st.none(), ANSWERS), st.one_of(st.none(), ANSWERS)), min_size=6, max_size=6)
"""What each team answers at each tick; None comes too late."""


def follow(table: Table, script: list[tuple[bytes | None, bytes | None]], now_s: float = 0.0) -> None:
    """Play the rest of a script from where the match stands."""
    while table.match.phase is Phase.PLAYING:
        tick = table.match.tick
        for team, answer in zip(Team, script[tick], strict=True):
            if answer is not None:
                table.do(table.match.submit(team, tick, answer, now_s))
        if None in script[tick]:
            now_s += 100.0
            table.do(table.match.advance(now_s))


def resume(data: bytes, time_control: TimeControl, now_s: float) -> Table:
    """Return the match that a killed referee left behind."""
    table = Table(time_control=time_control, now_s=now_s)
    table.journal = whole_part(data)
    table.do(table.match.recover(read_journal(table.journal)))
    return table


@given(SCRIPTS, st.floats(0, 1))
def test_a_match_that_was_cut_anywhere_ends_with_the_same_journal(
    script: list[tuple[bytes | None, bytes | None]], part: float
) -> None:
    time_control = replace(TERMS, most_missed=100)
    whole = Table(time_control=time_control).begin()
    follow(whole, script)
    head = len(whole.match.start_record)

    resumed = resume(whole.journal[: head + int(part * (len(whole.journal) - head - 1))], time_control, now_s=1e6)
    if resumed.match.phase is not Phase.OVER:
        resumed.begin(now_s=1e6)
        follow(resumed, script, now_s=1e6)

    assert resumed.journal == whole.journal
    assert verify(resumed.read()) == whole.match.tick
    assert resumed.match.history(RED, 0)[1] == whole.match.history(RED, 0)[1]
    for team in Team:
        kept = ("late", "unreadable")
        assert [getattr(resumed.match.record(team), kind) for kind in kept] == [
            getattr(whole.match.record(team), kind) for kind in kept
        ]


@pytest.mark.parametrize("n_before", [1, 2])
def test_a_row_of_missed_turns_goes_on_where_the_pit_was_killed(n_before: int) -> None:
    table = Table().begin()
    now_s = 0.0
    for _ in range(n_before):
        table.do(table.match.submit(BLUE, table.match.tick, STAY, now_s))
        now_s += 100.0
        table.do(table.match.advance(now_s))

    resumed = resume(table.journal, TERMS, now_s).begin(now_s)
    while resumed.match.result is None:
        resumed.do(resumed.match.submit(BLUE, resumed.match.tick, STAY, now_s))
        now_s += 100.0
        resumed.do(resumed.match.advance(now_s))

    assert (resumed.match.result.ending, resumed.match.result.winner) == (Termination.FORFEIT, BLUE)
    assert resumed.match.tick == TERMS.most_missed - 1
    assert resumed.match.record(RED).late == TERMS.most_missed - 1


def test_an_answer_before_the_pit_was_killed_ends_a_row_of_missed_turns() -> None:
    table = Table().begin()
    table.do(table.match.advance(100.0))
    table.do(table.match.advance(200.0))
    table.play(200.0)

    resumed = resume(table.journal, TERMS, 300.0).begin(300.0)

    assert resumed.do(resumed.match.advance(400.0)) != []
    assert resumed.match.result is None


def test_the_time_that_the_pit_was_away_is_charged_to_nobody() -> None:
    table = Table().begin()
    table.do(table.match.advance(3.0))
    table.do(table.match.leave(RED, 3.0))

    resumed = resume(table.journal, TERMS, now_s=1e6)

    assert resumed.match.tick == 1
    assert resumed.do(resumed.match.advance(1e6 + 9.9)) == []
    assert resumed.begin(1e6 + 9.9).match.phase is Phase.PLAYING
    assert [resumed.clock_s(team) for team in Team] == [2.0, 2.0]
    assert resumed.do(resumed.match.advance(1e6 + 12.8)) == []


def test_nobody_comes_back_to_a_resumed_match() -> None:
    table = Table().begin()
    table.play(0.0)

    resumed = resume(table.journal, TERMS, now_s=50.0)
    resumed.do(resumed.match.advance(60.0))

    assert resumed.match.result is not None
    assert (resumed.match.result.ending, resumed.match.result.winner) == (Termination.FORFEIT, None)
    assert verify(resumed.read()) == 1


def test_a_match_whose_last_tick_was_written_and_whose_ending_was_not_ends_at_once() -> None:
    table = Table().begin()
    for _ in range(6):
        table.play(0.0)
    whole = table.journal

    resumed = resume(whole[:-1], TERMS, now_s=0.0)

    assert [word(event) for event in resumed.events] == ["write", "end"]
    assert resumed.journal == whole


def broken(journal: Journal, what: str) -> Journal:
    first = journal.ticks[0]
    if what == "board":
        return replace(journal, start_chain=bytes(32))
    if what == "orders":
        other = bytes([(first.orders[0] + 1) % 5, *first.orders[1:]])
        return replace(journal, ticks=(replace(first, orders=other), *journal.ticks[1:]))
    if what == "state":
        return replace(journal, ticks=(replace(first, chain=bytes(32)), *journal.ticks[1:]))
    return replace(journal, ticks=(*journal.ticks, journal.ticks[-1]))


@pytest.mark.parametrize("what", ["board", "orders", "state", "length"])
def test_a_journal_that_does_not_hold_is_not_resumed(what: str) -> None:
    table = Table().begin()
    for _ in range(6):
        table.play(0.0)

    with pytest.raises(JournalError, match="the journal was changed"):
        Table().match.recover(broken(table.read(), what))


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["ready", "leave", "catch up", "submit", "advance", "garble"]),
            st.sampled_from(Team),
            st.floats(0, 4),
            st.binary(max_size=4),
        ),
        max_size=60,
    )
)
def test_whatever_happens_the_match_ends_and_its_journal_verifies(steps: list[tuple[str, Team, float, bytes]]) -> None:
    table = Table()
    now_s = 0.0
    for what, team, later_s, data in steps:
        now_s += later_s
        handlers: dict[str, Any] = {
            "ready": lambda: table.match.ready(team, now_s),  # noqa: B023
            "leave": lambda: table.match.leave(team, now_s),  # noqa: B023
            "catch up": lambda: table.match.catch_up(team, len(data), now_s),  # noqa: B023
            "submit": lambda: table.match.submit(team, table.match.tick, data, now_s),  # noqa: B023
            "advance": lambda: table.match.advance(now_s),  # noqa: B023
            "garble": lambda: table.match.count_garbled(team) or [],  # noqa: B023
        }
        table.do(handlers[what]())
    for _ in range(20):
        now_s += 20.0
        table.do(table.match.advance(now_s))

    assert table.match.phase is Phase.OVER
    assert sum(isinstance(event, End) for event in table.events) == 1
    assert verify(table.read()) == table.match.tick == len(table.read().ticks)
    assert table.cells() == np.concatenate([table.match._games.state.cell[0]]).tolist()
