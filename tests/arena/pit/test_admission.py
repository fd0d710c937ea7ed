"""Who is answered, rationed, refused, queued and seated, by a core without a network."""

from dataclasses import replace
from typing import Any

import pytest
from offline_pit import PIT, OfflinePit, Player, begin, play

from arena.errors import ForgedError
from arena.game.types import RULES_VERSION, Team
from arena.pit import admission
from arena.pit.admission import FORGET_WAITING_S, HOLD_QUESTION_S
from arena.pit.events import JoinAsked, PresenceChanged, RequestTurn
from arena.pit.match_sessions import PATIENCE_S
from arena.pit.rationed_queue import MOST_REQUESTS
from arena.pit.register import Register
from arena.protocol import handshake
from arena.protocol.codec import encode
from arena.protocol.handshake import new_secret
from arena.protocol.messages import (
    AdminRequest,
    ChallengeRequest,
    Closed,
    Ended,
    JoinRequest,
    Ready,
    Refusal,
    SealedRequest,
    SeasonRequest,
    Ticket,
    Wait,
)
from arena.protocol.signed import read_statement

LOW_ORDER = bytes(32)
"""A point with which every exchange ends at zero (RFC 7748, section 6.1)."""
JUNK = encode(SealedRequest(sealed=bytes(100)))


@pytest.fixture
def pit() -> OfflinePit:
    return OfflinePit()


def refusal(answer: Any) -> str:
    assert isinstance(answer, Refusal), answer
    return answer.reason


# Requests


def test_a_challenge_is_answered_at_once_and_to_everyone_alike(pit: OfflinePit) -> None:
    assert pit.challenge() == pit.challenge()


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
def test_what_is_not_sealed_is_refused_at_once(pit: OfflinePit, payload: bytes, why: str) -> None:
    assert refusal(pit.reply(pit.ask_to_join(payload))).startswith(why)
    assert not pit.core.may_open_request


def test_a_request_that_does_not_open_or_comes_twice_is_refused_and_counted(pit: OfflinePit) -> None:
    ann = Player(pit, "ann").send_request()
    refused = [pit.ask_to_join(encode(SealedRequest(sealed=b"junk" * 50))), pit.ask_to_join(ann.attempt.sealed)]
    pit.pass_time()

    assert pit.core.n_refused == 2
    for question, why in zip(refused, ("a request does not open", "a request comes a second time"), strict=True):
        assert refusal(pit.reply(question)).startswith(why)
    assert pit.lobby().waiting == ["ann"]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"rules_version": RULES_VERSION + 1}, "the client knows version"),
        ({"rules_hash": "0" * 64}, "the pit plays ruleset"),
        ({"team": "green"}, "there is no team"),
        ({"slot": -1}, "there is no slot"),
        ({"name": "a/b"}, "a name is 1 to 64"),
        ({"name": "ann.2"}, "a name is 1 to 64"),
        ({"name": "owned"}, "the name owned belongs to another key"),
    ],
)
def test_an_entry_that_cannot_play_here_is_refused_with_the_reason(pit: OfflinePit, changes: dict[str, Any], why: str) -> None:
    assert refusal(Player(pit, "ann").ask(**changes)).startswith(why)
    assert pit.lobby().waiting == []


def test_a_request_to_a_season_gets_no_seat_in_a_pit(pit: OfflinePit) -> None:
    ann = Player(pit, "ann").send_request(SeasonRequest(command="status", name="ann"))
    pit.pass_time()

    assert refusal(ann.answer()) == "this is no request for a seat"
    assert pit.lobby().waiting == []


def test_an_invite_is_saved_before_its_bearer_is_answered() -> None:
    pit = OfflinePit(register=Register(invites=["code"]))

    assert refusal(Player(pit, "eve").ask()) == "this pit wants an invite code; join with --invite CODE"
    assert pit.n_saved == 0
    assert Player(pit, "ann").ask(invite="code") is None
    assert pit.n_saved == 1
    assert refusal(Player(pit, "bob").ask(invite="code")) == "the invite code was used by another key"


# The ration of time


def test_while_matches_run_requests_have_their_share_of_the_time_and_the_rest_waits(pit: OfflinePit) -> None:
    begin(pit)
    pit.opening_s = lambda: 0.0037
    questions = [pit.ask_to_join(JUNK) for _ in range(MOST_REQUESTS)]
    begun_s = pit.now_s

    for _ in range(50):
        pit.pass_time()

    spent_s = sum(question in pit.replies for question in questions) * 0.0037
    assert spent_s == pytest.approx(0.3 * (pit.now_s - begun_s), abs=0.02)


