"""Signatures of a journal, and transcripts, against the match as it is played again."""

import tracemalloc
from dataclasses import replace

import pytest
from sealed_match import (
    CLOCK,
    ENTRIES,
    KEYS,
    OTHER_KEYS,
    PIT,
    STRANGER,
    UNITS,
    Played,
)

from arena.game.ruleset import load
from arena.game.types import Action, Team, Termination
from arena.protocol.signed import sign_journal
from arena.records.journal import Journal, Mark, read_journal
from arena.records.replay import BrokenChainError
from arena.records.verification import Checked, Standing, check_seals, compare, watch


def checked(journal: Journal) -> Checked:
    found = check_seals(journal)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def calm() -> Played:
    return Played().play()


@pytest.fixture(scope="module")
def timed() -> Played:
    return Played(time_control=CLOCK).play()


# The signatures of a journal


def test_the_word_of_all_three_holds(calm: Played) -> None:
    found = checked(calm.journal())

    assert (found.commitment, found.signature) == (Standing.HOLDS, Standing.HOLDS)
    assert found.receipts == {Team.BLUE: Standing.HOLDS, Team.RED: Standing.HOLDS}
    assert found.is_sound


def test_clocks_that_ran_do_not_matter(timed: Played, calm: Played) -> None:
    """What the clocks said is in no journal, and was yet shown to the seats."""
    assert timed.shown[Team.BLUE][3:] != calm.shown[Team.BLUE][3:]
    assert checked(timed.journal()) == checked(calm.journal())
    assert timed.plain == calm.plain
    assert compare(timed.journal(), timed.transcript(Team.BLUE)) == ""


@pytest.mark.parametrize("team", Team)
def test_a_receipt_that_is_missing_is_shown_and_is_nobody_s_fault(calm: Played, team: Team) -> None:
    found = checked(calm.journal(receipts={team: calm.receipt(team)}))

    assert found.receipts == {team: Standing.HOLDS, team.other: Standing.MISSING}
    assert found.is_sound


def test_a_receipt_by_another_key_or_of_the_other_seat_is_forged(calm: Played) -> None:
    blue, red = calm.receipt(Team.BLUE), calm.receipt(Team.RED)
    for receipts in (
        {Team.BLUE: calm.receipt(Team.BLUE, by=STRANGER), Team.RED: red},
        {Team.BLUE: replace(blue, n_shown=blue.n_shown - 1), Team.RED: red},
        {Team.BLUE: red, Team.RED: red},
        {Team.BLUE: calm.receipt(Team.RED, by=ENTRIES[Team.BLUE]), Team.RED: red},
        {Team.BLUE: Played(identity="pit/1/ann/bob").play().receipt(Team.BLUE), Team.RED: red},
    ):
        found = checked(calm.journal(receipts=receipts))

        assert found.receipts == {Team.BLUE: Standing.FORGED, Team.RED: Standing.HOLDS}
        assert not found.is_sound


def test_a_receipt_of_another_match_s_sights_differs_and_the_pit_s_word_stands_against_the_seat_s(calm: Played) -> None:
    changed = [*calm.shown[Team.RED][:-1], calm.shown[Team.RED][0]]
    n_shown, to_the_end = len(calm.shown[Team.RED]), watch(calm.journal())[Team.RED]
    for receipt in (
        calm.receipt(Team.RED, n_shown=len(to_the_end) + 1, shown=to_the_end),
        calm.receipt(Team.RED, shown=changed),
        calm.receipt(Team.RED, shown=calm.shown[Team.BLUE]),
        calm.receipt(Team.RED, n_shown=n_shown - 1, shown=calm.shown[Team.RED]),
        calm.receipt(Team.RED, n_shown=n_shown + 5),
        calm.receipt(Team.RED, n_shown=2**32 - 1),
    ):
        found = checked(calm.journal(receipts={Team.BLUE: calm.receipt(Team.BLUE), Team.RED: receipt}))

        assert found.receipts == {Team.BLUE: Standing.HOLDS, Team.RED: Standing.DIFFERS}
        assert found.is_sound


@pytest.mark.parametrize("n_shown", [0, 1, 5])
def test_a_seat_that_was_away_speaks_for_what_it_was_shown(calm: Played, n_shown: int) -> None:
    found = checked(calm.journal(receipts={Team.BLUE: calm.receipt(Team.BLUE, n_shown=n_shown)}))

    assert found.receipts[Team.BLUE] is Standing.HOLDS


