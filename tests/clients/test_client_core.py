"""A client's core joined with a scripted pit: no network, no clock, no patch."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey

from arena.errors import KeyFileError, LostPitError, RefusedError, RulesetError
from arena.game.keys import MatchKeys
from arena.game.observation import Observations
from arena.game.ruleset import load, to_dict
from arena.game.types import Team, Termination
from arena.policy import BatchPolicy, MatchResult, Thinking
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import new_secret, open_request, sign_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    PROTOCOL_VERSION,
    ChallengeRequest,
    Closed,
    Commitment,
    Ended,
    History,
    JoinRequest,
    JournalPiece,
    JournalRequest,
    Message,
    Orders,
    Ready,
    Receipt,
    Refusal,
    SealedAnswer,
    Signed,
    Ticket,
    Turn,
    Wait,
)
from arena.protocol.observation_codec import ObservationReader, ObservationWriter
from arena.protocol.sealing import Opener, Sealer
from arena.protocol.signed import check_receipt, commit, sign_statement
from arena.records.transcript import Head
from clients import events
from clients.audit import Verdict
from clients.core import ANSWER_S, MOST_UNANSWERED, PROBE_S, SILENCE_S, START_S, ClientCore
from clients.seat import Seat
from clients.settings import ClientSettings

RULES = load("paper").with_({"side": 10})
UNITS = len(RULES.team(Team.RED))
MATCH, NEXT = "0123456789abcdef", "fedcba9876543210"
LANES = {MATCH: 7, NEXT: 8}
KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x08" * 32)
OTHER_KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x09" * 32)
ANN, PIT, MAN = (Identity.make() for _ in range(3))
ENDED = Ended(match=MATCH, ending="tick_limit", winner="blue", score=3, ticks=2, reason="")
LOST = LostPitError("no pit called pit answers")
JOIN = topics.join("pit")
TICK_S = 0.25


def observation(tick: int) -> bytes:
    blank = ObservationReader(RULES, Team.RED).blank()
    blank.tick[:] = tick
    return ObservationWriter(blank, 0).write()


class Counter(BatchPolicy):
    def act(self, observations: Observations, orders: np.ndarray) -> None:
        orders[:] = (int(observations.tick[0]) + 1) % 5


class Thinker(Counter):
    """Needs longer until it is done."""

    is_done = False

    def act(self, observations: Observations, orders: np.ndarray) -> None:
        if not Thinker.is_done:
            raise Thinking
        super().act(observations, orders)


class Loader(Counter):
    """Has not started until it is loaded."""

    is_loaded = False

    def start(self, seats: np.ndarray) -> None:
        if not Loader.is_loaded:
            raise Thinking


def orders(tick: int) -> Orders:
    return Orders(tick=tick, actions=bytes([(tick + 1) % 5]) * UNITS)


def commitment(match: str = MATCH, keys: MatchKeys = KEYS, by: Identity = PIT) -> Signed:
    return sign_statement(by, Commitment(match=match, digest=commit(match, keys)))


def ticket(match: str = MATCH, **changes: Any) -> Ticket:
    plain = Ticket(
        match=match,
        lane=LANES.get(match, 9),
        team=int(Team.RED),
        ruleset={"name": RULES.name, **to_dict(RULES)},
        opponent="bob",
        turn_time_s=None,
        bank_s=0.0,
        tick=0,
        secret=new_secret(),
        commitment=encode(commitment(match)),
    )
    return replace(plain, **changes)


class Joined:
    """Both ends: a core, and a pit that answers what a test wants, made of the protocol's own parts."""

    def __init__(self, identity: Identity = PIT, **settings: Any) -> None:
        usual = {"endpoint": "", "n_matches": 1, "make": Counter, "identity": ANN, "patience_s": 10.0}
        self.core = ClientCore(
            ClientSettings(pit="pit", name="ann", team="any", **{**usual, **settings}),
            "client",
            lambda ticket, digest, _: Seat(ticket, digest, settings.get("make", Counter)),
        )
        self.now_s = 1_000.0
        self.queries: list[events.Query] = []
        """Unanswered, the oldest first."""
        self.published: list[bytes] = []
        self.heard: list[Message] = []
        """The same as the pit's keys open it."""
        self.requests: list[JoinRequest] = []
        self._identity, self._private = identity, X25519PrivateKey.generate()
        self._keys: dict[int, tuple[Sealer, Opener]] = {}

    def feed(self, event: events.Event, after_s: float = 0.0) -> list[events.Effect]:
        self.now_s += after_s
        effects = self.core.receive(event, self.now_s)
        self.queries += [effect for effect in effects if isinstance(effect, events.Query)]
        for effect in effects:
            if isinstance(effect, events.Publish):
                self.published.append(effect.payload)
                self.heard.append(decode(self._keys[effect.slot][1].open(effect.payload)))
        return effects

    def connect(self) -> list[events.Effect]:
        assert self.feed(events.Connected()) == []
        return self.feed(events.TimePassed())

    def challenge(self) -> bytes:
        public = self._private.public_key().public_bytes_raw()
        return encode(sign_challenge("pit", self._identity, public, bytes(32)))

    def reply(self, payload: bytes) -> list[events.Effect]:
        """Answer the oldest query."""
        return self.feed(events.ReplyReceived(self.queries.pop(0).id, payload))

    def answer(self, message: Message) -> list[events.Effect]:
        """Answer the oldest question: its ChallengeRequest, and the request that follows."""
        assert decode(self.queries[0].payload) == ChallengeRequest()
        effects = self.reply(self.challenge())
        assert [type(effect) for effect in effects] == [events.Query]
        query = self.queries.pop()
        assert query.key == JOIN
        caller = open_request(query.payload, "pit", self._identity.public, self._private)
        assert isinstance(caller.request, JoinRequest)
        self.requests.append(caller.request)
        if isinstance(message, Ticket):
            self._keys[caller.request.slot] = caller.sit(message.match, Team.RED, message.secret, 64)
        return self.feed(events.ReplyReceived(query.id, caller.answer(message)))

    def seal(self, message: Message, slot: int = 0) -> bytes:
        return self._keys[slot][0].close(encode(message), 0)

    def deliver(self, message: Message, slot: int = 0) -> list[events.Effect]:
        return self.feed(events.MessageReceived(slot, self.seal(message, slot)))

    def turn(self, tick: int, slot: int = 0) -> list[events.Effect]:
        return self.deliver(Turn(tick=tick, observation=observation(tick)), slot)