def test_time_in_which_nothing_was_opened_is_taken_off_nobody_s_share(pit: OfflinePit) -> None:
    begin(pit)
    questions = [pit.ask_to_join(JUNK) for _ in range(7)]

    pit.pass_time(0.05)

    assert all(question in pit.replies for question in questions)


def test_without_a_match_to_slow_down_all_requests_are_opened(pit: OfflinePit) -> None:
    pit.opening_s = lambda: 1.0
    questions = [pit.ask_to_join(JUNK) for _ in range(20)]

    pit.pass_time()

    assert all(question in pit.replies for question in questions)


def test_a_request_that_took_very_long_is_forgiven_beyond_some_sweeps(pit: OfflinePit) -> None:
    begin(pit)
    costs = iter((5.0, 0.0))
    pit.opening_s = lambda: next(costs)
    first, second = (pit.ask_to_join(JUNK) for _ in range(2))
    pit.pass_time()
    pit.now_s -= 5.0  # as if that time had not passed, or it would be a saving

    assert (first in pit.replies, second in pit.replies) == (True, False)
    for _ in range(10):
        pit.pass_time()
    assert second in pit.replies


def test_each_turn_opens_one_request_so_that_orders_are_handed_in_between(pit: OfflinePit) -> None:
    questions = [pit.ask_to_join(JUNK) for _ in range(3)]

    for n_opened in range(3):
        assert pit.core.may_open_request
        assert [question in pit.replies for question in questions] == [True] * n_opened + [False] * (3 - n_opened)
        pit.do(RequestTurn())

    assert not pit.core.may_open_request


def test_requests_beyond_the_bound_are_dropped_and_those_before_are_opened(pit: OfflinePit) -> None:
    questions = [pit.ask_to_join(JUNK) for _ in range(MOST_REQUESTS + 2)]

    assert [question for question in questions if question in pit.replies] == questions[MOST_REQUESTS:]
    assert [pit.replies[question] for question in questions[MOST_REQUESTS:]] == [None, None]
    assert pit.reply(pit.ask_to_join(encode(ChallengeRequest())))
    pit.pass_time()
    assert all(pit.replies[question] for question in questions[:MOST_REQUESTS])
    assert pit.ask_to_join(JUNK) not in pit.replies


# The queue


def test_two_that_came_get_a_match_of_their_own(pit: OfflinePit) -> None:
    ann, bob = begin(pit)

    assert ann.ticket.match == bob.ticket.match
    assert (ann.team, ann.ticket.opponent, bob.team, bob.ticket.opponent) == (Team.BLUE, "bob", Team.RED, "ann")
    assert pit.lobby().waiting == []


def test_a_client_is_answered_with_wait_after_some_seconds(pit: OfflinePit) -> None:
    ann = Player(pit, "ann")
    assert ann.ask() is None

    pit.pass_time(HOLD_QUESTION_S - 0.02)
    assert ann.answer() is None
    pit.pass_time(0.03)

    assert ann.answer() == Wait(reason="for an opponent")
    assert pit.lobby().waiting == ["ann"]


def test_a_client_whose_match_began_while_it_did_not_ask_is_seated_when_it_does(pit: OfflinePit) -> None:
    ann, bob = Player(pit, "ann"), Player(pit, "bob")
    ann.ask()
    pit.pass_time(HOLD_QUESTION_S)
    assert isinstance(ann.answer(), Wait)

    bob.join()
    ann.join()

    assert (ann.ticket.match, ann.team) == (bob.ticket.match, Team.BLUE)
    assert pit.n_begun == 1


def test_a_client_that_asks_again_before_it_was_answered_waits_once(pit: OfflinePit) -> None:
    ann = Player(pit, "ann")
    ann.ask()
    question, attempt = ann.question, ann.attempt

    assert ann.ask() is None
    assert attempt.open(pit.replies[question] or b"") == Wait(reason="for an opponent")
    assert pit.lobby().waiting == ["ann"]


def test_a_client_that_does_not_ask_again_is_forgotten_and_frees_its_team(pit: OfflinePit) -> None:
    Player(pit, "ann").ask(team="red")
    assert isinstance(Player(pit, "bob").ask(team="red"), Refusal)

    pit.pass_time(HOLD_QUESTION_S)
    pit.pass_time(FORGET_WAITING_S - HOLD_QUESTION_S)

    assert pit.lobby().waiting == []
    assert Player(pit, "bob").ask(team="red") is None


