"""A seat, and a seat joined with the referee's match without a network: what may be lost, doubled or late, is."""

import random
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import InputError, UnreadableError
from arena.game.keys import MatchKeys
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, load, to_dict
from arena.game.types import Team, Termination
from arena.local.venue import play_batch
from arena.match.effects import Ask, Effect, End, Write
from arena.match.match import Match, Phase
from arena.match.time_control import TimeControl
from arena.policy import BatchPolicy, MatchResult, Thinking
from arena.protocol.codec import decode, encode
from arena.protocol.messages import Ended, History, Message, Orders, Ready, Ticket, Turn, Wait
from arena.records.journal import Header, read_journal
from arena.records.plan import MatchPlan
from arena.records.replay import verify
from arena.records.transcript import TranscriptHeader, TranscriptWriter
from clients.seat import Seat, read_ticket
from policies import registry

PAPER = load("paper")
SHORT = PAPER.with_({"side": 10, "tick_limit": 25})
NO_CLOCK = TimeControl(turn_time_s=None)
COMMITMENT = bytes(32)


def ticket(team: Team = Team.RED, ruleset: Ruleset = PAPER, **changes: Any) -> Ticket:
    plain = Ticket(
        match="m",
        lane=7,
        team=int(team),
        ruleset={"name": ruleset.name, **to_dict(ruleset)},
        opponent="ann",
        turn_time_s=None,
        bank_s=0.0,
        tick=0,
        secret=bytes(32),
        commitment=b"",
    )
    return replace(plain, **changes)