def seated(**settings: Any) -> Joined:
    both = Joined(**settings)
    both.connect()
    both.answer(ticket())
    return both


@pytest.fixture
def both() -> Joined:
    return seated()


# Asking for a seat


def test_a_client_asks_for_a_seat_takes_it_and_says_that_it_is_ready() -> None:
    both = Joined(invite="code", rules_hash="hash")

    (query,) = both.connect()
    assert isinstance(query, events.Query)
    assert (query.key, query.timeout_s) == (JOIN, ANSWER_S)
    begun, opened, published = both.answer(ticket())

    (request,) = both.requests
    assert (request.name, request.team, request.client, request.slot) == ("ann", "any", "client", 0)
    assert (request.match, request.invite, request.rules_hash, request.entry) == ("", "code", "hash", ANN.public)
    assert isinstance(begun, events.MatchBegun)
    assert (begun.seat.ticket.match, begun.seat.commitment) == (MATCH, commit(MATCH, KEYS))
    assert opened == events.OpenSeat(0, LANES[MATCH], Team.RED)
    assert isinstance(published, events.Publish)
    assert both.heard == [Ready(known_ticks=0)]


def test_a_client_that_is_to_wait_asks_again_at_once() -> None:
    both = Joined()
    both.connect()

    for _ in range(3):
        waiting, query = both.answer(Wait(reason="for an opponent"))
        assert waiting == events.Waiting("for an opponent")
        assert isinstance(query, events.Query)

    assert isinstance(both.answer(ticket())[0], events.MatchBegun)


@pytest.mark.parametrize("n_slots", [1, 2])
def test_a_client_of_several_slots_asks_for_bundles_and_leaves_them_out_where_nobody_answers(n_slots: int) -> None:
    both = Joined(n_slots=n_slots, n_matches=None, count_ready=lambda: 1)
    both.connect()
    both.answer(Wait(reason="for an opponent"))
    both.reply(both.challenge())
    both.reply(b"")  # as of a pit that knew no bundles yet
    both.feed(events.TimePassed(), TICK_S)
    both.answer(ticket())

    assert [request.bundles for request in both.requests] == [n_slots > 1, False]


def test_a_seat_s_bundles_are_those_of_its_last_ticket() -> None:
    both = seated()
    both.feed(events.TimePassed(), SILENCE_S + 0.1)
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    opened, _ = both.answer(ticket(bundle_lane=5))

    assert opened == events.OpenSeat(0, LANES[MATCH], Team.RED, 5)


