"""Whole matches between clients and the core of a pit, both ends here, without a network, a clock or a file."""

import tracemalloc
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from offline_pit import N_UNITS, PIT, RULES, OfflinePit, Player, begin, plan, play

from arena.errors import ArenaError
from arena.game.types import Team, Termination
from arena.match.time_control import TimeControl
from arena.pit.admission import HOLD_QUESTION_S
from arena.pit.effects import Append, MatchEnded, PublishEnding, PublishTick, Send
from arena.pit.events import (
    ActionReceived,
    JournalAsked,
    JournalsReady,
    LobbyAsked,
    PresenceChanged,
    Stopped,
    TimePassed,
    UnfinishedFound,
)
from arena.pit.match_session import MOST_REJECTED
from arena.pit.match_sessions import RECEIPTS_S
from arena.pit.seating import PlannedSeating
from arena.protocol.codec import encode
from arena.protocol.identity import Identity
from arena.protocol.messages import Done, Ended, History, JournalRequest, Lobby, Orders, Ready, Refusal, Ticket, Turn, Wait
from arena.protocol.signed import sign_receipt
from arena.records.journal import journal_name, read_journal, whole_part
from arena.records.replay import verify
from arena.records.verification import Standing, check_seals

FIRST = journal_name("pit/1")
NO_FAULTS = {"late": 0, "unreadable": 0, "stale": 0, "garbled": 0, "forged": 0, "vanished": 0}


@pytest.fixture
def pit() -> OfflinePit:
    return OfflinePit()


# A match


