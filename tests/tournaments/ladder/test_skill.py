"""What a match makes of two ratings."""

import pytest

from arena.game.types import Team, Termination
from arena.policy import MatchResult
from tournaments.ladder.skill import START_MU, LadderEntry, rank, rate


def result(winner: Team | None, ending: Termination = Termination.CAPTURE) -> MatchResult:
    return MatchResult(ending=ending, winner=winner, score=0, ticks=9, reason="")


def players(mu: float = START_MU, sigma: float = 3.0) -> dict[Team, LadderEntry]:
    return {
        Team.BLUE: LadderEntry(key="a", name="ann", mu=mu, sigma=sigma),
        Team.RED: LadderEntry(key="b", name="bob", mu=START_MU, sigma=sigma),
    }


@pytest.mark.parametrize("winner", list(Team))
def test_a_win_moves_both_apart_and_is_counted(winner: Team) -> None:
    after = rate(players(), result(winner))

    assert after[winner].mu > START_MU > after[winner.other].mu
    assert all(player.sigma < 3.0 for player in after.values())
    assert [(player.wins, player.draws, player.losses) for player in (after[winner], after[winner.other])] == [
        (1, 0, 0),
        (0, 0, 1),
    ]
    assert (after[Team.BLUE].n_blue, after[Team.RED].n_blue) == (1, 0)
    assert [player.forfeits for player in after.values()] == [0, 0]


def test_a_draw_moves_both_together() -> None:
    after = rate(players(mu=35.0), result(None, Termination.TICK_LIMIT))

    assert START_MU < after[Team.RED].mu < after[Team.BLUE].mu < 35.0
    assert [player.draws for player in after.values()] == [1, 1]


def test_a_forfeit_is_a_loss() -> None:
    fought, forfeited = rate(players(), result(Team.RED)), rate(players(), result(Team.RED, Termination.FORFEIT))

    assert [player.mu for player in forfeited.values()] == [player.mu for player in fought.values()]
    assert [(player.losses, player.forfeits) for player in forfeited.values()] == [(1, 1), (0, 0)]


def test_a_void_match_is_not_rated() -> None:
    with pytest.raises(ValueError, match="void"):
        rate(players(), result(None, Termination.VOID))


def test_the_side_does_not_move_ratings() -> None:
    blue = rate(players(), result(Team.BLUE))
    red = rate(players(), result(Team.RED))

    assert blue[Team.BLUE].mu == pytest.approx(red[Team.RED].mu, abs=1e-12)


def test_who_has_played_little_stands_below_one_of_the_same_estimate() -> None:
    new, known = LadderEntry(key="a", name="ann", mu=30.0, sigma=8.0), LadderEntry(key="b", name="bob", mu=30.0, sigma=1.0)

    assert [row["name"] for row in rank([new, known])] == ["bob", "ann"]