def test_a_client_says_by_which_version_of_its_code_it_plays() -> None:
    both = Joined(version="0123abcd", n_matches=2)
    both.connect()
    both.answer(ticket())
    both.feed(events.TimePassed(), SILENCE_S + 0.1)
    both.answer(ticket())  # of the match that it plays, whose version the pit knows

    assert [request.version for request in both.requests] == ["0123abcd", ""]


def test_a_pit_that_cannot_read_a_version_is_asked_without_one() -> None:
    both = Joined(version="0123abcd")
    both.connect()
    both.reply(both.challenge())
    refusal = Refusal(reason="JoinRequest has 13 fields, not 14")  # as a pit of before answers, which cannot seal it
    assert both.reply(encode(refusal)) == []

    both.feed(events.TimePassed(), TICK_S)
    begun = both.answer(ticket())[0]

    assert isinstance(begun, events.MatchBegun)
    assert [request.version for request in both.requests] == [""]


def test_a_refusal_is_an_error_with_the_pits_reason() -> None:
    both = Joined()
    both.connect()

    with pytest.raises(RefusedError, match="the pit says no: wrong code"):
        both.answer(Refusal(reason="wrong code"))


def test_a_refusal_ends_no_match_of_another_slot() -> None:
    both = Joined(n_slots=2, n_matches=3)
    both.connect()
    both.answer(ticket())

    assert both.answer(Refusal(reason="red is taken")) == [events.Waiting("no more with slot 2: red is taken")]
    both.turn(0)
    both.deliver(sign_statement(PIT, ENDED))

    assert both.heard[1] == orders(0)
    assert (both.core.is_done, both.core.n_ended) == (False, 1)
    with pytest.raises(RefusedError, match="the pit says no: red is taken"):
        both.answer(Refusal(reason="red is taken"))


def test_a_refusal_to_the_only_slot_that_is_seated_is_an_error() -> None:
    both = seated()
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    with pytest.raises(RefusedError, match="banned"):
        both.answer(Refusal(reason="banned"))


def test_a_client_is_done_when_the_pit_has_no_more_matches() -> None:
    both = Joined(n_matches=None)
    both.connect()

    assert both.answer(Closed(reason="all is played")) == [events.Waiting("no more: all is played")]
    assert both.core.is_done
    assert both.feed(events.TimePassed(), 100.0) == []


def test_an_unanswered_question_is_asked_again_later_and_in_the_end_over_another_connection() -> None:
    both = Joined()
    (query,) = both.connect()

    for _ in range(MOST_UNANSWERED - 1):
        assert both.reply(b"") == []
        (query,) = both.feed(events.TimePassed(), TICK_S)
        assert isinstance(query, events.Query)
    both.reply(b"")
    assert both.feed(events.TimePassed(), TICK_S) == [events.Reconnect()]

    with pytest.raises(LostPitError, match="no pit called pit answers"):
        both.feed(events.Disconnected(LOST))


def test_an_answer_sets_the_count_of_unanswered_questions_back() -> None:
    both = Joined()
    both.connect()

    for _ in range(3):
        for _ in range(MOST_UNANSWERED - 1):
            both.reply(b"")
            both.feed(events.TimePassed(), TICK_S)
        assert isinstance(both.answer(Wait(reason="x"))[-1], events.Query)


@pytest.mark.parametrize("has_challenge", [False, True])
def test_a_question_that_stays_open_for_too_long_wants_another_connection(has_challenge: bool) -> None:
    both = Joined()
    both.connect()
    if has_challenge:
        both.reply(both.challenge())

    assert both.feed(events.TimePassed(), ANSWER_S) == []
    assert both.feed(events.TimePassed(), 0.1) == [events.Reconnect()]


def test_no_request_goes_to_a_pit_that_is_not_trusted() -> None:
    shown: list[bytes] = []

    def trust(pit_key: bytes) -> None:
        shown.append(pit_key)
        raise KeyFileError("another pit")

    both = Joined(trust=trust)
    both.connect()

    with pytest.raises(KeyFileError):
        both.reply(both.challenge())
    assert shown == [PIT.public]


def change_pit(both: Joined) -> bytes:
    return encode(sign_challenge("another", PIT, bytes(range(32)), bytes(32)))


