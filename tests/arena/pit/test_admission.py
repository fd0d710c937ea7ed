"""The reception, without a network: everything is real but the floor that it begins matches on, the questions and the time."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from arena.errors import ForgedError
from arena.game.ruleset import load
from arena.game.types import RULES_VERSION, Team
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.pit import admission as module
from arena.pit.admission import FORGET_WAITING_S, HOLD_QUESTION_S, PATIENCE_S, Admission
from arena.pit.authenticator import Authenticator
from arena.pit.match_session import MatchSession, PitContext
from arena.pit.register import Register
from arena.pit.seating import OpenSeating, Pairing, SeatId
from arena.protocol import handshake
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt, Caller, new_secret
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    AdminRequest,
    Challenge,
    Closed,
    Done,
    Hello,
    JoinRequest,
    Knock,
    Message,
    Orders,
    Ready,
    Refusal,
    Signed,
    Ticket,
    Wait,
)
from arena.records.journal import Header, match_id
from arena.records.plan import MatchPlan

RULES = load("paper").with_({"side": 10})
PIT = Identity.make()
LOW_ORDER = bytes(32)
"""A point with which every exchange ends at zero (RFC 7748, section 6.1)."""


class Clock:
    """The time, which passes when it is told to."""

    def __init__(self) -> None:
        self.now_s = 1_000.0

    def __call__(self) -> float:
        return self.now_s


class Asked:
    """A question, and what was said to it."""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload
        self.answers: list[bytes] = []
        self.is_dropped = False

    def answer(self, payload: bytes) -> None:
        assert not self.is_over, "a question is answered once"
        self.answers.append(payload)

    def drop(self) -> None:
        self.is_dropped = True

    @property
    def is_over(self) -> bool:
        return bool(self.answers) or self.is_dropped


class Silence:
    """A session on which nobody listens."""

    def publisher(self, key: str) -> tuple[Callable[[bytes], None], Callable[[], None]]:
        return (lambda data: None), (lambda: None)

    def broadcast(self, key: str) -> Any:
        return SimpleNamespace(put=lambda data: None, end=lambda: None, has_subscribers=False)


class Floor:
    """Begins matches as the referee does, and writes down what else it was told."""

    def __init__(self, clock: Clock, leave: ExitStack) -> None:
        self.tables: dict[str, MatchSession] = {}
        self.held: dict[SeatId, tuple[str, Team]] = {}
        self.endings: dict[str, Signed] = {}
        self.told: list[tuple[Any, ...]] = []
        self.hearing_s = 0.0
        """What it takes to hear the orders that have come."""
        self._clock, self._leave = clock, leave

    def hear_orders(self) -> None:
        self._clock.now_s += self.hearing_s

    def begin(self, pairing: Pairing, entries: dict[Team, bytes]) -> MatchSession:
        plan = pairing.plan
        header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=RULES, keys=plan.keys)
        descriptor = os.open(os.devnull, os.O_WRONLY)
        self._leave.callback(os.close, descriptor)
        house: Any = PitContext(session=Silence(), pit="pit", identity=PIT)  # type: ignore[arg-type]
        table = MatchSession(house, Match(header, TimeControl(), self._clock()), entries, descriptor)
        self.tables[table.id] = table
        for team, seat in pairing.seats.items():
            table.chairs[team].holder = seat
            self.held[seat] = (table.id, team)
        return table

    def take_away(self, table: MatchSession, team: Team, why: str) -> None:
        self.told.append(("forfeit", table.id, team, why))
        self._end(table)

    def abort(self, table: MatchSession, why: str) -> None:
        self.told.append(("void", table.id, why))
        self._end(table)

    def _end(self, table: MatchSession) -> None:
        del self.tables[table.id]
        self.held = {seat: place for seat, place in self.held.items() if place[0] != table.id}

    def lose(self, client: str) -> None:
        """A process is gone."""
        self.held = {seat: place for seat, place in self.held.items() if seat.client != client}


class SlowDoor(Authenticator):
    """Takes its time with each request."""

    def __init__(self, clock: Clock) -> None:
        super().__init__("pit", PIT)
        self.clock, self.cost_s = clock, 0.0

    def open(self, payload: bytes, now_s: float) -> Caller:
        self.clock.now_s += self.cost_s
        return super().open(payload, now_s)


class Pit:
    """A reception with its surroundings."""

    def __init__(self, clock: Clock, leave: ExitStack, plan: Callable[..., MatchPlan], n_matches: int | None = None) -> None:
        self.clock, self.floor, self.n_begun = clock, Floor(clock, leave), 0
        self.register = Register(names={"owned": b"o" * 32})
        self.seating = OpenSeating(lambda blue, red: plan(self._next(), blue, red), n_matches)
        self.door = SlowDoor(clock)
        self.reception = Admission(self.floor, self.door, self.register, RULES, self.seating)

    def _next(self) -> str:
        self.n_begun += 1
        return f"pit/{self.n_begun}"

    def challenge(self) -> Challenge:
        challenge = decode(self.door.challenge(self.clock()))
        assert isinstance(challenge, Challenge)
        return challenge

    def hear(self, payload: bytes) -> Asked:
        asked = Asked(payload)
        self.reception.hear(asked)  # type: ignore[arg-type]
        return asked

    def serve(self) -> None:
        """Let a sweep pass."""
        self.clock.now_s += 0.01
        self.reception.serve()


class Client:
    """A client process."""

    def __init__(self, pit: Pit, name: str, identity: Identity | None = None, client: str = "") -> None:
        self.pit, self.name = pit, name
        self.identity = identity or Identity.make()
        self.client = client or f"of-{name}"
        self.attempt: Attempt
        self.asked: Asked

    def request(self, **changes: Any) -> JoinRequest:
        plain = JoinRequest(rules_version=RULES_VERSION, name=self.name, team="any", client=self.client, slot=0)
        return replace(plain, **changes)

    def knock(self, **changes: Any) -> "Client":
        """Ask for a seat; the reception has still to open it."""
        self.attempt = Attempt(self.identity, "pit", self.pit.challenge(), self.request(**changes))
        self.asked = self.pit.hear(self.attempt.knock)
        return self

    def ask(self, **changes: Any) -> Message | None:
        """Ask for a seat, and return what is said at once."""
        self.knock(**changes)
        self.pit.serve()
        return self.heard()

    def order(self, command: str, target: str = "") -> Message | None:
        self.attempt = Attempt(self.identity, "pit", self.pit.challenge(), AdminRequest(command=command, target=target))
        self.asked = self.pit.hear(self.attempt.knock)
        self.pit.serve()
        return self.heard()

    def heard(self) -> Message | None:
        """Return the answer that nobody else can read; None while there is none."""
        return self.attempt.open(self.asked.answers[0]) if self.asked.answers else None

    @property
    def seat(self) -> SeatId:
        return SeatId(self.identity.public, self.client, 0)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=clock))
    return clock


@pytest.fixture
def leave() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def pit(clock: Clock, leave: ExitStack, planned: Callable[..., MatchPlan]) -> Pit:
    return Pit(clock, leave, planned)


@pytest.fixture
def operator(pit: Pit) -> Client:
    return Client(pit, "operator", PIT)


def ticket(message: Message | None) -> Ticket:
    assert isinstance(message, Ticket), message
    return message


def begin(pit: Pit) -> tuple[Client, Client, Ticket, Ticket]:
    """Let ann and bob begin a match."""
    ann, bob = Client(pit, "ann"), Client(pit, "bob")
    assert ann.ask() is None
    red = ticket(bob.ask())
    return ann, bob, ticket(ann.heard()), red


# At the window


def test_hello_is_answered_at_once(pit: Pit) -> None:
    asked = pit.hear(encode(Hello()))

    assert asked.answers == [pit.door.challenge(pit.clock())]


@pytest.mark.parametrize(
    ("payload", "why"),
    [
        (b"", "the request cannot be read: "),
        (b"\xff" * 40, "the request cannot be read: "),
        (encode(Ready(known_ticks=0)), "this is no request for a seat"),
        (encode(JoinRequest(rules_version=1, name="a", team="any", client="c", slot=0)), "this is no request for a seat"),
        (encode(AdminRequest(command="close", target="")), "this is no request for a seat"),
    ],
)
def test_what_is_not_sealed_is_refused_at_once(pit: Pit, payload: bytes, why: str) -> None:
    (answer,) = map(decode, pit.hear(payload).answers)

    assert isinstance(answer, Refusal)
    assert answer.reason.startswith(why)
    pit.serve()
    assert not pit.seating.is_done


def test_a_knock_that_does_not_open_or_comes_twice_is_refused_and_counted(pit: Pit) -> None:
    ann = Client(pit, "ann").knock()
    refused = [pit.hear(encode(Knock(sealed=b"junk" * 50))), pit.hear(ann.attempt.knock)]
    pit.serve()

    assert pit.reception.n_refused == 2
    for asked, why in zip(refused, ("a request does not open", "a request comes a second time"), strict=True):
        answer = decode(asked.answers[0])
        assert isinstance(answer, Refusal)
        assert answer.reason.startswith(why)
    assert list(pit.reception.guests) == [ann.seat]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"rules_version": RULES_VERSION + 1}, "the client knows version"),
        ({"team": "green"}, "there is no team"),
        ({"slot": -1}, "there is no slot"),
        ({"name": "a/b"}, "a name is 1 to 64"),
        ({"name": "owned"}, "the name owned belongs to another key"),
    ],
)
def test_who_cannot_play_here_is_told_why(pit: Pit, changes: dict[str, Any], why: str) -> None:
    answer = Client(pit, "ann").ask(**changes)

    assert isinstance(answer, Refusal)
    assert answer.reason.startswith(why)
    assert pit.reception.guests == {}


# The share of the time


def test_while_matches_run_requests_have_their_share_of_the_time_and_the_rest_waits(pit: Pit) -> None:
    begin(pit)
    pit.door.cost_s = 0.0037
    asked = [pit.hear(encode(Knock(sealed=bytes(100)))) for _ in range(module.MOST_KNOCKS)]
    begun_s = pit.clock()

    for _ in range(50):
        pit.serve()

    served_s = sum(one.is_over for one in asked) * pit.door.cost_s
    assert served_s == pytest.approx(0.3 * (pit.clock() - begun_s), abs=0.02)


def test_the_time_in_which_orders_are_heard_is_taken_off_nobody_s_share(pit: Pit) -> None:
    begin(pit)
    pit.floor.hearing_s = 0.05
    asked = [pit.hear(encode(Knock(sealed=bytes(100)))) for _ in range(7)]

    for _ in range(2):
        pit.serve()

    assert all(one.is_over for one in asked)


def test_without_a_match_to_slow_down_all_are_served(pit: Pit) -> None:
    pit.door.cost_s = 1.0
    asked = [pit.hear(encode(Knock(sealed=bytes(100)))) for _ in range(20)]

    pit.serve()

    assert all(one.is_over for one in asked)


def test_what_took_very_long_is_forgiven_beyond_some_sweeps(pit: Pit) -> None:
    begin(pit)
    pit.door.cost_s = 5.0
    asked = [pit.hear(encode(Knock(sealed=bytes(100)))) for _ in range(2)]
    pit.serve()
    pit.door.cost_s = 0.0

    assert [one.is_over for one in asked] == [True, False]
    for _ in range(10):
        pit.serve()
        pit.clock.now_s += 0.01
    assert asked[1].is_over


def test_orders_are_heard_before_each_request_is_opened(pit: Pit) -> None:
    pit.floor.hear_orders = lambda: heard.append(sum(one.is_over for one in asked))  # type: ignore[method-assign]
    heard: list[int] = []
    asked = [pit.hear(encode(Knock(sealed=bytes(100)))) for _ in range(3)]

    pit.serve()

    assert heard == [0, 1, 2]


def test_requests_beyond_the_bound_are_dropped_and_those_before_are_served(pit: Pit) -> None:
    asked = [pit.hear(encode(Knock(sealed=bytes(100)))) for _ in range(module.MOST_KNOCKS + 2)]
    hello = pit.hear(encode(Hello()))

    assert [one.is_dropped for one in asked] == [False] * module.MOST_KNOCKS + [True] * 2
    assert hello.answers
    pit.serve()
    assert sum(len(one.answers) for one in asked) == module.MOST_KNOCKS
    assert not pit.hear(encode(Knock(sealed=bytes(100)))).is_dropped


# Guests


def test_two_who_came_get_a_match_of_their_own(pit: Pit) -> None:
    _, _, blue, red = begin(pit)

    assert (blue.match, blue.team, blue.opponent) == (match_id("pit/1"), Team.BLUE, "bob")
    assert (red.match, red.team, red.opponent) == (match_id("pit/1"), Team.RED, "ann")
    assert pit.reception.guests == {}
    assert list(pit.floor.tables) == [blue.match]


def test_a_guest_waits_for_some_seconds_and_is_told_so(pit: Pit) -> None:
    ann = Client(pit, "ann")
    assert ann.ask() is None

    pit.reception.sweep(pit.clock() + HOLD_QUESTION_S - 0.01)
    assert ann.heard() is None
    pit.reception.sweep(pit.clock() + HOLD_QUESTION_S)

    assert ann.heard() == Wait(reason="for an opponent")
    assert list(pit.reception.guests) == [ann.seat]


def test_a_guest_that_was_told_to_wait_and_asks_again_is_seated(pit: Pit) -> None:
    """Its match began while it did not ask."""
    ann, bob = Client(pit, "ann"), Client(pit, "bob")
    ann.ask()
    pit.reception.sweep(pit.clock() + HOLD_QUESTION_S)
    assert isinstance(ann.heard(), Wait)

    red = ticket(bob.ask())
    blue = ticket(ann.ask())

    assert (blue.match, blue.team) == (red.match, Team.BLUE)
    assert pit.n_begun == 1


def test_a_guest_that_asks_again_before_it_was_answered_waits_once(pit: Pit) -> None:
    ann = Client(pit, "ann")
    ann.ask()
    first, attempt = ann.asked, ann.attempt

    assert ann.ask() is None
    assert attempt.open(first.answers[0]) == Wait(reason="for an opponent")
    assert list(pit.reception.guests) == [ann.seat]


def test_a_guest_that_does_not_ask_again_is_forgotten_and_frees_its_team(pit: Pit) -> None:
    ann = Client(pit, "ann")
    ann.ask(team="red")
    assert isinstance(Client(pit, "bob").ask(team="red"), Refusal)

    pit.reception.sweep(pit.clock() + HOLD_QUESTION_S)
    pit.reception.sweep(pit.clock() + FORGET_WAITING_S)

    assert pit.reception.guests == {}
    assert Client(pit, "bob").ask(team="red") is None


def test_a_process_that_is_gone_does_not_wait_any_more(pit: Pit) -> None:
    ann, eve = Client(pit, "ann"), Client(pit, "eve")
    ann.ask(team="red")
    pit.reception.lose(eve.client)
    assert list(pit.reception.guests) == [ann.seat]

    pit.reception.lose(ann.client)

    assert pit.reception.guests == {}
    assert eve.ask(team="red") is None


def test_guests_beyond_the_bound_are_sent_away_and_those_who_wait_are_not(pit: Pit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_GUESTS", 1)
    ann, bob = Client(pit, "ann"), Client(pit, "bob")
    ann.ask()

    assert bob.ask() == Refusal(reason="1 clients wait already; come again later")
    assert ann.ask() is None
    assert list(pit.reception.guests) == [ann.seat]


def test_beyond_the_most_matches_guests_wait_until_one_is_over(pit: Pit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_RUNNING", 1)
    begin(pit)
    eve, dan = Client(pit, "eve"), Client(pit, "dan")

    assert (eve.ask(), dan.ask(), pit.n_begun) == (None, None, 1)
    pit.floor.abort(next(iter(pit.floor.tables.values())), "")
    assert eve.ask() is None
    assert isinstance(dan.ask(), Ticket)


def test_a_full_pit_gives_up_the_match_whose_seats_are_not_ready_in_time(pit: Pit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_RUNNING", 2)
    _, _, playing, _ = begin(pit)
    table = pit.floor.tables[playing.match]
    for team in Team:
        table.match.ready(team, pit.clock())
    eve, dan, fay, gus = (Client(pit, name) for name in ("eve", "dan", "fay", "gus"))
    eve.ask()
    idle = ticket(dan.ask()).match
    pit.clock.now_s += PATIENCE_S / 2
    assert (fay.ask(), gus.ask()) == (None, None)
    pit.clock.now_s += PATIENCE_S / 2

    assert fay.ask() is None
    assert isinstance(gus.ask(), Ticket)
    assert playing.match in pit.floor.tables
    assert idle not in pit.floor.tables


def test_nobody_begins_a_match_in_a_pit_that_closes(pit: Pit) -> None:
    waiting = Client(pit, "ann")
    waiting.ask()
    pit.seating.close()

    assert Client(pit, "bob").ask() == Closed(reason="the pit begins no more matches")
    pit.reception.sweep(pit.clock())
    assert waiting.heard() == Closed(reason="the pit begins no more matches")
    assert pit.reception.guests == {}


# Seats


def test_who_holds_a_seat_gets_it_again_under_new_keys(pit: Pit) -> None:
    ann, bob, before, _ = begin(pit)
    chair = pit.floor.tables[before.match].chairs[Team.BLUE]
    old_sealer, old_opener = ann.attempt.sit(before.match, Team.BLUE, before.secret)
    opener = chair.opener
    assert opener is not None
    assert opener.open(old_sealer.close(b"orders", 0)) == b"orders"

    after = ticket(ann.ask(match=before.match))
    sealer, _ = ann.attempt.sit(after.match, Team.BLUE, after.secret)

    assert (after.match, after.team, after.commitment) == (before.match, before.team, before.commitment)
    assert after.secret != before.secret
    assert chair.opener is not None
    assert chair.opener is not opener
    with pytest.raises(ForgedError):
        chair.opener.open(old_sealer.close(b"orders", 1))
    assert chair.opener.open(sealer.close(b"orders", 0)) == b"orders"
    assert chair.sealer is not None
    with pytest.raises(ForgedError):
        old_opener.open(chair.sealer.close(encode(Orders(tick=0, actions=b"")), 0))
    assert pit.floor.held == {ann.seat: (after.match, Team.BLUE), bob.seat: (after.match, Team.RED)}


def test_a_seat_that_is_held_is_not_given_to_another_process_of_its_entry(pit: Pit) -> None:
    ann, _, _, _ = begin(pit)

    assert Client(pit, "ann", ann.identity, client="other").ask() is None
    assert pit.floor.held[ann.seat][1] is Team.BLUE


def test_a_seat_that_its_process_left_goes_to_the_entry_s_new_process(pit: Pit) -> None:
    ann, bob, before, _ = begin(pit)
    pit.floor.lose(ann.client)
    again = Client(pit, "ann", ann.identity, client="new")

    after = ticket(again.ask())

    assert (after.match, after.team) == (before.match, before.team)
    assert pit.floor.held == {again.seat: (before.match, Team.BLUE), bob.seat: (before.match, Team.RED)}
    assert pit.floor.tables[before.match].chairs[Team.BLUE].holder == again.seat


@pytest.mark.parametrize("changes", [{}, {"match": "theirs"}, {"team": "blue"}])
def test_a_seat_that_its_process_left_goes_to_nobody_else_of_that_name(pit: Pit, changes: dict[str, str]) -> None:
    ann, bob, before, _ = begin(pit)
    pit.floor.lose(ann.client)
    if "match" in changes:
        changes = {"match": before.match}
    eve = Client(pit, "ann", client=ann.client)

    assert not isinstance(eve.ask(**changes), Ticket)
    assert list(pit.floor.held) == [bob.seat]


@pytest.mark.parametrize("changes", [{"team": "red"}, {"name": "other"}])
def test_a_seat_that_its_process_left_is_not_given_to_who_wants_another(pit: Pit, changes: dict[str, str]) -> None:
    ann, _, _, _ = begin(pit)
    pit.floor.lose(ann.client)

    assert Client(pit, "ann", ann.identity, client="new").ask(**changes) is None


def test_of_two_seats_that_an_entry_left_each_process_gets_its_own_first(pit: Pit) -> None:
    ann = Client(pit, "ann")
    assert ann.ask(slot=1) is None
    ticket(Client(pit, "bob").ask())
    assert ann.ask(slot=2) is None
    ticket(Client(pit, "dan").ask())
    places = {seat.slot: place for seat, place in pit.floor.held.items() if seat.client == ann.client}
    pit.floor.lose(ann.client)

    assert [(ticket(ann.ask(slot=slot)).match) for slot in (2, 1)] == [places[2][0], places[1][0]]


def test_who_asks_for_a_match_that_is_over_is_told_how_it_ended_and_does_not_wait(pit: Pit) -> None:
    ending = pit.floor.endings["0123456789abcdef"] = Signed(data=b"an ending", signature=bytes(64))

    assert Client(pit, "ann").ask(match="0123456789abcdef") == ending
    assert Client(pit, "ann").ask(match="long ago") == Wait(reason="for another match, since that one is over")
    assert pit.reception.guests == {}


def knock_from_nowhere(pit: Pit, **changes: Any) -> Asked:
    """Ask for a seat, with a key of low order to answer to: nothing can be sealed to it."""
    eve, challenge = Client(pit, "eve"), pit.challenge()
    request = replace(
        eve.request(**changes),
        entry=eve.identity.public,
        ephemeral=LOW_ORDER,
        reply_secret=new_secret(),
        challenge=challenge.number,
        pit_key=PIT.public,
    )
    signed = encode(request)
    info = handshake._request_info("pit", PIT.public)
    sealed = handshake._seal(signed + eve.identity.sign("request", signed), challenge.sealing_key, info)
    asked = pit.hear(encode(Knock(sealed=sealed)))
    pit.serve()
    return asked


@pytest.mark.parametrize("changes", [{}, {"team": "green"}, {"match": "over"}])
def test_a_key_of_low_order_brings_nothing_down_and_its_question_gets_no_answer(pit: Pit, changes: dict[str, str]) -> None:
    asked = knock_from_nowhere(pit, **changes)
    pit.reception.sweep(pit.clock() + HOLD_QUESTION_S)
    pit.reception.sweep(pit.clock() + FORGET_WAITING_S)

    assert (asked.is_dropped, asked.answers) == (True, [])
    assert pit.reception.guests == {}
    begin(pit)


def test_who_meets_a_key_of_low_order_gets_a_ticket_all_the_same(pit: Pit) -> None:
    asked = knock_from_nowhere(pit)

    assert ticket(Client(pit, "ann").ask()).opponent == "eve"
    assert (asked.is_dropped, asked.answers) == (True, [])


# The operator


def test_only_the_holder_of_the_pit_s_key_is_obeyed(pit: Pit) -> None:
    ann, _, _, _ = begin(pit)
    for command in ("kick", "ban", "close", "abort", "release-name", "anything"):
        for stranger in (ann, Client(pit, "operator")):
            assert stranger.order(command, "ann") == Refusal(reason="only the holder of the pit's key is obeyed")

    assert pit.floor.told == []
    assert not pit.seating.is_done


def test_a_command_that_is_none_is_refused_with_those_that_are(pit: Pit, operator: Client) -> None:
    assert operator.order("reboot", "x") == Refusal(
        reason="there is no command 'reboot'; it is one of kick, ban, close, abort, release-name"
    )


@pytest.mark.parametrize("by", ["name", "key"])
def test_who_is_kicked_forfeits_and_is_sent_away_and_may_come_back(pit: Pit, operator: Client, by: str) -> None:
    ann, _, blue, _ = begin(pit)
    ann.knock(slot=7)
    pit.serve()
    assert ann.heard() is None

    done = operator.order("kick", "ann" if by == "name" else ann.identity.fingerprint)

    assert isinstance(done, Done)
    assert done.text.endswith(": 1 seats forfeited, 1 sent away")
    assert pit.floor.told == [("forfeit", blue.match, Team.BLUE, "was removed by the operator")]
    assert ann.heard() == Refusal(reason="the operator sent this client away")
    assert pit.reception.guests == {}
    assert ann.ask() is None


def test_who_plays_itself_forfeits_one_match_once(pit: Pit, operator: Client) -> None:
    ann = Client(pit, "ann")
    ann.ask(slot=0)
    ticket(ann.ask(slot=1))

    assert isinstance(operator.order("kick", "ann"), Done)
    assert len(pit.floor.told) == 1


@pytest.mark.parametrize("command", ["kick", "ban", "abort", "release-name"])
def test_who_or_what_is_not_here_is_said_to_be_so(pit: Pit, operator: Client, command: str) -> None:
    begin(pit)

    assert operator.order(command, "nobody") == Refusal(reason="nobody is not here")
    assert pit.floor.told == []


def test_who_is_banned_never_comes_back_under_any_name(pit: Pit, operator: Client) -> None:
    ann, _, blue, _ = begin(pit)

    assert operator.order("ban", "ann") == Done(text="ann is banned; ann: 1 seats forfeited, 0 sent away")
    assert pit.floor.told == [("forfeit", blue.match, Team.BLUE, "was removed by the operator")]
    for name in ("ann", "other"):
        assert Client(pit, name, ann.identity).ask() == Refusal(reason="this key is banned from the pit")
    assert Client(pit, "ann").ask() is None


def test_who_waits_or_is_known_by_name_or_key_can_be_banned(pit: Pit, operator: Client) -> None:
    guest, absent = Client(pit, "guest"), Identity.make()
    guest.ask()

    assert operator.order("ban", "guest") == Done(text="guest is banned; guest: 0 seats forfeited, 1 sent away")
    assert operator.order("ban", "owned") == Done(text="owned is banned; it was not here")
    assert isinstance(operator.order("ban", absent.fingerprint), Done)
    assert Client(pit, "late", absent).ask() == Refusal(reason="this key is banned from the pit")
    assert guest.ask() == Refusal(reason="this key is banned from the pit")


def test_a_pit_that_is_closed_begins_no_more_matches(pit: Pit, operator: Client) -> None:
    assert operator.order("close", "the pit") == Done(text="the pit begins no more matches")
    assert pit.seating.is_done
    assert isinstance(Client(pit, "ann").ask(), Closed)


def test_a_match_that_is_aborted_is_void(pit: Pit, operator: Client) -> None:
    _, _, blue, _ = begin(pit)

    assert operator.order("abort", blue.match) == Done(text=f"match {blue.match} is void")
    assert pit.floor.told == [("void", blue.match, "was ended by the operator")]
    assert operator.order("abort", blue.match) == Refusal(reason=f"{blue.match} is not here")


def test_a_name_that_is_released_is_free(pit: Pit, operator: Client) -> None:
    assert isinstance(Client(pit, "owned").ask(), Refusal)

    assert operator.order("release-name", "owned") == Done(text="the name owned is free")
    assert Client(pit, "owned").ask() is None
