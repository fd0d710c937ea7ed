"""How a match ended: in one sentence everywhere, and in one form in journals, messages, stores and programs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.game.types import Team, Termination
from arena.policy import MatchResult

results = st.builds(
    MatchResult,
    ending=st.sampled_from(Termination),
    winner=st.sampled_from([None, *Team]),
    score=st.integers(-100, 100),
    ticks=st.integers(0, 1_000),
    reason=st.text(),
)
CAPTURE = MatchResult(ending=Termination.CAPTURE, winner=Team.BLUE, score=100, ticks=12)
FORFEIT = MatchResult(ending=Termination.FORFEIT, winner=Team.RED, score=-100, ticks=3, reason="blue vanished")
DRAW = MatchResult(ending=Termination.TICK_LIMIT, winner=None, score=0, ticks=100)
VOID = MatchResult(ending=Termination.VOID, winner=None, score=0, ticks=7, reason="was ended by the operator")


@given(results)
def test_a_result_reads_back(result: MatchResult) -> None:
    assert MatchResult.from_dict(result.to_dict() | {"another": "field"}) == result


@pytest.mark.parametrize("change", [{"ending": "magic"}, {"winner": "green"}])
def test_what_no_match_ends_like_is_refused(change: dict[str, str]) -> None:
    with pytest.raises(KeyError):
        MatchResult.from_dict(CAPTURE.to_dict() | change)


@pytest.mark.parametrize(
    ("result", "sentence"),
    [
        (CAPTURE, "blue wins by capture after 12 ticks, score +100 for blue"),
        (FORFEIT, "red wins by forfeit (blue vanished) after 3 ticks, score -100 for blue"),
        (DRAW, "draw by tick limit after 100 ticks, score +0 for blue"),
        (VOID, "void (was ended by the operator) after 7 ticks, score +0 for blue"),
    ],
)
def test_a_result_is_described_for_everybody(result: MatchResult, sentence: str) -> None:
    assert result.describe() == sentence


@pytest.mark.parametrize(
    ("result", "sentence"),
    [
        (CAPTURE, "loss as red by capture after 12 ticks, score -100"),
        (FORFEIT, "win as red by forfeit (blue vanished) after 3 ticks, score +100"),
        (DRAW, "draw as red by tick limit after 100 ticks, score +0"),
        (VOID, "void as red (was ended by the operator) after 7 ticks, score +0"),
    ],
)
def test_a_result_is_described_for_a_team(result: MatchResult, sentence: str) -> None:
    assert result.seen_by(Team.RED).describe(Team.RED) == sentence


def test_a_headline_names_who_played() -> None:
    assert FORFEIT.headline("rush", "roomba") == "roomba wins by forfeit (blue vanished)"


@given(results, st.sampled_from(Team))
def test_what_one_team_gains_the_other_loses(result: MatchResult, team: Team) -> None:
    assert result.points(team) + result.points(team.other) == 1
    assert result.seen_by(team).seen_by(team) == result
    assert result.seen_by(team).score == -result.seen_by(team.other).score