@pytest.mark.parametrize(
    "forge",
    [
        lambda _: b"junk",
        lambda _: encode(ChallengeRequest()),
        lambda both: encode(replace(decode(both.challenge()), signature=bytes(64))),
        change_pit,
        lambda _: encode(Refusal(reason="go away")),
    ],
)
def test_a_challenge_that_no_pit_of_this_name_made_counts_for_nothing(forge: Callable[[Joined], bytes]) -> None:
    both = Joined()
    both.connect()

    assert both.reply(forge(both)) == []
    both.feed(events.TimePassed(), TICK_S)

    assert isinstance(both.answer(ticket())[0], events.MatchBegun)


def test_a_pit_of_another_version_is_refused() -> None:
    both = Joined()
    both.connect()
    data = bytearray(both.challenge())
    data[1] = PROTOCOL_VERSION - 1  # it stands first in the array

    with pytest.raises(RefusedError, match="the pit cannot be understood"):
        both.reply(bytes(data))


@pytest.mark.parametrize("payload", [b"", b"junk", encode(Refusal(reason="no")), encode(SealedAnswer(sealed=bytes(80)))])
def test_an_answer_that_the_pit_did_not_seal_counts_for_nothing(payload: bytes) -> None:
    both = Joined()
    both.connect()
    both.reply(both.challenge())

    assert both.reply(payload) == []
    both.feed(events.TimePassed(), TICK_S)

    assert isinstance(both.answer(ticket())[0], events.MatchBegun)


@pytest.mark.parametrize(
    "forged",
    [
        b"",
        b"junk",
        encode(Commitment(match=MATCH, digest=commit(MATCH, KEYS))),
        encode(commitment(NEXT)),
        encode(commitment(by=MAN)),
        encode(replace(commitment(), signature=bytes(64))),
        encode(replace(commitment(), data=commitment(keys=OTHER_KEYS).data)),
        encode(sign_statement(PIT, ENDED)),
        encode(Ready(known_ticks=0)),
    ],
)
def test_a_ticket_without_the_pits_commitment_to_its_match_is_refused(forged: bytes) -> None:
    both = Joined()
    both.connect()

    with pytest.raises(RefusedError, match=f"the ticket lacks the pit's commitment to match {MATCH}"):
        both.answer(ticket(commitment=forged))


@pytest.mark.parametrize(("changes", "error"), [({"team": 7}, RefusedError), ({"ruleset": {"side": 7}}, RulesetError)])
def test_a_ticket_for_no_match_that_can_be_is_refused(changes: dict[str, Any], error: type[Exception]) -> None:
    both = Joined()
    both.connect()

    with pytest.raises(error):
        both.answer(ticket(**changes))


# Turns


def test_a_turn_is_answered_and_a_resend_gets_the_same_bytes(both: Joined) -> None:
    for tick in (0, 0, 0, 1, 1):
        (effect,) = both.turn(tick)
        assert isinstance(effect, events.Publish)

    assert both.heard[1:] == [orders(0)] * 3 + [orders(1)] * 2
    assert both.published[1:] == [both.published[1]] * 3 + [both.published[4]] * 2


def history(first: int, end: int) -> History:
    seen = [observation(tick) for tick in range(first, end)]
    return History(first_tick=first, observations=seen, orders=[bytes(UNITS)] * len(seen), end_tick=end)


def test_a_turn_beyond_what_was_seen_takes_the_seat_anew_for_the_history(both: Joined) -> None:
    assert both.turn(2) == []
    (query,) = both.feed(events.TimePassed(), TICK_S)
    assert isinstance(query, events.Query)
    both.answer(ticket())
    both.deliver(history(0, 2))
    both.turn(2)

    assert both.requests[-1].match == MATCH
    assert both.heard[1:] == [Ready(known_ticks=0), Ready(known_ticks=2), orders(2)]


def test_a_client_is_ready_once_its_policy_has_started(monkeypatch: pytest.MonkeyPatch) -> None:
    both = seated(make=Loader)
    for _ in range(40):
        assert both.feed(events.TimePassed(), TICK_S) == [], "the pit has nothing to say, so silence is nothing"

    monkeypatch.setattr(Loader, "is_loaded", True)
    assert len(both.feed(events.Woken())) == 1

    assert both.heard == [Ready(known_ticks=0)]


def test_a_client_whose_policy_never_starts_asks_at_last_whether_its_match_still_runs() -> None:
    both = seated(make=Loader)
    assert both.feed(events.TimePassed(), START_S) == []

    (query,) = both.feed(events.TimePassed(), 0.1)

    assert isinstance(query, events.Query)


