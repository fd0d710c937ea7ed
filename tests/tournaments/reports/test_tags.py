"""What is remarkable about matches, and how two entries fared against each other."""

import pytest
from outcomes import ended, met

from arena.game.types import Team, Termination
from arena.policy import MatchResult
from tournaments.outcome import Outcome
from tournaments.reports.head_to_head import head_to_head
from tournaments.reports.tags import COMEBACK_SCORE, UPSET_ELO, Course, tag_course, tag_results

ELO = {"ann": 0.0, "bob": float(UPSET_ELO), "cyd": UPSET_ELO - 1.0}


def won(winner: Team | None, *, ending: Termination = Termination.CAPTURE) -> MatchResult:
    return MatchResult(ending=ending, winner=winner, score=0, ticks=10)


@pytest.mark.parametrize(
    ("blue", "red", "winner", "tags"),
    [
        ("ann", "bob", Team.BLUE, ["upset"]),
        ("bob", "ann", Team.RED, ["upset"]),
        ("ann", "bob", Team.RED, []),
        ("ann", "bob", None, []),
        ("ann", "cyd", Team.BLUE, []),
    ],
)
def test_an_upset_is_won_by_whoever_is_rated_far_lower(blue: str, red: str, winner: Team | None, tags: list[str]) -> None:
    outcome = ended("l/1", blue, red, winner, ending=Termination.TICK_LIMIT)

    assert tag_results([outcome], ELO).get("l/1", []) == tags


def test_the_longest_is_of_those_that_were_decided_on_the_board() -> None:
    ticks = {"short": (5, Termination.CAPTURE), "one": (9, Termination.ELIMINATION), "two": (9, Termination.CAPTURE)}
    ticks |= {"clock": (100, Termination.TICK_LIMIT), "gone": (50, Termination.FORFEIT)}
    outcomes = [ended(name, "bob", "ann", Team.BLUE, ticks=n, ending=ending) for name, (n, ending) in ticks.items()]

    assert tag_results(outcomes, ELO) == {"one": ["longest"], "two": ["longest"]}
    assert tag_results(outcomes[3:], ELO) == {}


@pytest.mark.parametrize(
    ("winner", "lowest", "highest", "tags"),
    [
        (Team.BLUE, -COMEBACK_SCORE, 100, ["comeback"]),
        (Team.BLUE, -COMEBACK_SCORE + 10, 100, []),
        (Team.RED, -100, COMEBACK_SCORE, ["comeback"]),
        (Team.RED, -COMEBACK_SCORE, 0, []),
        (None, -COMEBACK_SCORE, COMEBACK_SCORE, []),
    ],
)
def test_a_comeback_is_of_a_winner_who_was_behind(winner: Team | None, lowest: int, highest: int, tags: list[str]) -> None:
    assert tag_course(won(winner), Course(lowest=lowest, highest=highest, has_contact=True)) == tags


def test_where_nobody_fought_there_was_no_contact() -> None:
    assert tag_course(won(None), Course(lowest=0, highest=0, has_contact=False)) == ["no contact"]


def test_head_to_head_counts_for_the_first_entry_by_side_and_by_ending() -> None:
    limit = {"ending": Termination.TICK_LIMIT}
    outcomes = [
        met("ann", "bob", 0, "ann", Team.BLUE),
        met("ann", "bob", 0, "bob", Team.BLUE),
        met("ann", "bob", 1, "ann", None, **limit),
        met("ann", "bob", 1, "bob", Team.RED),
        met("ann", "cyd", 0, "ann", Team.BLUE),
    ]

    data = head_to_head(outcomes, "ann", "bob", {outcomes[0].identity: ["upset"]})

    assert data["record"] | {"low": 0, "high": 0} == {
        "wins": 2, "draws": 1, "losses": 1, "score": 0.625, "low": 0, "high": 0, "pairs": 2,
    }  # fmt: skip
    assert data["by_side"] == {"blue": {"wins": 1, "draws": 1, "losses": 0}, "red": {"wins": 1, "draws": 0, "losses": 1}}
    assert data["by_ending"] == {
        "capture": {"wins": 2, "draws": 0, "losses": 1},
        "tick_limit": {"wins": 0, "draws": 1, "losses": 0},
    }
    assert [[tag["name"] for tag in match["tags"]] for match in data["matches"]] == [["upset"], [], [], []]


@pytest.mark.parametrize(("n_pairs", "low", "high"), [(0, 0.0, 1.0), (1, 0.206, 1.0), (10, 0.722, 1.0)])
def test_the_interval_of_a_score_is_never_a_point(n_pairs: int, low: float, high: float) -> None:
    outcomes: list[Outcome] = [
        met("ann", "bob", pair, blue, Team.BLUE if blue == "ann" else Team.RED)
        for pair in range(n_pairs)
        for blue in ("ann", "bob")
    ]

    record = head_to_head(outcomes, "ann", "bob", {})["record"]

    assert (record["low"], record["high"]) == pytest.approx((low, high), abs=1e-3)