def test_a_seat_that_left_a_match_for_good_was_shown_less_and_its_word_holds() -> None:
    match = Played().play(4)
    match.submit(Team.RED, bytes(UNITS))
    match.carry_out(match.match.leave(Team.RED, match.now_s))
    match.submit(Team.BLUE, bytes(UNITS))
    match.carry_out(match.match.advance(match.now_s + 1_000))

    journal = match.journal()
    assert journal.ending is not None
    assert (journal.ending.ending, len(journal.ticks)) == (Termination.FORFEIT, 5)
    assert [len(match.shown[team]) for team in Team] == [6, 5]
    assert set(checked(journal).receipts.values()) == {Standing.HOLDS}
    assert [compare(journal, match.transcript(team)) for team in Team] == ["", ""]


def test_a_commitment_to_other_keys_another_match_or_by_another_pit_is_forged(calm: Played) -> None:
    for commitment in (
        calm.commitment(OTHER_KEYS),
        calm.commitment(KEYS, match="0123456789abcdef"),
        calm.commitment(KEYS, by=STRANGER),
        bytes(64),
    ):
        found = checked(calm.journal(commitment=commitment))

        assert (found.commitment, found.signature) == (Standing.FORGED, Standing.HOLDS)
        assert not found.is_sound


def test_the_pit_s_signature_of_another_journal_or_by_another_is_forged(calm: Played) -> None:
    other = Played(identity="pit/1/ann/bob").play()
    for signature in (sign_journal(PIT, other.match.head), sign_journal(STRANGER, calm.match.head), bytes(64)):
        found = checked(calm.journal(signature=signature))

        assert (found.commitment, found.signature) == (Standing.HOLDS, Standing.FORGED)
        assert not found.is_sound


def test_a_pit_that_was_killed_before_it_signed_is_seen_and_no_liar(calm: Played) -> None:
    found = checked(calm.journal(signature=b""))

    assert found.signature is Standing.MISSING
    assert found.is_sound


def test_a_journal_without_a_network_has_no_signatures(calm: Played) -> None:
    assert check_seals(read_journal(calm.plain)) is None


def test_signatures_of_a_journal_that_does_not_hold_are_not_looked_at(calm: Played) -> None:
    journal = calm.journal()
    ticks = (replace(journal.ticks[0], orders=bytes(2 * UNITS)), *journal.ticks[1:])

    with pytest.raises(BrokenChainError):
        check_seals(replace(journal, ticks=ticks))
    with pytest.raises(BrokenChainError):
        compare(replace(journal, ticks=ticks), calm.transcript(Team.BLUE))


# A seat's transcript against the journal of its match


@pytest.mark.parametrize("team", Team)
def test_a_seat_s_transcript_is_of_its_match(calm: Played, team: Team) -> None:
    assert compare(calm.journal(), calm.transcript(team)) == ""
    assert compare(read_journal(calm.plain), calm.transcript(team)) == ""


def test_a_transcript_that_stops_is_of_its_match_so_far(calm: Played) -> None:
    transcript = calm.transcript(Team.RED)

    assert compare(calm.journal(), replace(transcript, ticks=transcript.ticks[:3], ending=None)) == ""
    assert compare(calm.journal(), replace(transcript, ticks=[], ending=None)) == ""


def test_a_transcript_of_another_match_is_told_apart(calm: Played) -> None:
    other = Played(identity="pit/1/ann/bob").play()

    said = compare(calm.journal(), other.transcript(Team.BLUE))

    assert said == f"the transcript is of match {other.id}, the journal of {calm.id}"