def test_a_client_does_not_ask_about_its_match_while_it_catches_up(monkeypatch: pytest.MonkeyPatch) -> None:
    both = seated(make=Thinker)
    both.deliver(history(0, 3))
    for _ in range(40):
        assert both.feed(events.TimePassed(), TICK_S) == []

    monkeypatch.setattr(Thinker, "is_done", True)
    both.feed(events.Woken())

    assert both.heard == [Ready(known_ticks=0), Ready(known_ticks=3)]


def forgeries(both: Joined) -> list[bytes]:
    genuine = both.seal(Turn(tick=0, observation=observation(0)))
    return [
        b"",
        b"junk",
        encode(Turn(tick=0, observation=observation(0))),
        genuine[:-1] + bytes([genuine[-1] ^ 1]),
        encode(sign_statement(PIT, ENDED)),
        both.seal(Turn(tick=0, observation=b"short")),
    ]


def test_what_the_referee_did_not_seal_changes_nothing(both: Joined) -> None:
    for payload in forgeries(both):
        assert both.feed(events.MessageReceived(0, payload)) == []

    assert both.turn(0)
    assert both.heard[1:] == [orders(0)]


def test_nothing_is_heard_without_a_seat() -> None:
    both = Joined()
    both.connect()

    assert both.feed(events.MessageReceived(0, b"anything")) == []
    assert both.feed(events.Woken()) == []


@pytest.mark.parametrize("event", [events.Woken(), events.TimePassed()])
def test_a_policy_that_needs_longer_is_asked_again(event: events.Event, monkeypatch: pytest.MonkeyPatch) -> None:
    both = seated(make=Thinker)
    assert both.turn(0) == []
    assert both.feed(event) == []

    monkeypatch.setattr(Thinker, "is_done", True)
    assert len(both.feed(event)) == 1
    assert both.feed(event) == []

    assert both.heard[1:] == [orders(0)]


def test_a_policy_is_not_asked_again_once_the_connection_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    both = seated(make=Thinker)
    both.turn(0)
    both.feed(events.Disconnected(LOST))

    monkeypatch.setattr(Thinker, "is_done", True)
    assert both.feed(events.Woken()) == []


# Silence, and a pit that went away


def test_a_silent_seat_asks_whether_its_match_still_runs(both: Joined) -> None:
    both.turn(0)
    both.feed(events.TimePassed(), 60.0)  # silence begins now, however long the policy thought
    assert both.feed(events.TimePassed(), SILENCE_S) == []

    (query,) = both.feed(events.TimePassed(), 0.1)
    assert isinstance(query, events.Query)
    assert query.timeout_s == PROBE_S
    opened, ready = both.answer(ticket())
    assert opened == events.OpenSeat(0, LANES[MATCH], Team.RED), "which is open"

    assert (both.requests[-1].match, both.requests[-1].team) == (MATCH, "red")
    assert isinstance(ready, events.Publish), "its keys on the network are the same"
    assert both.heard[-1] == Ready(known_ticks=1)
    assert both.feed(events.TimePassed(), SILENCE_S) == []


def test_a_silent_seat_whose_question_stays_open_wants_another_connection(both: Joined) -> None:
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    assert both.feed(events.TimePassed(), PROBE_S) == []
    assert both.feed(events.TimePassed(), 0.1) == [events.Reconnect()]


def test_a_seat_is_taken_again_over_another_connection_under_new_keys(both: Joined) -> None:
    both.turn(0)
    stale = both.seal(Turn(tick=1, observation=observation(1)))
    assert both.feed(events.Disconnected(LOST), 1.0) == [events.Waiting("for the pit to come back")]
    assert both.feed(events.MessageReceived(0, stale)) == [], "its keys on the network are gone"

    both.connect()
    opened, _ = both.answer(ticket())
    assert both.feed(events.MessageReceived(0, stale)) == []
    both.turn(0)
    both.turn(1)

    assert opened == events.OpenSeat(0, LANES[MATCH], Team.RED)
    assert both.requests[-1].match == MATCH
    assert both.heard[1:] == [orders(0), Ready(known_ticks=1), orders(0), orders(1)]
    assert both.published[1] != both.published[3]