def test_a_match_is_played_to_its_ending_and_its_journal_holds(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    last = play(ann, bob)
    for player in (ann, bob):
        player.give_receipt()

    assert [(type(message), message.ending, message.ticks) for message in last] == [(Ended, "tick_limit", 6)] * 2  # type: ignore[union-attr]
    [ended] = pit.ended
    assert (ended.result.ending, ended.entries) == (
        Termination.TICK_LIMIT,
        {Team.BLUE: ann.identity.public, Team.RED: bob.identity.public},
    )
    journal = read_journal(pit.journals[FIRST])
    assert verify(journal) == RULES.tick_limit
    checked = check_seals(journal)
    assert checked is not None
    assert {checked.commitment, checked.signature, *checked.receipts.values()} == {Standing.HOLDS}
    assert (pit.files, pit.core.n_running) == ({}, 0)


def test_names_belong_to_those_who_finished_a_match_under_them(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    assert pit.n_saved == 0
    play(ann, bob)

    assert pit.n_saved == 1
    assert isinstance(Player(pit, "ann").ask(), Refusal)
    assert Player(pit, "ann", ann.identity).ask() is None


def test_a_tick_is_written_before_the_next_is_sent_and_the_ending_before_anybody_receives_it(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    for player in (ann, bob):
        player.ready()

    for tick in range(RULES.tick_limit):
        ann.read()
        ann.order()
        effects = bob.put(bob.sealer.close(encode(Orders(tick=tick, actions=bytes(N_UNITS))), tick))
        kinds = [type(effect) for effect in effects]
        if tick < RULES.tick_limit - 1:
            assert kinds == [Append, Send, Send, PublishTick]
        else:
            assert [kind for kind in kinds if kind is not MatchEnded][-5:] == [Append, Append, Send, Send, PublishEnding]


def test_a_spectator_is_sent_each_tick_and_the_truth_only_under_a_key(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob)
    with_key = OfflinePit(spectator_key=bytes(32))
    eve, dan = begin(with_key)
    play(eve, dan)

    assert len(pit.public[ann.ticket.match]) == len(with_key.truths[eve.ticket.match]) + 1 == RULES.tick_limit + 1
    assert pit.truths == {}


def test_deadlines_are_judged_by_when_orders_came_and_not_by_when_they_were_read() -> None:
    pit = OfflinePit(time_control=TimeControl(turn_time_s=1.0, bank_s=0.0))
    for player in (players := begin(pit)):
        player.ready()
    begun_s = pit.now_s
    pit.now_s += 5.0

    pit.do(TimePassed(begun_s + 0.9))
    assert pit.core.matches[0].tick == 0
    pit.do(TimePassed(begun_s + 1.1))
    assert pit.core.matches[0].tick == 1
    assert [pit.core.matches[0].record(player.team).late for player in players] == [1, 1]


# What a fault means


def faults(pit: OfflinePit, player: Player) -> dict[str, int]:
    """Return what was counted of a player of the match that runs."""
    return pit.core.matches[0].record(player.team).faults()


def test_a_router_that_doubles_and_reorders_what_a_seat_sends_is_no_fault_of_anybody(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    ready = [ann.sealer.close(encode(Ready(known_ticks=0)), 0) for _ in range(2)]
    bob.ready()
    for payload in (ready[1], ready[0], ready[1]):
        ann.put(payload)
    orders = [ann.sealer.close(encode(Orders(tick=tick, actions=bytes([1] * N_UNITS))), tick) for tick in range(2)]
    for payload in (orders[0], orders[0]):
        ann.put(payload)
    bob.read()
    bob.order()
    for payload in (orders[0], orders[1], orders[0], orders[1]):
        ann.put(payload)

    assert (pit.core.matches[0].tick, faults(pit, ann)) == (1, NO_FAULTS)


def test_a_copy_of_the_request_for_history_is_no_fault(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=2)
    ready = ann.sealer.close(encode(Ready(known_ticks=0)), 0)

    n_sent = [len(ann.put(ready)) for _ in range(3)]

    assert n_sent == [1, 0, 0]
    assert faults(pit, ann) == NO_FAULTS


def test_what_was_sealed_under_the_keys_of_the_tickets_before_counts_for_nothing(pit: OfflinePit) -> None:
    """A client that hears nothing asks whether its match still runs: its orders may cross the ticket that answers."""
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=1)
    crossing = []
    for _ in range(2):
        crossing.append(ann.sealer.close(encode(Orders(tick=1, actions=bytes(N_UNITS))), 1))
        ann.join(match=ann.ticket.match)
    for payload in crossing:
        assert ann.put(payload) == []
    ann.ready()
    ann.read()
    ann.order()
    bob.order()

    assert (pit.core.matches[0].tick, faults(pit, ann)) == (2, NO_FAULTS)


def test_what_a_seat_sends_to_a_pit_that_has_just_resumed_its_match_is_no_fault(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=1)
    later = pit.successor()
    later.do(find(pit, FIRST))

    later.do(ActionReceived(ann.ticket.lane, ann.team, ann.sealer.close(encode(Orders(tick=1, actions=bytes(N_UNITS))), 1)))

    assert faults(later, ann) == NO_FAULTS


def provoke(kind: str, pit: OfflinePit, ann: Player, bob: Player) -> None:
    """Have red, whose turn it is, commit one fault."""
    if kind == "late":
        pit.pass_time(TimeControl().turn_time_s + TimeControl().bank_s)  # type: ignore[operator]  # there is a clock
        bob.order()  # now it comes
    elif kind == "unreadable":
        bob.order(b"\x01")
    elif kind == "stale":
        bob.order(b"\x01" * N_UNITS).order(b"\x02" * N_UNITS)
    elif kind == "garbled":
        bob.put(bob.sealer.close(b"\xc1", 0))
    elif kind == "forged":
        bob.put(ann.sealer.close(encode(Orders(tick=0, actions=bytes(N_UNITS))), 0))
    elif kind == "vanished":
        bob.vanish()
        bob.join(match=bob.ticket.match).ready()


@pytest.mark.parametrize("kind", ["late", "unreadable", "stale", "garbled", "forged", "vanished"])
def test_each_fault_is_provoked_and_only_it(pit: OfflinePit, kind: str) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=0)
    ann.order()

    provoke(kind, pit, ann, bob)
    if pit.core.matches[0].tick == 0:
        bob.order()

    assert pit.core.matches[0].tick == 1
    assert (faults(pit, ann), faults(pit, bob)) == (NO_FAULTS, NO_FAULTS | {kind: 1})


def test_orders_are_charged_until_they_came_and_not_until_they_were_taken_up(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=1)
    asked_s = pit.now_s
    pit.now_s += 7.0  # of which the pit did something else for 6.75 s
    for player, took_s in ((ann, 0.25), (bob, -0.5)):
        orders = player.sealer.close(encode(Orders(tick=1, actions=bytes(N_UNITS))), 1)
        pit.do(ActionReceived(player.ticket.lane, player.team, orders, asked_s + took_s))

    turns = [message for player in (ann, bob) for message in player.read()]

    assert [(turn.tick, turn.charged_us) for turn in turns if isinstance(turn, Turn)] == [(2, 250_000), (2, 0)]


def test_each_turn_says_what_the_one_before_was_charged(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=0)
    n_bytes = set()
    told = []
    for took_s in (0.5, 0.0, 1.25, None):
        bob.order()
        if took_s is None:
            pit.pass_time(TimeControl().turn_time_s + TimeControl().bank_s)  # type: ignore[operator]  # there is a clock
        else:
            pit.now_s += took_s
            ann.order()
        told += [turn.charged_us for turn in ann.read() if isinstance(turn, Turn)]
        bob.read()
        n_bytes |= {len(data) for data in pit.sent[ann.place]}

    assert told == [500_000, 0, 1_250_000, 1_000_000 + 9_750_000], "of a turn that was missed all, and the bank"
    assert len(n_bytes) == 1


# Who comes back, and who does not


def test_a_history_is_sent_once_a_ticket_and_asking_for_more_is_stale(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=3)
    n_effects = [len(ann.put(ann.sealer.close(encode(Ready(known_ticks=0)), 0))) for _ in range(5)]

    assert n_effects == [1, 0, 0, 0, 0]
    assert faults(pit, ann) == NO_FAULTS | {"stale": 4}
    ann.join(match=ann.ticket.match).send(Ready(known_ticks=0))
    assert [type(message) for message in ann.read()] == [History]


def test_who_sees_its_history_again_is_asked_when_it_is_ready(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=5)
    ann.vanish()
    again = Player(pit, "ann", ann.identity, client="new").join().ready()
    bob.order()

    pit.pass_time(4.9)  # of 5 turns of a second
    assert pit.core.matches[0].tick == 5
    again.read()
    pit.pass_time(TimeControl().bank_s)

    assert pit.core.matches[0].tick == 5
    assert pit.core.matches[0].record(Team.BLUE).late == 0


def test_a_process_that_comes_back_gets_its_history_and_the_match_goes_on(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=3)
    ann.vanish()
    again = Player(pit, "ann", ann.identity, client="new").join()

    again.ready()
    assert [type(message) for message in again.read()] == [History]
    assert [type(message) for message in again.read()] == [Turn]
    assert again.shown == ann.shown
    again.order()
    bob.order()
    assert [type(player.read()[-1]) for player in (again, bob)] == [Turn, Turn]
    assert pit.core.matches[0].record(Team.BLUE).vanished == 1


def test_a_history_comes_before_its_turn_under_the_same_keys(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=2)
    ann.send(Ready(known_ticks=1))

    assert [type(message) for player in (ann, ann) for message in player.read()] == [History, Turn]


def test_a_process_that_lost_its_keys_alone_gets_the_turn_again_under_new_ones(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=2)
    n_sent = len(pit.sent[ann.place])

    ann.join(match=ann.ticket.match).ready()

    assert [type(message) for message in ann.read()] == [Turn]
    assert len(pit.sent[ann.place]) == n_sent + 1


def test_a_restarted_client_waits_until_its_former_process_is_known_to_be_gone(pit: OfflinePit) -> None:
    ann, _ = begin(pit)
    again = Player(pit, "ann", ann.identity, client="new")
    assert again.ask() is None

    ann.vanish()

    assert again.join().place == ann.place
    pit.pass_time(0.5)
    assert pit.lobby().waiting == []


def test_a_turn_that_is_asked_for_again_comes_in_the_same_bytes(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=0)
    ann.ready()

    first, second = pit.sent[ann.place]
    assert first == second


def test_a_seat_that_stays_away_forfeits(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=2)
    ann.vanish()
    pit.pass_time(TimeControl().grace_s)

    [ended] = bob.read()
    assert isinstance(ended, Ended)
    assert (ended.winner, ended.reason) == ("red", "blue did not come back in time")


def test_a_slot_that_left_a_seat_and_plays_elsewhere_keeps_nobody_from_it(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    ann.vanish()
    Player(pit, "eve").ask()
    ann.join(name="other")
    assert ann.ticket.match != bob.ticket.match

    assert Player(pit, "ann", ann.identity, client="new").join().ticket.match == bob.ticket.match


def test_a_slot_that_left_a_seat_for_another_holds_that_one_when_the_first_match_ends(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    ann.vanish()
    Player(pit, "eve").ask()
    ann.join(name="other").ready()
    Player(pit, "operator", PIT).command("abort", bob.ticket.match)
    [match] = pit.core.matches
    assert not match.is_away(ann.team)

    ann.vanish()

    assert match.is_away(ann.team)


# Junk


def test_what_the_holder_of_a_seat_did_not_seal_uses_up_nothing_of_its_turn(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    for player in (ann, bob):
        player.ready()
    bob.read()
    ready = ann.sealer.close(encode(Ready(known_ticks=0)), 0)
    assert [type(message) for message in ann.read()] == [Turn]

    for junk in (b"", b"junk" * 30, bob.sealer.close(encode(Orders(tick=0, actions=bytes(N_UNITS))), 0), ready[:-1]):
        assert ann.put(junk) == []
    ann.order()
    match = pit.core.matches[0]
    assert (match.record(Team.BLUE).forged, match.tick) == (4, 0)
    bob.order()

    assert match.tick == 1


def test_orders_that_are_replayed_or_of_another_tick_change_nothing(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=0)
    orders = ann.sealer.close(encode(Orders(tick=0, actions=bytes(N_UNITS))), 0)
    ann.put(orders)
    ann.put(orders)
    bob.order()
    ann.put(orders)
    ann.send(Orders(tick=5, actions=bytes(N_UNITS)), 5)
    ann.put(orders)

    match = pit.core.matches[0]
    assert match.tick == 1
    assert match.record(Team.BLUE).faults() == NO_FAULTS | {"stale": 1}, "for the tick that is still to come"
    assert len(read_journal(whole_part(pit.journals[FIRST])).ticks) == 1


def test_beyond_a_bound_forged_messages_are_not_tried_until_time_has_passed(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    for _ in range(MOST_REJECTED):
        ann.put(b"junk" * 30)
    ann.ready()
    bob.ready()
    assert ann.read() == []

    pit.pass_time()
    ann.ready()

    assert [type(message) for message in ann.read()] == [Turn]


def test_a_message_that_opens_and_is_none_of_a_seat_s_is_counted(pit: OfflinePit) -> None:
    ann, _ = begin(pit)
    ann.put(ann.sealer.close(b"\xc1", 0))
    ann.send(Wait(reason=""))

    assert pit.core.matches[0].record(Team.BLUE).garbled == 2


def test_of_a_process_that_is_called_as_no_client_can_be_nothing_is_kept(pit: OfflinePit) -> None:
    """A name on a key of Zenoh's may have 60,000 letters, and thousands of processes are remembered."""
    tracemalloc.start()
    for number in range(100):
        for is_present in (True, False):
            pit.do(PresenceChanged(f"{number:060000}", is_present))
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert kept < 100_000


def test_messages_of_no_match_are_ignored(pit: OfflinePit) -> None:
    assert pit.do(ActionReceived(999_999, Team.BLUE, b"")) == []


# Receipts and journals


def test_a_match_waits_for_its_receipts_for_a_while_and_takes_one_a_seat(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob)
    head = bytes(32)
    bob.send(sign_receipt(ann.identity, bob.ticket.match, Team.RED, 7, head))
    for player in (ann, ann):
        player.give_receipt()
    pit.pass_time(RECEIPTS_S - 0.1)
    assert (list(pit.files), pit.core.is_deserted) == ([ann.ticket.match], False)

    pit.pass_time(0.2)

    assert (pit.files, pit.core.is_deserted) == ({}, True)
    checked = check_seals(read_journal(pit.journals[FIRST]))
    assert checked is not None
    assert checked.receipts == {Team.BLUE: Standing.HOLDS, Team.RED: Standing.MISSING}


def test_forged_messages_keep_out_no_receipt(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob)
    for _ in range(MOST_REJECTED):
        bob.put(b"junk" * 30)
    pit.pass_time()

    for player in (ann, bob):
        player.give_receipt()

    checked = check_seals(read_journal(pit.journals[FIRST]))
    assert checked is not None
    assert set(checked.receipts.values()) == {Standing.HOLDS}


def test_a_journal_is_given_once_it_is_whole(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    match = ann.ticket.match
    assert isinstance(pit.reply(pit.ask_for_journal(match)), Refusal)
    play(ann, bob)
    asked = pit.ask_for_journal(match)
    assert asked not in pit.replies

    pit.pass_time(RECEIPTS_S)

    assert pit.replies[asked] == pit.journals[FIRST]
    assert pit.replies[pit.ask_for_journal(match, offset=100)] == pit.journals[FIRST][100:]


def test_boards_are_shown_to_everyone_only_where_no_map_is_played_again() -> None:
    plans = [plan("league/0", "ann", "bob"), plan("league/1", "bob", "ann")]

    with pytest.raises(ValueError, match="only where its map is never played again"):
        OfflinePit(PlannedSeating(plans), public_delay=20)


def test_entries_and_the_lobby_are_told_how_late_boards_are_shown_to_everyone() -> None:
    pit = OfflinePit(public_delay=20)
    ann, bob = begin(pit)

    assert (ann.ticket.public_delay, bob.ticket.public_delay) == (20, 20)
    assert pit.lobby().public_delay == 20


def test_a_journal_is_given_when_its_whole_fixture_is_over_and_not_before() -> None:
    plans = [plan("league/0", "ann", "bob"), plan("league/1", "bob", "ann"), plan("league/2", "ann", "cid")]
    pit = OfflinePit(PlannedSeating(plans))
    played: list[str] = []

    def play_leg(leg: int) -> None:
        ann, bob = Player(pit, "ann", client=f"a{leg}"), Player(pit, "bob", client=f"b{leg}")
        ann.identity, bob.identity = identities
        ann.ask()
        bob.join()
        played.append(bob.ticket.match)
        assert isinstance(pit.reply(pit.ask_for_journal(played[leg])), Refusal)
        if leg:
            assert isinstance(pit.reply(pit.ask_for_journal(played[0])), Wait)
        play(ann.take(), bob)
        pit.pass_time(RECEIPTS_S)

    identities = Identity.make(), Identity.make()
    play_leg(0)
    assert pit.reply(pit.ask_for_journal(played[0])) == Wait(reason="until the last match of these two is over")
    play_leg(1)

    assert {pit.replies[pit.ask_for_journal(match)] for match in played} == set(pit.journals.values())


@pytest.mark.parametrize("payload", [b"", b"\xc1", encode(Ready(known_ticks=0))])
def test_junk_for_a_journal_is_refused(pit: OfflinePit, payload: bytes) -> None:
    question = pit.ask(lambda question: JournalAsked(question, "m", payload))

    assert isinstance(pit.reply(question), Refusal)


# Names


def test_no_two_runs_call_a_match_the_same_and_each_journal_says_how_its_own_called_it() -> None:
    names = []
    for _ in range(2):  # the same pit, entries, secret and number
        pit = OfflinePit()
        ann, bob = begin(pit)
        play(ann, bob)
        names.append(ann.ticket.match)
        journal = read_journal(whole_part(pit.journals[FIRST]))
        assert (journal.name, journal.header.identity) == (ann.ticket.match, "pit/1")
        checked = check_seals(journal)
        assert checked is not None
        assert checked.commitment is Standing.HOLDS

    assert names[0] != names[1]


def test_a_resumed_match_keeps_its_name(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=2)
    later = pit.successor()
    later.do(find(pit, FIRST))

    assert Player(later, "ann", ann.identity).join(match=ann.ticket.match).ticket.match == ann.ticket.match


# The lobby


def test_the_lobby_lists_who_plays_and_who_waits(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=2)
    Player(pit, "eve").ask()
    pit.pass_time(0.5)
    lobby = pit.lobby()

    assert isinstance(lobby, Lobby)
    assert lobby.running == [{"match": ann.ticket.match, "blue": "ann", "red": "bob", "tick": 2}]
    assert (lobby.waiting, lobby.n_begun, lobby.needs_invite) == (["eve"], 1, False)


def test_the_lobby_is_signed_anew_twice_a_second_and_when_a_match_begins(pit: OfflinePit) -> None:
    def read() -> bytes | None:
        return pit.replies[pit.ask(LobbyAsked)]

    first = read()
    Player(pit, "eve").ask()
    assert read() == first
    pit.now_s += 0.5
    second = read()
    assert second != first
    Player(pit, "dan").join()
    assert read() != second


# A pit that stops, and one that begins where it stopped


def test_a_pit_that_stops_signs_what_is_over_and_leaves_what_runs(pit: OfflinePit) -> None:
    play(*begin(pit))
    play(*begin(pit, "eve", "dan"), n_ticks=1)

    pit.do(Stopped())

    over, running = (read_journal(whole_part(pit.journals[journal_name(f"pit/{number}")])) for number in (1, 2))
    assert over.ending is not None
    assert over.seals is not None
    assert over.seals.signature
    assert running.ending is None
    assert pit.files == {}


def find(pit: OfflinePit, name: str, cut: int = 0) -> UnfinishedFound:
    whole = whole_part(pit.journals[name][: len(pit.journals[name]) - cut])
    journal = read_journal(whole)
    assert journal.seals is not None
    return UnfinishedFound(name, journal, journal.seals.entries, journal.seals.nonce, len(whole))


@pytest.mark.parametrize("cut", [0, 1, 40])
def test_a_match_that_was_cut_off_is_resumed_at_its_tick_and_ends_as_it_would_have(pit: OfflinePit, cut: int) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=3)
    later = pit.successor()

    later.do(find(pit, FIRST, cut))
    players = [Player(later, player.name, player.identity).join(match=player.ticket.match) for player in (ann, bob)]
    for player in players:
        player.ready()
    for player in (*players, *players):  # the history, and the turn that follows once both have seen it
        player.read()
    for _ in range(RULES.tick_limit - later.core.matches[0].tick):
        for player in players:
            player.order()
        for player in players:
            player.read()
    for player in players:
        player.give_receipt()

    play(ann, bob, n_ticks=0)
    for _ in range(RULES.tick_limit - 3):
        for player in (ann, bob):
            player.order()
        for player in (ann, bob):
            player.read()
    resumed, uncut = (read_journal(whole_part(one.journals[FIRST])) for one in (later, pit))
    assert resumed.canonical == uncut.canonical
    checked = check_seals(resumed)
    assert checked is not None
    assert set(checked.receipts.values()) == {Standing.HOLDS}


def test_a_match_that_was_killed_between_its_last_tick_and_its_ending_ends_at_once(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob)
    n_ending = next(n for n in range(1, 1_000) if read_journal(whole_part(pit.journals[FIRST][:-n])).ending is None)
    later = pit.successor()

    later.do(find(pit, FIRST, n_ending))

    assert [ended.result.ending for ended in later.ended] == [Termination.TICK_LIMIT]
    assert read_journal(later.journals[FIRST]).canonical == read_journal(pit.journals[FIRST]).canonical


def test_a_match_that_never_began_leaves_no_journal(pit: OfflinePit) -> None:
    ann, _ = begin(pit)
    ann.ready()
    assert not pit.journals
    pit.core.receive(Stopped(), pit.now_s)
    assert not pit.journals, "a pit that stops leaves nothing of it"

    pit = OfflinePit()
    ann, bob = begin(pit)
    pit.do(TimePassed(pit.now_s))
    asked = pit.ask_for_journal(ann.ticket.match)
    assert Player(pit, "operator", PIT).command("abort", ann.ticket.match) == Done(text=f"match {ann.ticket.match} is void")
    asked = pit.ask_for_journal(ann.ticket.match)
    for player in (ann, bob):
        player.give_receipt()
    pit.pass_time(RECEIPTS_S)

    assert (pit.journals, pit.files) == ({}, {})
    assert pit.ended[0].result.ending is Termination.VOID
    assert isinstance(pit.reply(asked), Refusal)


def test_a_match_that_is_forfeited_before_its_first_tick_has_a_journal(pit: OfflinePit) -> None:
    ann, _ = begin(pit)
    ann.ready()
    pit.pass_time(TimeControl().grace_s)

    assert pit.ended[0].result.ending is Termination.FORFEIT
    assert read_journal(whole_part(pit.journals[FIRST])).ending == pit.ended[0].result


def test_no_match_begins_while_no_journal_can_be_opened_and_nobody_loses_anything(pit: OfflinePit) -> None:
    pit.do(JournalsReady(0))
    ann, bob = Player(pit, "ann"), Player(pit, "bob")
    assert (ann.ask(), bob.ask()) == (None, None)
    pit.pass_time(HOLD_QUESTION_S)
    assert [player.answer() for player in (ann, bob)] == [
        Wait(reason="for room: the pit can open no journal for another match now")
    ] * 2

    pit.do(JournalsReady(1))
    for player in (ann, bob):
        player.ask()
    pit.pass_time()

    play(ann.take(), bob.take())
    assert len(pit.ended) == 1


def test_a_journal_that_was_changed_is_left_alone(pit: OfflinePit, caplog: pytest.LogCaptureFixture) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=2)
    data = bytearray(pit.journals[FIRST])
    data[-1] ^= 1
    pit.journals[FIRST] = bytes(data)

    assert OfflinePit().do(find(pit, FIRST)) == []
    assert f"{FIRST} cannot be resumed" in caplog.text


# Any sequence of events


NAMES = ("ann", "bob", "cid")
STEPS = st.tuples(
    st.sampled_from(["ask", "ask", "take", "ready", "order", "order", "vanish", "restart", "junk", "receipt", "wait", "admin"]),
    st.integers(0, len(NAMES) - 1),
    st.integers(0, 3),
)


@given(st.lists(STEPS, max_size=80))
def test_whatever_happens_no_tick_is_sent_before_it_is_written_and_no_question_is_answered_twice(
    steps: list[tuple[str, int, int]],
) -> None:
    """`OfflinePit` checks both at every effect; here the seats and the journals are looked at as well."""
    pit = OfflinePit(time_control=TimeControl(turn_time_s=1.0, bank_s=1.0, grace_s=3.0))
    identities = {name: Identity.make() for name in NAMES}
    players = [Player(pit, name, identities[name]) for name in NAMES]
    operator = Player(pit, "operator", PIT)
    for number, (step, index, kind) in enumerate(steps):
        do_step(pit, players, operator, step, index, kind, number)
        held = {seat: slot for seat, slot in holders(pit).items() if slot}
        assert len(set(held.values())) == len(held), "a slot holds one seat"
        assert {match for match, _ in held} <= set(pit.files)

    pit.do(Stopped())
    assert pit.files == {}
    for data in pit.journals.values():
        journal = read_journal(whole_part(data))
        if journal.ending is not None:
            assert verify(journal) == journal.ending.ticks


def do_step(pit: OfflinePit, players: list[Player], operator: Player, step: str, index: int, kind: int, number: int) -> None:
    player = players[index]
    is_seated = hasattr(player, "ticket")
    match step:
        case "ask":
            player.ask(team=("any", "blue", "red", "any")[kind], slot=kind // 3)
        case "take" if hasattr(player, "attempt") and isinstance(player.answer(), Ticket):
            player.take()
        case "ready" if is_seated:
            player.read()
            player.ready()
        case "order" if is_seated:
            player.read()
            player.order(bytes([kind]) * N_UNITS)
        case "vanish":
            player.vanish()
        case "restart":
            players[index] = Player(pit, player.name, player.identity, client=f"c{number}")
        case "junk" if is_seated:
            player.put(bytes([kind]) * 60)
        case "receipt" if is_seated:
            player.give_receipt()
        case "wait":
            pit.pass_time((0.01, 0.6, 2.0, 5.0)[kind])
        case "admin":
            target = next(iter(pit.files), player.name) if kind == 0 else player.name
            operator.command(("abort", "kick", "release-name", "kick")[kind], target)


def holders(pit: OfflinePit) -> dict[Any, Any]:
    book: Any = pit.core._matches._seats
    return {seat: book.is_held(seat) and holding.slot for seat, holding in book._holdings.items()}


def test_what_cannot_be_written_is_received_by_nobody(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob, n_ticks=1)
    ann.order()
    carry_out = pit._carry_out

    def fail(effect: Any) -> None:
        if isinstance(effect, Append):
            raise ArenaError("the disk is full")
        carry_out(effect)

    pit._carry_out = fail  # type: ignore[method-assign]
    with pytest.raises(ArenaError):
        bob.order()

    assert (ann.read(), bob.read()) == ([], [])


def ask_for_a_piece(pit: OfflinePit, match: str) -> int:
    return pit.ask(lambda question: JournalAsked(question, match, encode(JournalRequest(offset=0))))


def test_journals_have_their_share_of_the_time_while_matches_run_and_the_rest_waits(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob)
    for player in (ann, bob):
        player.give_receipt()
    begin(pit, "eve", "dan")
    pit.pass_time()
    n_asked, cost_s, passed_s = 20, 0.05, 5.0
    pit.opening_s = lambda: cost_s
    begun_s = pit.now_s

    asked = [ask_for_a_piece(pit, ann.ticket.match) for _ in range(n_asked)]
    while pit.now_s < begun_s + passed_s:
        pit.pass_time()

    n_answered = sum(question in pit.replies for question in asked)
    assert 0.5 * passed_s < n_answered * cost_s / 0.1 < 1.5 * passed_s
    pit.core.receive(Stopped(), pit.now_s)


def test_a_flood_for_journals_does_not_keep_out_who_wants_a_seat(pit: OfflinePit) -> None:
    ann, bob = begin(pit)
    play(ann, bob)
    for player in (ann, bob):
        player.give_receipt()
    begin(pit, "eve", "dan")
    pit.opening_s = lambda: 0.05
    for _ in range(500):
        ask_for_a_piece(pit, ann.ticket.match)

    assert sum(payload is None for payload in pit.replies.values()) > 300, "what is beyond the bound is dropped"
    late = Player(pit, "late").send_request()
    for _ in range(30):
        pit.pass_time()
    assert late.pit.lobby().waiting == ["late"]
