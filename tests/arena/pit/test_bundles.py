"""Bundles: the seats of one client that asked for them, and nobody else's."""

import pytest
from offline_pit import N_UNITS, OfflinePit, Player, plan

from arena.game.types import Team
from arena.match.time_control import TimeControl
from arena.pit.bundles import _LOOK_S
from arena.pit.events import ActionReceived, ActionsTaken, BundleReceived
from arena.pit.lanes import REST_S
from arena.pit.seating import PlannedSeating
from arena.protocol.bundles import MOST_MESSAGES, read_bundle, seat_number
from arena.protocol.codec import MOST_BYTES, encode
from arena.protocol.messages import Bundle, Message, Orders, Ready, Turn

N_MATCHES = 3


class Hall:
    """A client with a seat in each of some matches, and another client in the other seats."""

    def __init__(self, *, bundles: bool = True) -> None:
        self.pit = OfflinePit(PlannedSeating([plan(f"pit/{number}", "ann", "bob") for number in range(N_MATCHES)]))
        self.ann = self._sit("ann", bundles=bundles)
        self.bob = self._sit("bob", bundles=False)
        for one in self.ann:
            one.take()

    def _sit(self, name: str, *, bundles: bool) -> list[Player]:
        first = Player(self.pit, name)
        players = [first] + [Player(self.pit, name, first.identity, first.client) for _ in range(N_MATCHES - 1)]
        for slot, player in enumerate(players):
            player.ask(slot=slot, bundles=bundles)
            if name == "bob":
                player.take()
        return players

    @property
    def lane(self) -> int:
        lane = self.ann[0].ticket.bundle_lane
        assert lane is not None
        return lane

    def bundle(self, *messages: tuple[Player, Message, int]) -> bytes:
        """Return a bundle of what some seats say under a tick."""
        return encode(
            Bundle(
                seats=[seat_number(player.ticket.lane, player.team) for player, _, _ in messages],
                messages=[player.sealer.close(encode(message), tick) for player, message, tick in messages],
            )
        )

    def put(self, payload: bytes) -> None:
        self.pit.do(BundleReceived(self.lane, payload))
        self.pit.do(ActionsTaken())

    def begin(self) -> "Hall":
        for player in self.bob:
            player.ready()
        self.put(self.bundle(*((player, Ready(known_ticks=0), 0) for player in self.ann)))
        return self

    def faults(self) -> int:
        return sum(sum(match.record(team).faults().values()) for match in self.pit.core.matches for team in Team)


def ordered(tick: int) -> Orders:
    return Orders(tick=tick, actions=bytes(N_UNITS))


def test_a_client_that_asked_for_bundles_is_sent_its_seats_turns_in_one_and_answers_in_one() -> None:
    hall = Hall().begin()
    assert len({player.ticket.bundle_lane for player in hall.ann}) == 1
    [first] = hall.pit.bundles[hall.lane]
    assert [number for number, _ in read_bundle(first)] == [seat_number(one.ticket.lane, one.team) for one in hall.ann]

    for player in hall.bob:
        player.order()
    hall.put(hall.bundle(*((player, ordered(0), 0) for player in hall.ann)))

    assert [match.tick for match in hall.pit.core.matches] == [1] * N_MATCHES
    [_, second] = hall.pit.bundles[hall.lane]
    assert len(read_bundle(second)) == N_MATCHES
    assert [[type(message) for message in player.read()] for player in (*hall.ann, *hall.bob)] == [[Turn, Turn]] * 6
    assert not hall.faults()


def test_a_client_that_did_not_ask_for_bundles_gets_none() -> None:
    hall = Hall(bundles=False)
    for player in (*hall.ann, *hall.bob):
        player.ready()

    assert {player.ticket.bundle_lane for player in (*hall.ann, *hall.bob)} == {None}
    assert not hall.pit.bundles
    assert [[type(message) for message in player.read()] for player in hall.ann] == [[Turn]] * N_MATCHES


def test_a_seat_whose_messages_come_one_by_one_plays_as_well() -> None:
    hall = Hall().begin()

    hall.ann[0].read()
    hall.ann[0].order()
    hall.bob[0].order()

    assert [match.tick for match in hall.pit.core.matches] == [1, 0, 0]


@pytest.mark.parametrize(
    "junk",
    [
        b"",
        b"\xc1",
        bytes(MOST_BYTES),
        b"\x91" * 3_000,
        encode(Ready(known_ticks=0)),
        encode(Bundle(seats=[], messages=[])),
        encode(Bundle(seats=[0], messages=[])),
        encode(Bundle(seats=[-1, 2**63], messages=[b"", b""])),
        encode(Bundle(seats=[0] * (MOST_MESSAGES + 1), messages=[b""] * (MOST_MESSAGES + 1))),
    ],
    ids=lambda junk: junk[:8].hex(),
)
def test_junk_on_a_lane_of_bundles_changes_nothing(junk: bytes) -> None:
    hall = Hall().begin()

    hall.put(junk)
    hall.pit.do(BundleReceived(hall.lane + 1, junk))

    assert not hall.faults()
    hall.put(hall.bundle((hall.ann[0], ordered(0), 0)))
    hall.bob[0].order()
    assert hall.pit.core.matches[0].tick == 1


