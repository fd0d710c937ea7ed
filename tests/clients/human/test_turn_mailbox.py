"""A mailbox between a seat and a person: the seat is never kept waiting, and the deadline rules."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from arena.game.keys import MatchKeys
from arena.game.ruleset import load, to_dict
from arena.game.types import Action, Team, Termination
from arena.match.effects import Ask
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.policy import MatchResult
from arena.protocol.messages import Ended, History, Orders, Ticket, Turn
from arena.records.journal import Header
from clients.human.turn_mailbox import MARGIN_S, TurnMailbox
from clients.seat import Seat

RULES = load("paper").with_({"side": 10})
N_UNITS = len(RULES.team(Team.RED))
TICKET = Ticket(
    match="m",
    lane=7,
    team=int(Team.RED),
    ruleset={"name": RULES.name, **to_dict(RULES)},
    opponent="ann",
    turn_time_s=30.0,
    bank_s=10.0,
    tick=0,
    secret=bytes(32),
    commitment=b"",
)
STAY = bytes(N_UNITS)


def turns(time_control: TimeControl) -> Iterator[Turn]:
    """Yield what red is asked while nobody moves."""
    keys = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x08" * 32)
    match = Match(Header(identity="m", blue="a", red="b", ruleset=RULES, keys=keys), time_control, 0.0)
    events = [event for team in Team for event in match.ready(team, 0.0)]
    for tick in range(5):
        for event in events:
            if isinstance(event, Ask) and event.team is Team.RED:
                yield Turn(tick=event.tick, observation=event.observation)
        events = [event for team in Team for event in match.submit(team, tick, STAY, 0.0)]


TURNS = list(turns(TimeControl(turn_time_s=30.0, bank_s=10.0)))


class Table:
    """A person's seat under a clock that stands still."""

    def __init__(self, autopilot: str = "", ticket: Ticket = TICKET) -> None:
        self.now_s = 100.0
        self.mailbox = TurnMailbox(autopilot, clock=lambda: self.now_s)
        self.n_changes = self.n_wakes = 0
        self.mailbox.on_change, self.mailbox.wake = self._change, self._wake
        self.seat = Seat(ticket, bytes(32), self.mailbox.make)
        self.seat.listen()
        self.mailbox.on_seat(self.seat)

    def _change(self) -> None:
        self.n_changes += 1

    def _wake(self) -> None:
        self.n_wakes += 1

    def thinks(self, turn: Turn) -> bool:
        return not self.seat.receive(turn)


@pytest.fixture
def table() -> Table:
    return Table()


def head_west(table: Table) -> None:
    """Tell a unit that may to go west."""
    commander = table.mailbox.commander
    assert commander is not None
    assert any(commander.select(unit) and commander.order(Action.WEST) for unit in range(N_UNITS))


def test_a_turn_is_answered_only_when_the_person_has_ended_it(table: Table) -> None:
    assert table.thinks(TURNS[0])
    assert table.thinks(TURNS[0])
    assert (table.seat.known_ticks, table.seat.answers, table.mailbox.is_my_turn) == (0, [], True)
    head_west(table)

    table.mailbox.end_turn()
    (answer,) = table.seat.receive(TURNS[0])

    assert table.n_wakes == 1
    assert not table.mailbox.is_my_turn
    assert isinstance(answer, Orders)
    assert sorted(answer.actions) == [*[0] * (N_UNITS - 1), int(Action.WEST)]
    assert table.thinks(TURNS[1])
    assert table.mailbox.is_my_turn


def test_at_the_deadline_the_orders_go_out_as_they_stand(table: Table) -> None:
    assert table.thinks(TURNS[0])
    view = table.mailbox.view_model()
    assert view is not None
    assert view.time_left_s == 40.0 - MARGIN_S
    head_west(table)
    table.now_s += 40.0 - MARGIN_S - 0.1
    assert table.thinks(TURNS[0])

    table.now_s += 0.1
    (answer,) = table.seat.receive(TURNS[0])

    assert isinstance(answer, Orders)
    assert int(Action.WEST) in answer.actions
    assert not table.mailbox.is_my_turn