def test_a_pit_that_took_other_keys_than_it_promised_is_found_out(calm: Played) -> None:
    other = Played(keys=OTHER_KEYS).play()

    assert compare(other.journal(), calm.transcript(Team.RED)) == (
        "the journal's keys are not those that the pit committed itself to"
    )


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("tick", [0, 5])
def test_one_observation_that_was_another_is_named(calm: Played, team: Team, tick: int) -> None:
    transcript = calm.transcript(team)
    observation, orders = transcript.ticks[tick]
    for at in (0, len(observation) // 2, len(observation) - 1):
        changed = bytearray(observation)
        changed[at] ^= 1
        transcript.ticks[tick] = bytes(changed), orders

        assert compare(calm.journal(), transcript) == (
            f"at tick {tick} the seat was shown something else than the journal's match shows"
        )


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("tick", [0, 5])
def test_orders_that_the_seat_did_not_give_are_named(calm: Played, team: Team, tick: int) -> None:
    for unit in (0, UNITS - 1):
        transcript = calm.transcript(team)
        observation, orders = transcript.ticks[tick]
        changed = bytearray(orders)
        changed[unit] = (changed[unit] + 1) % len(Action)
        transcript.ticks[tick] = observation, bytes(changed)

        assert compare(calm.journal(), transcript) == f"at tick {tick} the journal has other orders than the seat gave"


def test_orders_that_came_late_were_not_played_and_the_journal_says_so() -> None:
    def is_late(match: Played, team: Team, tick: int) -> bytes | None:
        return None if (team, tick) == (Team.RED, 4) else bytes([1]) * UNITS

    late = Played(time_control=CLOCK, quirk=is_late).play()
    journal = late.journal()

    assert journal.ticks[4].marks == (Mark(0), Mark.LATE)
    assert journal.ticks[4].orders[UNITS:] == bytes(UNITS) != late.said[Team.RED][4]
    assert [compare(journal, late.transcript(team)) for team in Team] == ["", ""]
    assert set(checked(journal).receipts.values()) == {Standing.HOLDS}


def test_an_answer_that_nobody_could_read_was_not_played_and_the_journal_says_so() -> None:
    def is_unreadable(match: Played, team: Team, tick: int) -> bytes | None:
        return bytes([1, 9]) if (team, tick) == (Team.BLUE, 2) else bytes([1]) * UNITS

    match = Played(quirk=is_unreadable).play()
    journal = match.journal()

    assert journal.ticks[2].marks == (Mark.UNREADABLE, Mark(0))
    assert journal.ticks[2].orders[:UNITS] != match.said[Team.BLUE][2]
    assert [compare(journal, match.transcript(team)) for team in Team] == ["", ""]


def test_only_the_seat_s_own_mark_excuses_its_orders(calm: Played) -> None:
    def is_late(match: Played, team: Team, tick: int) -> bytes | None:
        return None if (team, tick) == (Team.BLUE, 4) else bytes([1]) * UNITS

    late = Played(time_control=CLOCK, quirk=is_late).play()
    transcript = late.transcript(Team.RED)
    transcript.ticks[4] = transcript.ticks[4][0], bytes([2]) * UNITS

    assert compare(late.journal(), transcript) == "at tick 4 the journal has other orders than the seat gave"


def test_ticks_that_a_seat_played_cannot_be_taken_back(calm: Played) -> None:
    """The pit stops the journal early: it holds, and is signed."""
    short = Played().play(5)
    short.carry_out(short.match.void("was ended by the operator"))

    assert checked(short.journal()).is_sound
    assert compare(short.journal(), replace(calm.transcript(Team.BLUE), ending=None)) == (
        "the seat was shown more ticks than the journal has"
    )
    assert compare(short.journal(), short.transcript(Team.BLUE)) == ""


def test_an_ending_that_the_seat_was_not_told_is_named() -> None:
    won, lost = Played().play(5), Played().play(5)
    won.carry_out(won.match.forfeit(Team.RED, "was removed by the operator"))
    lost.carry_out(lost.match.forfeit(Team.BLUE, "was removed by the operator"))

    for team in Team:
        assert compare(won.journal(), won.transcript(team)) == ""
        assert compare(lost.journal(), won.transcript(team)) == "the journal ends otherwise than the seat was told"


def test_a_match_is_watched_without_all_of_it_in_memory() -> None:
    """A stranger's journal of 40 MB may have a million ticks, which would be 8 GB."""
    played = Played(ruleset=load("paper").with_({"side": 64, "tick_limit": 400, "units": {"ugv": {"attack": 0}}})).play()
    journal, transcript = played.journal(), played.transcript(Team.RED)
    all_shown = sum(map(len, played.shown[Team.BLUE]))
    tracemalloc.start()

    checked, difference = check_seals(journal), compare(journal, transcript)

    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (checked is not None and checked.is_signed, difference) == (True, "")
    assert len(played.shown[Team.BLUE]) > 100
    assert most < all_shown / 2