def test_a_process_that_is_gone_does_not_wait_any_more(pit: OfflinePit) -> None:
    ann, eve = Player(pit, "ann"), Player(pit, "eve")
    ann.ask(team="red")
    eve.vanish()
    assert pit.lobby().waiting == ["ann"]

    ann.vanish()

    pit.pass_time(1.0)
    assert pit.lobby().waiting == []
    assert eve.ask(team="red") is None


def test_clients_beyond_the_bound_are_refused_and_those_who_wait_are_not(
    pit: OfflinePit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(admission, "MOST_QUEUED", 1)
    ann, bob = Player(pit, "ann"), Player(pit, "bob")
    ann.ask()

    assert bob.ask() == Refusal(reason="1 clients wait already; come again later")
    assert ann.ask() is None
    assert pit.lobby().waiting == ["ann"]


def test_beyond_the_most_matches_clients_wait_until_one_is_over(pit: OfflinePit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(admission, "MOST_RUNNING", 1)
    playing = begin(pit)
    eve, dan = Player(pit, "eve"), Player(pit, "dan")

    assert (eve.ask(), dan.ask(), pit.n_begun) == (None, None, 1)
    play(*playing)
    assert eve.ask() is None
    assert isinstance(dan.ask(), Ticket)


def test_a_pit_that_is_full_says_so() -> None:
    pit = OfflinePit(most_matches=1)
    begin(pit)
    eve = Player(pit, "eve")
    assert eve.ask() is None

    pit.pass_time(HOLD_QUESTION_S)

    assert eve.answer() == Wait(reason="for room: the pit plays 1 matches, and takes no more at once")


def test_a_full_pit_voids_the_match_whose_seats_are_not_ready_in_time(pit: OfflinePit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(admission, "MOST_RUNNING", 2)
    playing = begin(pit)
    for player in playing:
        player.ready()
    idle, _ = begin(pit, "eve", "dan")
    fay, gus = Player(pit, "fay"), Player(pit, "gus")
    pit.pass_time(PATIENCE_S / 2)
    assert (fay.ask(), gus.ask()) == (None, None)
    pit.pass_time(PATIENCE_S / 2)

    assert fay.ask() is None
    assert isinstance(gus.ask(), Ticket)
    [ended] = pit.ended
    assert ended.result.reason == "was not ready while others waited for room"
    assert [message.ending for message in idle.read() if isinstance(message, Ended)] == ["void"]
    assert playing[0].ticket.match in pit.files


def test_nobody_begins_a_match_in_a_pit_that_closes(pit: OfflinePit) -> None:
    ann = Player(pit, "ann")
    ann.ask()
    pit.seating.close()

    assert Player(pit, "bob").ask() == Closed(reason="the pit begins no more matches")
    pit.pass_time()
    assert ann.answer() == Closed(reason="the pit begins no more matches")
    assert pit.lobby().waiting == []


# Seats


def test_a_process_that_asks_again_gets_its_seat_under_new_keys(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    before, old_sealer, old_opener = ann.ticket, ann.sealer, ann.opener
    ann.join(match=before.match)

    assert (ann.ticket.match, ann.ticket.team, ann.ticket.commitment) == (before.match, before.team, before.commitment)
    assert ann.ticket.secret != before.secret
    bob.ready()
    ann.put(old_sealer.close(encode(Ready(known_ticks=0)), 0))
    assert ann.read() == [], "orders under the old keys do not open"
    ann.ready()
    [turn] = pit.sent[ann.place]
    with pytest.raises(ForgedError):
        old_opener.open(turn)
    assert len(ann.read()) == 1


def test_a_seat_that_is_held_is_not_given_to_another_process_of_its_entry(pit: OfflinePit) -> None:
    ann, _ = begin(pit)

    assert Player(pit, "ann", ann.identity, client="other").ask() is None
    assert isinstance(ann.ask(), Ticket)


def test_a_seat_that_its_process_left_goes_to_the_entry_s_new_process(pit: OfflinePit) -> None:
    ann, _ = begin(pit)
    ann.vanish()

    again = Player(pit, "ann", ann.identity, client="new").join()

    assert again.place == ann.place
    assert ann.ask() is None, "the seat is taken"


@pytest.mark.parametrize("changes", [{}, {"match": "theirs"}, {"team": "blue"}])
def test_a_seat_that_its_process_left_goes_to_nobody_else_of_that_name(pit: OfflinePit, changes: dict[str, str]) -> None:
    ann, _ = begin(pit)
    ann.vanish()
    if "match" in changes:
        changes = {"match": ann.ticket.match}

    assert not isinstance(Player(pit, "ann", client=ann.client).ask(**changes), Ticket)
    assert ann.join().ticket.match == ann.ticket.match


@pytest.mark.parametrize("changes", [{"team": "red"}, {"name": "other"}])
def test_a_seat_that_its_process_left_is_not_given_to_an_entry_that_wants_another(
    pit: OfflinePit, changes: dict[str, str]
) -> None:
    ann, _ = begin(pit)
    ann.vanish()

    assert Player(pit, "ann", ann.identity, client="new").ask(**changes) is None


def test_of_two_seats_that_an_entry_left_each_slot_gets_its_own_first(pit: OfflinePit) -> None:
    ann = Player(pit, "ann")
    places = {}
    for slot, opponent in ((1, "bob"), (2, "dan")):
        assert ann.ask(slot=slot) is None
        Player(pit, opponent).join()
        places[slot] = ann.take().place
    ann.vanish()

    assert {slot: ann.join(slot=slot).place for slot in (2, 1)} == places


def test_a_client_that_asks_for_a_match_that_is_over_gets_its_ending_and_does_not_wait(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob)

    ending = ann.ask(match=ann.ticket.match)
    assert isinstance(read_statement(ending, PIT.public), Ended)  # type: ignore[arg-type]
    assert ann.ask(match="long ago") == Wait(reason="for another match, since that one is over")
    assert pit.lobby().waiting == []


def test_who_vanishes_before_its_request_is_opened_takes_no_seat_from_the_next_of_its_entry(pit: OfflinePit) -> None:
    ann = Player(pit, "ann").send_request()
    ann.vanish()
    pit.pass_time()
    assert ann.answer() is None
    assert pit.lobby().waiting == []

    bob, again = Player(pit, "bob"), Player(pit, "ann", ann.identity, client="another")
    assert bob.ask() is None
    assert isinstance(again.ask(), Ticket)
    assert isinstance(ann.ask(), Wait | None), "who is back may ask, too"


def test_presence_of_a_process_keeps_the_pit_from_being_deserted(pit: OfflinePit) -> None:
    assert pit.core.is_deserted
    pit.do(PresenceChanged("c", True))
    assert not pit.core.is_deserted
    pit.do(PresenceChanged("c", False))
    assert pit.core.is_deserted


# Keys that nothing can be sealed to


def ask_from_nowhere(pit: OfflinePit, **changes: Any) -> int:
    """Ask for a seat, with a key of low order to answer to."""
    eve, challenge = Player(pit, "eve"), pit.challenge()
    request = replace(
        eve.join_request(**changes),
        entry=eve.identity.public,
        ephemeral=LOW_ORDER,
        reply_secret=new_secret(),
        challenge=challenge.number,
        pit_key=PIT.public,
    )
    signed = encode(request)
    info = handshake._request_info("pit", PIT.public)
    sealed = handshake._seal(signed + eve.identity.sign("request", signed), challenge.sealing_key, info)
    question = pit.ask_to_join(encode(SealedRequest(sealed=sealed)))
    pit.pass_time()
    return question


@pytest.mark.parametrize("changes", [{}, {"team": "green"}, {"match": "over"}])
def test_a_key_of_low_order_brings_nothing_down_and_gets_no_answer(pit: OfflinePit, changes: dict[str, str]) -> None:
    question = ask_from_nowhere(pit, **changes)
    pit.pass_time(HOLD_QUESTION_S)
    pit.pass_time(FORGET_WAITING_S)

    assert pit.replies[question] is None
    assert pit.lobby().waiting == []
    begin(pit)


def test_an_opponent_of_a_key_of_low_order_gets_a_ticket_all_the_same(pit: OfflinePit) -> None:
    question = ask_from_nowhere(pit)

    assert Player(pit, "ann").join().ticket.opponent == "eve"
    assert pit.replies[question] is None


# Connections


def test_the_connections_of_those_who_were_accepted_are_known_and_of_nobody_else(pit: OfflinePit) -> None:
    def ask(player: Player, session: str, **changes: Any) -> None:
        player.attempt = handshake.Attempt(player.identity, "pit", pit.challenge(), player.join_request(**changes))
        player.question = pit.ask(lambda question: JoinAsked(question, player.attempt.sealed, session))
        pit.pass_time()

    ann, bob, eve = Player(pit, "ann"), Player(pit, "bob"), Player(pit, "owned")
    ask(ann, "a")
    assert pit.core.find_sessions(pit.now_s) == (set(), {"a"})
    ask(eve, "e")
    ask(eve, "b", name="eve", client=bob.client)
    ask(bob, "b2", name="bob")

    assert pit.core.find_sessions(pit.now_s) == ({"a", "b"}, {"a", "b", "b2"})
    pit.pass_time(FORGET_WAITING_S)
    assert pit.core.find_sessions(pit.now_s) == (set(), set())
