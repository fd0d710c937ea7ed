"""A slot, joined with the pit's side of the handshake without a network: what the pit must promise, sign and seal."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from arena.errors import ForgedError, ProtocolError, RefusedError
from arena.game.keys import MatchKeys
from arena.game.observation import Observations
from arena.game.ruleset import load, to_dict
from arena.game.types import RULES_VERSION, Team
from arena.match.effects import Ask
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.pit.authenticator import Authenticator
from arena.policy import BatchPolicy
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt, new_secret
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    Challenge,
    Commitment,
    Ended,
    JoinRequest,
    Message,
    Orders,
    Ready,
    Receipt,
    Signed,
    Ticket,
    Turn,
)
from arena.protocol.sealing import Opener, Sealer
from arena.protocol.signed import check_receipt, commit, sign_statement
from arena.records.journal import Header
from arena.records.transcript import Head
from clients.seat import Seat
from clients.slot import Slot

RULES = load("paper").with_({"side": 10})
UNITS = len(RULES.team(Team.RED))
MATCH = "0123456789abcdef"
KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x08" * 32)
OTHER_KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x09" * 32)
ANN, PIT, MAN = (Identity.make() for _ in range(3))
ENDED = Ended(match=MATCH, ending="tick_limit", winner="blue", score=3, ticks=2, reason="")


def shown() -> list[bytes]:
    """Return what red is shown while nobody moves."""
    match = Match(Header(identity="m", blue="a", red="b", ruleset=RULES, keys=KEYS), TimeControl(turn_time_s=None), 0.0)
    events = [event for team in Team for event in match.ready(team, 0.0)]
    for tick in range(2):
        events += [event for team in Team for event in match.submit(team, tick, bytes(UNITS), 0.0)]
    return [event.observation for event in events if isinstance(event, Ask) and event.team is Team.RED]


SHOWN = shown()


class Counter(BatchPolicy):
    def act(self, observations: Observations, orders: np.ndarray) -> None:
        orders[:] = (int(observations.tick[0]) + 1) % 5


class Pit:
    """The pit's side of a seat."""

    def __init__(self, identity: Identity = PIT) -> None:
        self.identity, self.authenticator = identity, Authenticator("pit", identity)
        self.sealer: Sealer
        self.opener: Opener

    def offer(self, commitment: Any = None, match: str = MATCH) -> tuple[Ticket, Attempt]:
        """Return a ticket for red's seat, and the request that it answers."""
        challenge = decode(self.authenticator.challenge(0.0))
        assert isinstance(challenge, Challenge)
        request = JoinRequest(rules_version=RULES_VERSION, name="ann", team="any", client="c", slot=0)
        attempt = Attempt(ANN, "pit", challenge, request)
        secret = new_secret()
        self.sealer, self.opener = self.authenticator.open(attempt.sealed, 0.0).sit(match, Team.RED, secret, 64)
        ticket = Ticket(
            match=match,
            team=int(Team.RED),
            ruleset={"name": RULES.name, **to_dict(RULES)},
            opponent="bob",
            turn_time_s=None,
            bank_s=0.0,
            tick=0,
            secret=secret,
            commitment=encode(self.commit(match)) if commitment is None else commitment,
        )
        return ticket, attempt

    def commit(self, match: str = MATCH, keys: MatchKeys = KEYS) -> Signed:
        return sign_statement(self.identity, Commitment(match=match, digest=commit(match, keys)))

    def say(self, message: Message, tick: int = 0) -> bytes:
        return self.sealer.close(encode(message), tick)

    def turn(self, tick: int) -> bytes:
        return self.say(Turn(tick=tick, observation=SHOWN[tick]), tick)


def make(ticket: Ticket, commitment: Commitment) -> Seat:
    return Seat(ticket, commitment.digest, Counter)


@pytest.fixture
def pit() -> Pit:
    return Pit()


@pytest.fixture
def sent() -> list[bytes]:
    """Return what the slot puts on the network."""
    return []