def test_an_answer_that_comes_over_a_connection_that_is_closed_counts_for_nothing() -> None:
    both = Joined()
    both.connect()
    both.answer(Wait(reason="x"))
    stale = both.queries.pop()
    both.feed(events.Disconnected(LOST))
    both.connect()

    assert both.feed(events.ReplyReceived(stale.id, both.challenge())) == []
    assert isinstance(both.answer(ticket())[0], events.MatchBegun)


def test_the_same_match_under_another_commitment_is_refused_and_what_was_agreed_stands(both: Joined) -> None:
    keys = both._keys[0]
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    with pytest.raises(RefusedError, match=f"the pit commits itself to match {MATCH} anew"):
        both.answer(ticket(commitment=encode(commitment(keys=OTHER_KEYS))))

    both._keys[0] = keys
    both.turn(0)
    assert both.heard[1:] == [orders(0)]


def test_a_match_that_is_gone_frees_its_seat(both: Joined) -> None:
    both = seated(n_matches=2)
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    closed, waiting, query = both.answer(Wait(reason="for an opponent"))
    assert (closed, waiting) == (events.CloseSeat(0), events.Waiting("for an opponent"))
    assert isinstance(query, events.Query)
    assert isinstance(both.answer(ticket(NEXT))[0], events.MatchBegun)

    assert both.requests[-1].match == ""


def test_a_match_that_is_gone_is_none_of_those_that_were_wanted() -> None:
    both = seated(n_matches=1)
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    both.answer(Wait(reason="for another match, since that one is over"))

    assert not both.core.is_done
    both.answer(ticket(NEXT))
    both.deliver(sign_statement(PIT, replace(ENDED, match=NEXT)))
    assert (both.core.is_done, both.core.n_ended) == (True, 1)