def test_a_bundle_reaches_no_seat_of_another_client() -> None:
    hall = Hall().begin()
    bob, ann = hall.bob[0], hall.ann[0]
    genuine = bob.sealer.close(encode(ordered(0)), 0)
    number = seat_number(bob.ticket.lane, bob.team)

    hall.put(encode(Bundle(seats=[number] * 2, messages=[genuine, b"forged"])))
    ann.read()
    ann.order()

    assert not hall.faults()
    assert [match.tick for match in hall.pit.core.matches] == [0] * N_MATCHES


def test_a_forged_message_in_a_bundle_is_counted_as_one_on_the_seat_s_own_key_and_keeps_the_others_from_nothing() -> None:
    hall = Hall().begin()
    ann, other = hall.ann[:2]
    numbers = [seat_number(one.ticket.lane, one.team) for one in (ann, other)]
    genuine = other.sealer.close(encode(ordered(0)), 0)

    hall.put(encode(Bundle(seats=[*numbers, numbers[1]], messages=[bytes(92), genuine, genuine])))
    hall.bob[1].order()

    records = [hall.pit.core.matches[number].record(one.team) for number, one in enumerate((ann, other))]
    assert [record.faults() | {"forged": 0} for record in records] == [dict.fromkeys(records[0].faults(), 0)] * 2
    assert [record.forged for record in records] == [1, 0]
    assert [match.tick for match in hall.pit.core.matches] == [0, 1, 0]


def test_who_takes_a_seat_over_has_it_alone() -> None:
    hall = Hall().begin()
    former = replace_client(hall.ann[0], "another")
    hall.ann[0].vanish()
    former.join(slot=0)

    hall.put(hall.bundle((hall.ann[0], ordered(0), 0)))

    assert former.ticket.bundle_lane is None
    assert former.ticket.match == hall.ann[0].ticket.match
    assert not hall.pit.core.matches[0].record(former.team).stale


def replace_client(player: Player, client: str) -> Player:
    return Player(player.pit, player.name, player.identity, client)


def test_the_clock_of_a_turn_begins_when_its_bundle_is_sent() -> None:
    hall = Hall().begin()
    hall.put(hall.bundle((hall.ann[0], ordered(0), 0)))
    bob = hall.bob[0]
    hall.pit.do(ActionReceived(bob.ticket.lane, bob.team, bob.sealer.close(encode(ordered(0)), 0)))
    hall.pit.now_s += 0.75  # in which the pit hands in what others sent
    hall.pit.do(ActionsTaken())

    hall.pit.now_s += 0.25
    hall.put(hall.bundle((hall.ann[0], ordered(1), 1)))

    [latency_s] = hall.pit.core.matches[0].record(hall.ann[0].team).latencies_s[1:]
    assert latency_s == pytest.approx(0.25)


def test_a_turn_that_is_asked_for_again_does_not_renew_its_clock() -> None:
    hall = Hall().begin()
    hall.pit.now_s += 0.5

    hall.put(hall.bundle((hall.ann[0], Ready(known_ticks=0), 0)))
    hall.pit.now_s += 0.25
    hall.put(hall.bundle((hall.ann[0], ordered(0), 0)))

    assert len(hall.pit.sent[hall.ann[0].place]) == 2
    [latency_s] = hall.pit.core.matches[0].record(hall.ann[0].team).latencies_s
    assert latency_s == pytest.approx(0.75)


def test_a_seat_that_comes_back_gets_its_history_in_bundles() -> None:
    hall = Hall().begin()
    ann, bob = hall.ann[0], hall.bob[0]
    for _ in range(3):
        ann.read()
        ann.order()
        bob.read()
        bob.order()
    ann.shown.clear()
    ann.vanish()
    ann.join(slot=0, bundles=True)

    hall.put(hall.bundle((ann, Ready(known_ticks=0), 0)))
    ann.read()

    assert len(ann.shown) == 3
    assert ann.ticket.bundle_lane == hall.lane


def test_a_lane_of_bundles_is_given_back_once_its_client_holds_no_seat() -> None:
    hall = Hall().begin()
    for _ in range(3):
        hall.pit.pass_time(_LOOK_S)
    bundles = hall.pit.core._matches._sessions._bundles
    assert bundles.at(hall.lane) is not None

    hall.ann[0].vanish()
    hall.pit.pass_time(10 * TimeControl().grace_s)  # and each match is forfeited
    for _ in range(4):
        hall.pit.pass_time(_LOOK_S)

    assert not hall.pit.core.n_running
    assert bundles.at(hall.lane) is None
    assert bundles._lanes.take(hall.pit.now_s + REST_S) == hall.lane