class Diary(BatchPolicy):
    """Answers with the count of what it has seen, and writes down what it was asked."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self.asked: list[int] = []
        self.heard: list[MatchResult] = []
        self.calls: list[str | float] = []
        """What it was told before it acted: turn times, in seconds, and that a match starts."""

    def set_turn_time(self, seconds: float) -> None:
        self.calls.append(seconds)

    def start(self, seats: np.ndarray) -> None:
        self.calls.append("start")

    def act(self, observations: Observations, orders: np.ndarray) -> None:
        self.asked.append(int(observations.tick[0]))
        orders[:] = len(self.asked) % 5

    def end(self, seat: int, result: MatchResult) -> None:
        self.heard.append(result)


class Observed:
    """Makes fighters, and checks that each is asked once per tick, in order."""

    def __init__(self, make: Any) -> None:
        self.make, self.asked = make, []  # type: Any, list[list[int]]

    def __call__(self, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        policy = self.make(ruleset, team, n_seats)
        act, asked = policy.act, []  # type: Any, list[int]
        self.asked.append(asked)

        def observed(observations: Observations, orders: np.ndarray) -> None:
            asked.append(int(observations.tick[0]))
            act(observations, orders)

        policy.act = observed
        return policy

    def check(self) -> None:
        for asked in self.asked:
            assert asked == list(range(len(asked)))


def seated(*, n_in_turn: int = 1, **changes: Any) -> tuple[Seat, Diary]:
    diaries: list[Diary] = []

    def make(*arguments: Any) -> Diary:
        diaries.append(Diary(*arguments))
        return diaries[-1]

    return Seat(ticket(**changes), COMMITMENT, make, n_in_turn=n_in_turn), diaries[0]


def observations_of(n_ticks: int) -> list[bytes]:
    """Return what red is shown while nobody moves."""
    match = Match(header(PAPER, "a", "b"), NO_CLOCK, 0.0)
    shown = [event for team in Team for event in match.ready(team, 0.0)]
    for tick in range(n_ticks - 1):
        for team in Team:
            shown += match.submit(team, tick, bytes(6), 0.0)
    return [event.observation for event in shown if isinstance(event, Ask) and event.team is Team.RED]


def header(ruleset: Ruleset, blue: str, red: str) -> Header:
    keys = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x08" * 32)
    return Header(identity=f"{blue}/{red}", blue=blue, red=red, ruleset=ruleset, keys=keys)


SHOWN = observations_of(5)


def history(first: int, end: int, end_tick: int | None = None) -> History:
    """Return a piece of what red was shown."""
    seen = SHOWN[first:end]
    return History(first_tick=first, observations=seen, orders=[bytes(6)] * len(seen), end_tick=end_tick or end)


def turn(tick: int) -> Turn:
    return Turn(tick=tick, observation=SHOWN[tick])


@pytest.mark.parametrize(("turn_time_s", "n_in_turn", "heard"), [(0.5, 1, [0.5]), (0.5, 4, [0.125]), (None, 4, [])])
def test_a_policy_hears_once_before_it_starts_what_its_seat_may_take_of_a_turn(
    turn_time_s: float | None, n_in_turn: int, heard: list[float]
) -> None:
    seat, diary = seated(turn_time_s=turn_time_s, n_in_turn=n_in_turn)

    for tick in range(2):
        seat.listen()
        seat.receive(turn(tick))

    assert diary.calls == [*heard, "start"]
    assert diary.asked == [0, 1]


def test_a_turn_is_answered_and_asked_again_answered_alike() -> None:
    seat, diary = seated()

    answers = [seat.receive(Turn(tick=0, observation=SHOWN[0])) for _ in range(3)]

    assert answers == [[Orders(tick=0, actions=b"\x01" * 6)]] * 3
    assert diary.asked == [0]


def test_a_tick_long_answered_is_answered_alike_when_the_pit_has_lost_it() -> None:
    seat, diary = seated()
    first = [seat.receive(Turn(tick=tick, observation=SHOWN[tick])) for tick in range(3)]

    again = [seat.receive(Turn(tick=tick, observation=SHOWN[tick])) for tick in range(3)]

    assert first == again
    assert diary.asked == [0, 1, 2]


def test_a_turn_after_one_that_was_missed_asks_for_history() -> None:
    seat, diary = seated()
    assert seat.listen() == [Ready(known_ticks=0)]

    assert seat.receive(Turn(tick=2, observation=SHOWN[2])) == []
    assert seat.is_behind
    assert seat.listen() == [Ready(known_ticks=0)]
    assert seat.receive(history(0, 2)) == [Ready(known_ticks=2)]
    assert seat.receive(Turn(tick=2, observation=SHOWN[2])) == [Orders(tick=2, actions=b"\x03" * 6)]
    assert (diary.asked, seat.is_behind) == ([0, 1, 2], False)


def test_history_overlaps_or_comes_too_early_and_nothing_is_seen_twice() -> None:
    seat, diary = seated()
    seat.receive(Turn(tick=0, observation=SHOWN[0]))

    seat.receive(history(3, 5))
    assert diary.asked == [0]
    said = [seat.receive(history(first, first + 3, end_tick=5)) for first in (0, 1, 0, 2)]

    assert diary.asked == [0, 1, 2, 3, 4]
    assert said == [[], [], [], [Ready(known_ticks=5)]]


@pytest.mark.parametrize(
    "message",
    [
        Turn(tick=0, observation=SHOWN[0][:-1]),
        Turn(tick=0, observation=SHOWN[1]),
        Turn(tick=-1, observation=SHOWN[0]),
        History(first_tick=0, observations=[b""], orders=[bytes(6)], end_tick=1),
        History(first_tick=0, observations=[SHOWN[2]], orders=[bytes(6)], end_tick=1),
        History(first_tick=0, observations=[SHOWN[0], SHOWN[2]], orders=[bytes(6)] * 2, end_tick=2),
        Ended(match="m", ending="rapture", winner=None, score=0, ticks=0, reason=""),
        Ended(match="m", ending="capture", winner="green", score=0, ticks=0, reason=""),
    ],
)
def test_what_no_referee_says_is_unreadable_and_changes_nothing(message: Message) -> None:
    seat, diary = seated()

    with pytest.raises(UnreadableError):
        seat.receive(message)

    assert (diary.asked, diary.heard, seat.ended) == ([], [], None)
    assert seat.receive(Turn(tick=0, observation=SHOWN[0])) == [Orders(tick=0, actions=b"\x01" * 6)]


def test_history_from_before_the_first_tick_and_other_messages_are_nothing() -> None:
    seat, diary = seated()

    assert seat.receive(History(first_tick=-5, observations=SHOWN, orders=[], end_tick=0)) == []
    assert seat.receive(Wait(reason="x")) == []
    assert diary.asked == []


@pytest.mark.parametrize(("team", "score"), [(Team.BLUE, 40), (Team.RED, -40)])
def test_the_policy_hears_once_how_the_match_ended_from_its_side(team: Team, score: int) -> None:
    seat, diary = seated(team=team)
    with pytest.raises(ValueError, match="the match is not over"):
        seat.result()

    for _ in range(2):
        seat.receive(Ended(match="m", ending="tick_limit", winner="blue", score=40, ticks=100, reason=""))

    result = MatchResult(ending=Termination.TICK_LIMIT, winner=Team.BLUE, score=score, ticks=100)
    assert seat.result() == result
    assert diary.heard == [result]
    assert seat.receive(Turn(tick=0, observation=SHOWN[0])) == []
    assert seat.faults().raised == 0


def test_a_ticket_is_read() -> None:
    assert read_ticket(ticket(Team.BLUE)) == (PAPER, Team.BLUE)


@pytest.mark.parametrize("changes", [{"team": 2}, {"team": -1}, {"match": ""}, {"match": "a/**"}])
def test_a_ticket_for_nowhere_is_unreadable(changes: dict[str, Any]) -> None:
    with pytest.raises(UnreadableError, match="the ticket is for"):
        read_ticket(replace(ticket(), **changes))


@pytest.mark.parametrize("values", [{}, {"side": 7}, {"sides": 20}, {"units": 3}])
def test_a_ticket_for_rules_that_are_none_is_refused(values: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        read_ticket(replace(ticket(), ruleset=values or {"name": "x", "base": "nothing"}))


# A policy that needs longer


class Slow(Diary):
    """Needs longer until it may go on."""

    may_start = True
    n_may_act = 0
    has_seen = False

    def start(self, seats: np.ndarray) -> None:
        if not self.may_start:
            raise Thinking

    def act(self, observations: Observations, orders: np.ndarray) -> None:
        if not self.n_may_act:
            orders[:] = 4
            raise Thinking(has_seen=self.has_seen)
        self.n_may_act -= 1
        super().act(observations, orders)


def seated_slow(**attributes: Any) -> tuple[Seat, Slow]:
    slow: list[Slow] = []

    def make(*arguments: Any) -> Slow:
        slow.append(Slow(*arguments))
        vars(slow[-1]).update(attributes)
        return slow[-1]

    return Seat(ticket(), COMMITMENT, make), slow[0]


def orders_of(tick: int) -> Orders:
    """Return what a `Diary` answers that was shown every tick."""
    return Orders(tick=tick, actions=bytes([(tick + 1) % 5]) * 6)


def test_a_seat_is_not_ready_before_its_policy_has_started() -> None:
    seat, policy = seated_slow(may_start=False)
    assert seat.listen() == seat.think() == []
    assert seat.owes_ready

    policy.may_start = True

    assert seat.think() == [Ready(known_ticks=0)]
    assert not seat.owes_ready
    assert seat.think() == []


def test_turns_that_come_while_the_policy_thinks_are_shown_in_order_and_the_last_is_answered() -> None:
    seat, policy = seated_slow()
    seat.listen()
    for tick in range(4):
        assert seat.receive(turn(tick)) == []
    assert seat.receive(turn(3)) == seat.think() == []

    policy.n_may_act = 2
    assert seat.think() == []
    assert policy.asked == [0, 1]
    policy.n_may_act = 9

    assert seat.think() == [orders_of(3)]
    assert policy.asked == [0, 1, 2, 3]
    assert [len(answer) for answer in seat.answers] == [6] * 4


def test_who_takes_the_seat_again_while_its_policy_thinks_says_that_it_has_what_waits() -> None:
    seat, policy = seated_slow()
    seat.listen()
    for tick in range(3):
        seat.receive(turn(tick))

    assert seat.listen() == [Ready(known_ticks=3)]
    assert not seat.owes_ready
    assert seat.receive(turn(2)) == []
    policy.n_may_act = 9

    assert seat.think() == [orders_of(2)]


def test_a_pit_that_asks_for_an_earlier_tick_again_is_answered_for_that_one() -> None:
    seat, policy = seated_slow()
    seat.listen()
    for tick in (0, 1, 2, 1):
        seat.receive(turn(tick))
    policy.n_may_act = 9

    assert seat.think() == [orders_of(1)]
    assert policy.asked == [0, 1, 2]


def test_a_policy_may_need_longer_in_the_middle_of_its_history_and_is_ready_after_it() -> None:
    seat, policy = seated_slow(n_may_act=2)
    seat.listen()
    assert seat.receive(history(0, 2, end_tick=4)) == []
    assert seat.receive(history(2, 4)) == []
    assert (policy.asked, seat.owes_ready) == ([0, 1], True)

    policy.n_may_act = 2

    assert seat.think() == [Ready(known_ticks=4)]
    assert (policy.asked, seat.owes_ready) == ([0, 1, 2, 3], False)
    policy.n_may_act = 1
    assert seat.receive(turn(4)) == [orders_of(4)]


def test_who_takes_the_seat_again_within_its_history_is_sent_the_rest_again() -> None:
    seat, policy = seated_slow(n_may_act=1)
    seat.listen()
    seat.receive(history(0, 4))

    assert seat.listen() == [Ready(known_ticks=2)], "the policy thinks about tick 1"
    policy.n_may_act = 9

    assert seat.receive(history(2, 4)) == [Ready(known_ticks=4)]
    assert policy.asked == [0, 1, 2, 3]


def test_a_turn_behind_the_history_was_asked_though_the_policy_had_not_seen_all() -> None:
    seat, policy = seated_slow()
    seat.listen()
    seat.receive(history(0, 2))
    seat.receive(turn(2))
    policy.n_may_act = 9

    assert seat.think() == [orders_of(2)]


def test_a_policy_that_has_seen_its_history_is_not_asked_for_answers_of_no_use() -> None:
    seat, policy = seated_slow(has_seen=True)
    seat.listen()

    assert seat.receive(history(0, 2)) == [Ready(known_ticks=2)]
    for tick in (2, 3):
        assert seat.receive(turn(tick)) == []

    assert seat.known_ticks == 3
    assert seat.answers[2] == bytes(6)
    policy.n_may_act = 1
    assert [answer.tick for answer in seat.think() if isinstance(answer, Orders)] == [3]


@pytest.mark.parametrize("may_start", [False, True])
def test_an_ending_does_not_wait_for_a_policy_that_thinks(may_start: bool) -> None:
    seat, policy = seated_slow(may_start=may_start)
    seat.listen()
    seat.receive(turn(0))

    seat.receive(Ended(match="m", ending="tick_limit", winner="blue", score=40, ticks=1, reason=""))
    policy.may_start, policy.n_may_act = True, 9

    assert seat.think() == seat.listen() == []
    assert (policy.asked, len(policy.heard)) == ([], 1)


def test_no_more_waits_for_a_policy_than_a_match_has_ticks() -> None:
    rules = PAPER.with_({"tick_limit": 2})
    seat = Seat(ticket(ruleset=rules), COMMITMENT, Slow)
    seat.listen()
    for tick in range(2):
        seat.receive(turn(tick))

    with pytest.raises(UnreadableError, match="there is no tick 2 in matches of 2 ticks"):
        seat.receive(turn(2))


# Joined with the referee's match


class Storm:
    """Two seats and a match, and a network that loses, doubles and delays; processes die at random, and come back."""

    def __init__(self, ruleset: Ruleset, makes: dict[Team, Observed], chance: random.Random) -> None:
        names = {team: team.name.lower() for team in Team}
        self.header = header(ruleset, names[Team.BLUE], names[Team.RED])
        self.ruleset, self.makes, self.chance = ruleset, makes, chance
        self.match = Match(self.header, NO_CLOCK, 0.0)
        self.journal = self.match.start_record
        self.seats = {team: self.sit(team) for team in Team}
        self.to_seats: deque[tuple[Team, bytes]] = deque()
        self.to_referee: deque[tuple[Team, bytes]] = deque()
        self.ended: Ended | None = None

    def sit(self, team: Team) -> Seat:
        return Seat(ticket(team, self.ruleset), COMMITMENT, self.makes[team])

    def carry_out(self, events: list[Effect]) -> None:
        for event in events:
            if isinstance(event, Write):
                self.journal += event.data
            elif isinstance(event, Ask):
                self.to_seats.append((event.team, encode(Turn(tick=event.tick, observation=event.observation))))
            elif isinstance(event, End):
                result = event.result
                winner = None if result.winner is None else result.winner.name.lower()
                self.ended = Ended(
                    match="m", ending=result.ending.name.lower(), winner=winner, score=result.score, ticks=result.ticks, reason=""
                )

    def hear(self, team: Team, data: bytes) -> None:
        """Take a message as the service does."""
        message = decode(data)
        if isinstance(message, Orders):
            self.carry_out(self.match.submit(team, message.tick, message.actions, 0.0))
        elif isinstance(message, Ready):
            known = message.known_ticks
            observations, orders = self.match.history(team, known)
            for first in range(0, len(observations), 3):
                seen, played = observations[first : first + 3], orders[first : first + 3]
                told = History(first_tick=known + first, observations=seen, orders=played, end_tick=self.match.tick)
                self.to_seats.append((team, encode(told)))
            if observations:
                self.carry_out(self.match.catch_up(team, len(observations), 0.0))
            else:
                self.carry_out(self.match.ready(team, 0.0))

    def tell(self, team: Team, data: bytes) -> None:
        self.to_referee += [(team, encode(answer)) for answer in self.seats[team].receive(decode(data))]

    def pass_on(self, queue: deque[tuple[Team, bytes]], deliver: Callable[[Team, bytes], None]) -> None:
        """Deliver some message of a queue, or lose it, or keep it for another time as well."""
        queue.rotate(self.chance.randrange(len(queue)) if self.chance.random() < 0.3 else 0)
        team, data = queue.popleft()
        fate = self.chance.random()
        if fate < 0.1:
            return
        if fate < 0.2:
            queue.append((team, data))
        deliver(team, data)

    def strike(self) -> None:
        """Kill a process: a seat's, or the referee's."""
        if self.chance.random() < 0.5:
            team = self.chance.choice(list(Team))
            self.carry_out(self.match.leave(team, 0.0))
            self.seats[team] = self.sit(team)
            return
        self.to_seats.clear()
        self.to_referee.clear()
        self.match = Match(self.header, NO_CLOCK, 0.0)
        self.carry_out(self.match.recover(read_journal(self.journal)))

    def rage(self) -> None:
        """Play to the end."""
        while self.match.phase is not Phase.OVER:
            if self.chance.random() < 0.02:
                self.strike()
            if not self.to_seats and not self.to_referee:  # silence: whoever hears nothing says that it is there
                for team, seat in self.seats.items():
                    self.to_referee += [(team, encode(message)) for message in seat.listen()]
            if self.to_referee and (not self.to_seats or self.chance.random() < 0.5):
                self.pass_on(self.to_referee, self.hear)
            elif self.to_seats:
                self.pass_on(self.to_seats, self.tell)


def play_storm(ruleset: Ruleset, blue: str, red: str, seed: int) -> None:
    makes = {team: Observed(registry.load(name)) for team, name in zip(Team, (blue, red), strict=True)}
    storm = Storm(ruleset, makes, random.Random(seed))
    plan = MatchPlan(identity=storm.header.identity, blue="blue", red="red", keys=storm.header.keys)

    storm.rage()
    (calm,) = play_batch(ruleset, [plan], registry.load(blue), registry.load(red))

    assert storm.journal == calm.journal
    assert verify(read_journal(storm.journal)) == calm.result.ticks
    for make in makes.values():
        make.check()
    for seat in storm.seats.values():
        assert storm.ended is not None
        seat.receive(storm.ended)
        assert seat.result().winner is calm.result.winner


PAIRS = list(permutations([*registry.SCRIPTS, "planner-fast"], 2))  # other planners are the same with more time


@given(st.sampled_from(PAIRS), st.integers(0, 2**32))
def test_in_any_storm_the_match_is_that_of_the_local_venue(pair: tuple[str, str], seed: int) -> None:
    play_storm(SHORT, *pair, seed)


def test_a_whole_match_in_a_storm() -> None:
    play_storm(PAPER, "roomba", "patrol", 1)


@pytest.mark.parametrize("explains", [False, True])
def test_a_policy_explains_itself_in_a_transcript_where_it_is_asked_to(explains: bool, tmp_path: Path) -> None:
    seat, diary = seated()
    texts = dict.fromkeys(("match", "pit", "name", "opponent"), "m")
    hashes = dict.fromkeys(("pit_key", "entry_key", "commitment"), bytes(32))
    assert (diary.keeps_annotations, diary.explains) == (False, False)

    with TranscriptWriter(tmp_path / "a", TranscriptHeader(team=Team.RED, ruleset=PAPER, **texts, **hashes)) as transcript:
        seat.keep(transcript, explains=explains)

    assert (diary.keeps_annotations, diary.explains) == (True, explains)