@pytest.fixture
def slot(sent: list[bytes]) -> Slot:
    slot = Slot(0, ANN)
    slot.put = sent.append
    return slot


@pytest.fixture
def seated(slot: Slot, pit: Pit, sent: list[bytes]) -> Slot:
    assert slot.take(*pit.offer(), make)
    slot.put = sent.append
    return slot


# Commitments


def test_a_ticket_with_the_pit_s_commitment_is_taken(slot: Slot, pit: Pit) -> None:
    assert slot.take(*pit.offer(), make)

    assert slot.seat is not None
    assert (slot.seat.ticket.match, slot.seat.team, slot.seat.commitment) == (MATCH, Team.RED, commit(MATCH, KEYS))


@pytest.mark.parametrize(
    "commitment",
    [
        b"",
        b"junk",
        encode(Commitment(match=MATCH, digest=commit(MATCH, KEYS))),
        encode(Pit().commit("another")),
        encode(Pit(MAN).commit()),
        encode(replace(Pit().commit(), signature=bytes(64))),
        encode(replace(Pit().commit(), data=Pit().commit(keys=OTHER_KEYS).data)),
        encode(sign_statement(PIT, ENDED)),
        encode(Ready(known_ticks=0)),
    ],
)
def test_a_ticket_without_the_pit_s_commitment_to_its_match_is_refused(slot: Slot, pit: Pit, commitment: bytes) -> None:
    with pytest.raises(RefusedError, match=f"the ticket lacks the pit's commitment to match {MATCH}"):
        slot.take(*pit.offer(commitment), make)

    assert slot.seat is None


def test_who_comes_back_to_a_match_under_another_commitment_is_warned(seated: Slot, pit: Pit) -> None:
    seat, before = seated.seat, pit.sealer
    other = encode(pit.commit(keys=OTHER_KEYS))

    with pytest.raises(RefusedError, match=f"the pit commits itself to match {MATCH} anew"):
        seated.take(*pit.offer(other), make)

    pit.sealer = before  # what was agreed on before still stands
    assert seated.seat is seat
    seated.receive(pit.turn(0))
    assert seated.seat.known_ticks == 1


def test_who_comes_back_keeps_its_seat_and_what_it_was_shown(seated: Slot, pit: Pit) -> None:
    seat = seated.seat
    seated.receive(pit.turn(0))

    assert not seated.take(*pit.offer(), make)

    assert seated.seat is seat
    assert seat.ready() == Ready(known_ticks=1)


def test_a_ticket_for_another_match_makes_another_seat(seated: Slot, pit: Pit) -> None:
    left: list[str] = []
    seated.leave.callback(left.append, "keys on the network")
    seat = seated.seat

    assert seated.take(*pit.offer(match="another"), make)

    assert seated.seat is not seat
    assert (left, seated.put) == (["keys on the network"], None)


# Orders


def test_orders_are_sealed_for_the_pit_and_said_again_as_the_same_bytes(seated: Slot, pit: Pit, sent: list[bytes]) -> None:
    for _ in range(3):
        seated.receive(pit.turn(0))
    seated.receive(pit.turn(1))
    seated.receive(pit.turn(1))

    assert sent == [sent[0]] * 3 + [sent[3]] * 2
    assert sent[0] != sent[3]
    opened = [decode(pit.opener.open(data)) for data in sent]
    assert opened == [Orders(tick=0, actions=b"\x01" * UNITS)] * 3 + [Orders(tick=1, actions=b"\x02" * UNITS)] * 2


def test_the_same_orders_under_new_keys_are_other_bytes(seated: Slot, pit: Pit, sent: list[bytes]) -> None:
    seated.receive(pit.turn(0))
    old = pit.opener
    seated.take(*pit.offer(), make)
    seated.receive(pit.turn(0))

    assert sent[0] != sent[1]
    assert decode(old.open(sent[0])) == decode(pit.opener.open(sent[1])) == Orders(tick=0, actions=b"\x01" * UNITS)
    for opener, data in ((old, sent[1]), (pit.opener, sent[0])):
        with pytest.raises(ForgedError):
            opener.open(data)