def test_a_turn_that_is_told_again_after_the_pit_was_lost_keeps_what_was_said(table: Table) -> None:
    assert table.thinks(TURNS[0])
    head_west(table)
    table.now_s += 20.0
    assert table.thinks(replace(TURNS[0]))

    view = table.mailbox.view_model()
    assert view is not None
    assert view.time_left_s == 20.0 - MARGIN_S
    assert [unit.is_fresh for unit in view.units].count(True) == 1


def test_a_turn_whose_time_was_over_while_the_pit_was_away_begins_anew(table: Table) -> None:
    assert table.thinks(TURNS[0])
    head_west(table)
    n_changes = table.n_changes
    table.mailbox.on_wait("for the pit to come back")
    assert (table.mailbox.waiting_for, table.n_changes) == ("for the pit to come back", n_changes + 1)
    table.now_s += 1_000.0

    assert table.thinks(replace(TURNS[0]))

    view = table.mailbox.view_model()
    assert view is not None
    assert (view.time_left_s, table.mailbox.waiting_for, table.n_changes) == (40.0 - MARGIN_S, "", n_changes + 2)
    assert [unit.is_fresh for unit in view.units].count(True) == 1
    table.now_s += 40.0
    assert not table.thinks(TURNS[0])


def test_without_a_clock_a_turn_lasts(table: Table) -> None:
    free = Table(ticket=replace(TICKET, turn_time_s=None))
    assert free.thinks(TURNS[0])
    free.now_s += 1e6

    assert free.thinks(TURNS[0])


def test_a_turn_ends_with_the_last_unit_that_got_its_order(table: Table) -> None:
    assert table.thinks(TURNS[0])
    for unit in range(N_UNITS):
        assert table.mailbox.is_my_turn
        table.mailbox.command(lambda commander, unit=unit: commander.select(unit) and commander.order(Action.STAY))  # type: ignore[misc]

    assert not table.mailbox.is_my_turn
    assert table.seat.receive(TURNS[0]) == [Orders(tick=0, actions=STAY)]


def test_history_is_seen_without_asking_the_person(table: Table) -> None:
    seen = [turn.observation for turn in TURNS[:3]]
    table.seat.receive(History(first_tick=0, observations=seen, orders=[STAY] * 3, end_tick=3))

    assert (table.seat.known_ticks, table.seat.answers) == (3, [STAY] * 3)
    assert [seen.tick for seen in table.mailbox.seen] == [0, 1, 2]
    assert table.thinks(TURNS[3])
    assert table.mailbox.view_model() is not None


def test_a_turn_that_was_missed_is_not_answered_any_more(table: Table) -> None:
    assert table.thinks(TURNS[0])
    assert table.thinks(TURNS[1])
    assert table.seat.answers == [STAY]


def test_an_autopilot_is_chosen_while_the_turn_is_on() -> None:
    table = Table("rush")
    assert table.thinks(TURNS[0])
    commander = table.mailbox.commander
    assert commander is not None
    moves = commander.actions()
    assert any(moves)

    table.mailbox.set_autopilot("")
    assert not any(commander.actions())
    table.mailbox.set_autopilot("rush")

    assert commander.actions() == moves
    table.mailbox.end_turn()
    assert table.seat.receive(TURNS[0]) == [Orders(tick=0, actions=bytes(moves))]


def test_the_ending_is_told_at_once_and_the_next_match_begins_with_nothing(table: Table) -> None:
    assert table.thinks(TURNS[0])
    head_west(table)
    n_changes = table.n_changes
    table.seat.receive(Ended(match="m", ending="forfeit", winner="red", score=-100, ticks=0, reason="blue left"))

    assert table.mailbox.result == MatchResult(
        ending=Termination.FORFEIT, winner=Team.RED, score=100, ticks=0, reason="blue left"
    )
    assert (table.n_changes, table.mailbox.is_playing, table.mailbox.is_my_turn) == (n_changes + 1, False, False)

    following = Seat(replace(TICKET, match="n", opponent="bob"), bytes(32), table.mailbox.make)
    following.listen()
    table.mailbox.on_seat(following)

    assert (table.mailbox.is_playing, table.mailbox.opponent, table.mailbox.seen, table.mailbox.view_model()) == (
        True,
        "bob",
        [],
        None,
    )
    assert following.receive(TURNS[0]) == []
    commander = table.mailbox.commander
    assert commander is not None
    assert not np.any(commander.actions())