def test_a_match_that_is_gone_ends_for_its_policy(monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[MatchResult] = []
    monkeypatch.setattr(Counter, "end", lambda _, seat, result: ended.append(result))
    both = seated()
    both.turn(0)
    both.feed(events.TimePassed())
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    both.answer(Wait(reason="for another match, since that one is over"))

    assert [(result.ending, result.ticks) for result in ended] == [(Termination.VOID, 1)]


def test_another_match_than_the_one_that_was_asked_for_makes_another_seat() -> None:
    both = seated(n_matches=2)
    both.turn(0)
    both.feed(events.TimePassed())
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    closed, begun, opened, _ = both.answer(ticket(NEXT))

    assert (closed, opened) == (events.CloseSeat(0), events.OpenSeat(0, LANES[NEXT], Team.RED))
    assert isinstance(begun, events.MatchBegun)
    assert both.heard[-1] == Ready(known_ticks=0)


def test_a_pit_that_is_away_is_looked_for_as_long_as_patience_lasts(both: Joined) -> None:
    both.feed(events.Disconnected(LOST), 100.0)  # it was there until now

    assert both.feed(events.Disconnected(LOST), 10.0) == [events.Waiting("for the pit to come back")]
    both.connect()  # a router without a pit: this is no answer
    both.reply(b"")
    with pytest.raises(LostPitError):
        both.feed(events.Disconnected(LOST), 0.1)


def test_every_connection_has_its_own_count_of_unanswered_questions(both: Joined) -> None:
    for _ in range(2):
        assert both.feed(events.Disconnected(LOST)) == [events.Waiting("for the pit to come back")]
        assert len(both.connect()) == 1
        for _ in range(MOST_UNANSWERED - 1):
            both.reply(b"")
            assert both.feed(events.TimePassed(), 0.0) != [events.Reconnect()]
        both.reply(b"")
        assert both.feed(events.TimePassed(), 0.0) == [events.Reconnect()]


def test_patience_begins_anew_with_every_answer(both: Joined) -> None:
    for _ in range(3):
        both.feed(events.Disconnected(LOST), 8.0)
        assert both.feed(events.Disconnected(LOST), 8.0) == [events.Waiting("for the pit to come back")]
        both.connect()
        both.answer(ticket())


def test_a_pit_that_is_not_open_yet_is_looked_for_as_long_as_patience_lasts() -> None:
    both = Joined(endpoint="tcp/home:7447")

    assert both.feed(events.Disconnected(LOST)) == [events.Waiting("for the pit at tcp/home:7447")]
    assert both.feed(events.Disconnected(LOST), 9.9) == [], "it was said once"
    with pytest.raises(LostPitError):
        both.feed(events.Disconnected(LOST), 0.1)


def test_a_pit_that_opens_while_it_is_looked_for_is_played_in() -> None:
    both = Joined()
    both.feed(events.Disconnected(LOST))
    both.feed(events.Disconnected(LOST), 9.0)

    both.connect()

    assert isinstance(both.answer(ticket())[0], events.MatchBegun)


def test_without_patience_a_pit_that_is_not_open_is_given_up_at_once() -> None:
    both = Joined(patience_s=0.0)

    with pytest.raises(LostPitError):
        both.feed(events.Disconnected(LOST))


def test_a_pit_that_closed_before_it_could_be_asked_is_looked_for() -> None:
    both = Joined()
    both.feed(events.Connected())
    assert both.feed(events.Disconnected(LOST), 1.0) == [events.Waiting("for the pit to come back")]
    assert both.feed(events.Disconnected(LOST), 9.0) == [events.Waiting("for the pit to come back")]

    with pytest.raises(LostPitError):
        both.feed(events.Disconnected(LOST), 0.1)


# Endings


def test_an_ending_that_the_pit_signed_is_believed_and_receipted(both: Joined) -> None:
    for tick in range(2):
        both.turn(tick)

    receipt, ended, closed = both.deliver(sign_statement(PIT, ENDED))

    head = Head()
    for tick in range(2):
        head.add(observation(tick))
    assert isinstance(receipt, events.Publish)
    given = both.heard[-1]
    assert isinstance(given, Receipt)
    assert (given.n_shown, given.head) == (2, head.digest)
    check_receipt(ANN.public, MATCH, Team.RED, given)
    assert isinstance(ended, events.MatchEnded)
    assert ended.seat.ended == ENDED
    assert closed == events.CloseSeat(0)
    assert (both.core.is_done, both.core.n_ended) == (True, 1)


@pytest.mark.parametrize(
    "ending",
    [
        ENDED,
        sign_statement(MAN, ENDED),
        sign_statement(ANN, ENDED),
        replace(sign_statement(PIT, ENDED), signature=bytes(64)),
        replace(sign_statement(PIT, ENDED), data=encode(replace(ENDED, winner="red"))),
        sign_statement(PIT, replace(ENDED, match=NEXT)),
        commitment(),
        sign_statement(PIT, replace(ENDED, ending="rapture")),
        Signed(data=b"junk", signature=PIT.sign("fact", b"junk")),
        Signed(data=encode(ENDED), signature=PIT.sign("journal", encode(ENDED))),
    ],
)
def test_an_ending_that_is_not_the_pits_or_of_another_match_is_not_believed(both: Joined, ending: Message) -> None:
    """Though it was sealed as the pit seals: what ends a match is to be shown to others."""
    assert both.deliver(ending) == []

    both.turn(0)
    assert both.heard[1:] == [orders(0)]


@pytest.mark.parametrize("is_open", [False, True])
def test_a_match_that_ended_while_the_client_was_away_ends_by_the_answer_to_its_question(is_open: bool) -> None:
    both = seated()
    if is_open:
        both.feed(events.TimePassed(), SILENCE_S + 0.1)
    else:
        both.feed(events.Disconnected(LOST))
        both.connect()

    effects = both.answer(sign_statement(PIT, ENDED))

    expected = [events.Publish, events.MatchEnded, events.CloseSeat] if is_open else [events.MatchEnded]
    assert [type(effect) for effect in effects] == expected
    assert both.core.is_done


def test_a_late_ending_that_is_not_the_pits_is_refused(both: Joined) -> None:
    both.feed(events.TimePassed(), SILENCE_S + 0.1)

    with pytest.raises(RefusedError, match="the pit cannot be understood"):
        both.answer(sign_statement(MAN, ENDED))


def test_the_answer_to_a_question_that_the_ending_overtook_is_of_no_use() -> None:
    for late in (ticket(), sign_statement(PIT, ENDED)):
        both = seated(n_matches=2)
        both.feed(events.TimePassed(), SILENCE_S + 0.1)
        both.deliver(sign_statement(PIT, ENDED))

        (query,) = both.answer(late)

        assert isinstance(query, events.Query)
        assert both.core.n_ended == 1


def test_a_slot_that_is_done_is_done_once() -> None:
    both = Joined(n_slots=2, n_matches=2)
    both.connect()
    both.answer(ticket())
    both.answer(ticket(NEXT))
    both.feed(events.TimePassed(), SILENCE_S + 0.1)
    both.deliver(sign_statement(PIT, ENDED))

    both.answer(Closed(reason="all is played"))

    assert not both.core.is_done, "the other slot still plays"


def test_matches_follow_each_other_until_all_are_played() -> None:
    both = seated(n_matches=2)

    *_, query = both.deliver(sign_statement(PIT, ENDED))
    assert isinstance(query, events.Query)
    both.answer(ticket(NEXT))
    both.deliver(sign_statement(PIT, replace(ENDED, match=NEXT)))

    assert (both.core.is_done, both.core.n_ended) == (True, 2)
    assert both.queries == []


def test_several_slots_play_side_by_side_each_under_its_own_keys() -> None:
    both = Joined(n_slots=3, n_matches=3)
    assert len(both.connect()) == 3
    for number in range(3):
        both.answer(ticket(f"{number:016}"))
    payload = both.seal(Turn(tick=0, observation=observation(0)), 1)
    assert both.feed(events.MessageReceived(2, payload)) == []

    (effect,) = both.feed(events.MessageReceived(1, payload))
    assert isinstance(effect, events.Publish)
    assert effect.slot == 1
    for number in range(3):
        assert not both.core.is_done
        both.deliver(sign_statement(PIT, replace(ENDED, match=f"{number:016}")), number)

    assert [request.slot for request in both.requests] == [0, 1, 2]
    assert both.core.is_done


def test_a_slot_without_a_match_left_is_done_although_another_plays() -> None:
    both = Joined(n_slots=2)
    assert len(both.connect()) == 1
    both.answer(ticket())

    assert both.queries == []
    assert not both.core.is_done
    both.deliver(sign_statement(PIT, ENDED), 1)
    assert both.core.is_done


def test_no_more_seats_are_asked_for_than_the_policy_could_take_at_once() -> None:
    ready = 1
    joined = Joined(n_slots=3, n_matches=None, count_ready=lambda: ready)
    joined.connect()
    asked = [len(joined.queries)]
    joined.answer(ticket())

    ready = 0
    joined.feed(events.TimePassed())
    asked.append(len(joined.queries))
    ready = 5
    joined.feed(events.TimePassed())
    asked.append(len(joined.queries))

    assert asked == [1, 0, 2]


def test_slots_that_are_free_at_once_ask_for_no_more_matches_than_are_left() -> None:
    both = Joined(n_slots=2, n_matches=3)
    both.connect()
    for number in range(2):
        both.answer(ticket(f"{number:016}"))

    for number in range(2):
        both.deliver(sign_statement(PIT, replace(ENDED, match=f"{number:016}")), number)

    assert len(both.queries) == 1
    both.answer(ticket(NEXT))
    both.deliver(sign_statement(PIT, replace(ENDED, match=NEXT)))
    assert (both.core.is_done, both.core.n_ended) == (True, 3)


# Audits


def audited() -> Joined:
    """Return a client whose match has ended, and which has asked for its journal."""
    both = seated(on_audit=lambda seat, verdict: None)
    both.deliver(sign_statement(PIT, ENDED))
    (query,) = both.queries
    assert query.key == topics.journal("pit", MATCH)
    assert not both.core.is_done
    return both


def verdict(effects: list[events.Effect]) -> Verdict:
    (effect,) = effects
    assert isinstance(effect, events.Audited)
    assert effect.seat.ticket.match == MATCH
    return effect.verdict


def test_the_journal_is_fetched_piece_by_piece_and_checked() -> None:
    both = audited()
    (query,) = both.reply(encode(JournalPiece(n_bytes=8, offset=0, data=b"junk")))
    assert isinstance(query, events.Query)
    assert decode(query.payload) == JournalRequest(offset=4)

    assert verdict(both.reply(encode(JournalPiece(n_bytes=8, offset=4, data=b"junk"))))[0] is False
    assert both.core.is_done


@pytest.mark.parametrize("payload", [b"", b"junk", encode(Wait(reason="yet")), encode(ChallengeRequest())])
def test_a_journal_that_cannot_be_had_is_no_verdict(payload: bytes) -> None:
    both = audited()

    assert verdict(both.reply(payload))[0] is None
    assert both.core.is_done


def test_an_audit_that_the_end_of_a_connection_cut_off_does_not_keep_a_client() -> None:
    both = audited()
    (query,) = both.queries

    assert both.feed(events.Disconnected(LOST)) == []
    assert both.core.is_done
    assert both.feed(events.ReplyReceived(query.id, b"")) == []