def test_what_was_sealed_under_old_keys_is_not_heard_under_new_ones(seated: Slot, pit: Pit, sent: list[bytes]) -> None:
    late = pit.turn(0)
    seated.take(*pit.offer(), make)

    with pytest.raises(ForgedError):
        seated.receive(late)

    assert sent == []


def test_without_a_seat_or_a_way_to_the_pit_nothing_is_said(slot: Slot, pit: Pit, sent: list[bytes]) -> None:
    slot.receive(b"anything")
    slot.send(Ready(known_ticks=0))
    slot.take(*pit.offer(), make)
    slot.fall_silent()
    slot.receive(pit.turn(0))

    assert sent == []
    assert slot.seat is not None
    assert slot.seat.known_ticks == 1


# Endings


def test_an_ending_that_the_pit_signed_is_believed_and_receipted(seated: Slot, pit: Pit, sent: list[bytes]) -> None:
    for tick in range(2):
        seated.receive(pit.turn(tick))
    seated.receive(pit.say(sign_statement(PIT, ENDED)))

    assert seated.seat is not None
    assert seated.seat.ended == ENDED
    receipt = [decode(pit.opener.open(data)) for data in sent][-1]
    head = Head()
    for observation in SHOWN[:2]:
        head.add(observation)
    assert isinstance(receipt, Receipt)
    assert (receipt.n_shown, receipt.head) == (2, head.digest)
    check_receipt(ANN.public, MATCH, Team.RED, receipt)


@pytest.mark.parametrize(
    "ending",
    [
        ENDED,
        sign_statement(MAN, ENDED),
        sign_statement(ANN, ENDED),
        replace(sign_statement(PIT, ENDED), signature=bytes(64)),
        replace(sign_statement(PIT, ENDED), data=encode(replace(ENDED, winner="red"))),
        sign_statement(PIT, replace(ENDED, match="another")),
        sign_statement(PIT, Commitment(match=MATCH, digest=commit(MATCH, KEYS))),
        sign_statement(PIT, replace(ENDED, ending="rapture")),
        Signed(data=b"junk", signature=PIT.sign("fact", b"junk")),
        Signed(data=encode(ENDED), signature=PIT.sign("journal", encode(ENDED))),
    ],
)
def test_an_ending_that_is_not_the_pit_s_or_of_another_match_is_not_believed(
    seated: Slot, pit: Pit, sent: list[bytes], ending: Message
) -> None:
    """Though it was sealed as the pit seals: what ends a match is to be shown to others."""
    with pytest.raises(ProtocolError):
        seated.receive(pit.say(ending))

    assert seated.seat is not None
    assert seated.seat.ended is None
    assert sent == []
    seated.receive(pit.turn(0))
    assert len(sent) == 1


def test_an_ending_that_comes_again_is_receipted_again(seated: Slot, pit: Pit, sent: list[bytes]) -> None:
    seated.receive(pit.say(sign_statement(PIT, ENDED)))
    seated.receive(pit.say(sign_statement(PIT, ENDED)))

    assert [type(decode(pit.opener.open(data))) for data in sent] == [Receipt, Receipt]


def test_what_is_not_sealed_by_the_pit_changes_nothing(seated: Slot, pit: Pit, sent: list[bytes]) -> None:
    genuine = pit.turn(0)
    tries: list[Callable[[], bytes]] = [
        lambda: b"",
        lambda: encode(Turn(tick=0, observation=SHOWN[0])),
        lambda: genuine[:-1] + bytes([genuine[-1] ^ 1]),
        lambda: encode(sign_statement(PIT, ENDED)),
    ]
    for data in tries:
        with pytest.raises(ProtocolError):
            seated.receive(data())

    assert sent == []
    seated.receive(genuine)
    assert len(sent) == 1
