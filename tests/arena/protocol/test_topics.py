import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import InputError, UnreadableError
from arena.game.types import Team
from arena.protocol import topics

CHUNKS = st.from_regex(r"[A-Za-z0-9_-]{1,64}", fullmatch=True)


@given(CHUNKS, st.integers(0, 999_999), st.sampled_from([*Team, None]))
def test_an_action_key_is_read_back(pit: str, lane: int, team: Team | None) -> None:
    assert topics.read_action(topics.action(pit, lane, team)) == (lane, team)


@given(CHUNKS, CHUNKS, CHUNKS)
def test_a_presence_key_is_read_back(pit: str, name: str, client: str) -> None:
    assert topics.read_presence(topics.presence(pit, name, client)) == client


def test_the_keys_are_those_of_the_design() -> None:
    assert topics.join("p") == "arena/p/join"
    assert topics.lobby("p") == "arena/p/lobby"
    assert topics.observation("p", 7, Team.RED) == "arena/p/lane/7/red/observation"
    assert topics.action("p", 7, Team.BLUE) == "arena/p/lane/7/blue/action"
    assert topics.observation("p", 7, None) == "arena/p/lane/7/all/observation"
    assert topics.all_actions("p") == "arena/p/lane/*/*/action"
    assert topics.public("p", "m") == "arena/p/match/m/public"
    assert topics.presence("p", "ann", "c") == "arena/p/presence/ann/c"
    assert topics.all_presence("p") == "arena/p/presence/*/*"


@pytest.mark.parametrize(
    "key",
    [
        "",
        "arena/p/lane/7/green/action",
        "arena/p/lane/7/*/action",
        "arena/p/lane/beat/red/action",
        "a/b/c/d/red/f/g",
    ],
)
def test_another_key_is_no_seats_key(key: str) -> None:
    with pytest.raises(UnreadableError):
        topics.read_action(key)


@pytest.mark.parametrize("chunk", ["", "*", "**", "a/b", "$", "#", "?", " ", "ä", "a\n", "x" * 65])
def test_a_name_that_could_reach_into_another_key_is_refused(chunk: str) -> None:
    assert not topics.is_chunk(chunk)
    with pytest.raises(InputError, match=r"the name is .*; it must be 1 to 64 letters, digits, - or _"):
        topics.check_chunk("the name", chunk)


@given(CHUNKS)
def test_a_plain_name_is_taken(chunk: str) -> None:
    assert topics.is_chunk(chunk)
    assert topics.check_chunk("the name", chunk) == chunk
