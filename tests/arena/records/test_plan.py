"""The identities of matches: each is a text that reads back as what it was made from."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.records.journal import identity_of, journal_name
from arena.records.plan import LeagueMatchId, PitMatchId

names = st.text("abcXYZ019-_", min_size=1, max_size=12) | st.sampled_from(["ladder", "a-blue", "000001", "-blue", "0"])
league_matches = st.builds(
    LeagueMatchId, league=names, one=names, other=names, pair=st.integers(0, 10**6), blue=names, repeat=st.integers(0, 20)
)
pit_matches = st.builds(PitMatchId, pit=names, is_rated=st.booleans(), number=st.integers(0, 10**8), blue=names, red=names)


@given(league_matches)
def test_a_match_of_a_league_reads_back(match: LeagueMatchId) -> None:
    assert LeagueMatchId.parse(str(match)) == match


@given(pit_matches)
def test_a_match_of_a_pit_reads_back(match: PitMatchId) -> None:
    assert PitMatchId.parse(str(match)) == match


@given(league_matches | pit_matches)
def test_no_identity_is_of_both_kinds(match: LeagueMatchId | PitMatchId) -> None:
    other: type[LeagueMatchId | PitMatchId] = PitMatchId if isinstance(match, LeagueMatchId) else LeagueMatchId

    with pytest.raises(ValueError, match="is no match of"):
        other.parse(str(match))


def test_identities_are_written_as_stores_and_journals_hold_them() -> None:
    """Stores are never rewritten: another text would play every stored match again."""
    assert str(LeagueMatchId(league="friday", one="a", other="b", pair=3, blue="b")) == "friday/a/b/0003/b-blue/0"
    assert str(PitMatchId(pit="pit", is_rated=False, number=7, blue="a", red="b")) == "pit/000007/a/b"
    assert str(PitMatchId(pit="pit", is_rated=True, number=7, blue="a", red="b")) == "pit/ladder/000007/a/b"


@pytest.mark.parametrize(
    "text",
    ["", "friday", "friday/a/b/3/a-blue/0", "friday/a/b/00003/a-blue/0", "friday/a/b/0003/a-blue/00", "friday/a/b/0003/a/0",
     "friday/a//0003/a-blue/0", "x/friday/a/b/0003/a-blue/0", "friday/a/b/٠٠٠٣/a-blue/0", "friday/a/b/0003/a-blue/0\n"],
)  # fmt: skip
def test_what_no_league_writes_is_no_match_of_a_league(text: str) -> None:
    with pytest.raises(ValueError, match="is no match of a league"):
        LeagueMatchId.parse(text)


@pytest.mark.parametrize("text", ["", "pit/7/a/b", "pit/0000007/a/b", "pit/steps/000007/a/b", "pit/000007/a", "pit/000007/a/b/c"])
def test_what_no_pit_writes_is_no_match_of_a_pit(text: str) -> None:
    with pytest.raises(ValueError, match="is no match of an open pit"):
        PitMatchId.parse(text)


@given(league_matches)
def test_two_matches_are_of_one_pair_if_only_their_sides_differ(match: LeagueMatchId) -> None:
    pair, fixture = match.pair_id, match.fixture

    assert str(match).startswith(f"{pair}/")
    assert pair.startswith(f"{fixture}/")


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_the_name_of_a_journal_gives_back_its_identity(identity: str) -> None:
    assert identity_of(journal_name(identity)) == identity
