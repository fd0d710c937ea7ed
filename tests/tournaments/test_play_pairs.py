"""`tournaments.testing.play_pairs`, as an author's test calls it."""

import doctest
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import tournaments.testing
from arena import Observation
from arena.errors import PolicyError, UnknownNameError
from arena.game.ruleset import load
from tournaments.testing import play_pairs

SMALL = load("paper").with_({"side": 10, "tick_limit": 30})
EAST = "def act(observation):\n    return [2 for _ in observation.units]\n"


def east(observation: Observation) -> Sequence[int]:
    return [2 for _ in observation.units]


class East:
    def act(self, observation: Observation) -> Sequence[int]:
        return east(observation)


def test_it_counts_from_the_side_of_the_bot() -> None:
    score, other = play_pairs("rush", east, 4, rules=SMALL), play_pairs(east, "rush", 4, rules=SMALL)

    assert score.wins + score.draws + score.losses == sum(score.endings.values()) == 8
    assert score.score == (score.wins + score.draws / 2) / 8
    assert score.score > other.score
    assert score.interval[0] <= score.score <= score.interval[1]


def test_a_function_a_class_a_path_and_a_name_of_one_bot_play_alike(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(EAST)
    found = [play_pairs(bot, "rush", 2, rules=SMALL) for bot in (east, East, tmp_path / "mine.py", str(tmp_path / "mine.py"))]

    assert found == found[:1] * 4
    assert found[0].ticks > 0


def test_the_seed_decides_the_matches() -> None:
    one, again, other = (play_pairs("rush", "patrol", 3, rules=SMALL, seed=seed) for seed in (1, 1, 2))

    assert one == again
    assert (one.ticks, one.endings) != (other.ticks, other.endings)


@pytest.mark.parametrize(
    ("bot", "kind", "says"),
    [
        (lambda _: [1], "illegal", "tick 0: 1 orders for 6 units; all its units stay (60 times)"),
        (lambda _: 1 / 0, "raised", "ZeroDivisionError: division by zero"),
    ],
)
def test_what_went_wrong_is_counted_and_said(bot: Any, kind: str, says: str) -> None:
    score = play_pairs(bot, lambda seen: [0 for _ in seen.units], 1, rules=SMALL)

    assert score.n_faults == getattr(score.faults, kind) == score.ticks == 60
    assert says in str(score)
    assert "Traceback" in str(score) or kind == "illegal"
    assert score.opponent_faults.raised == score.opponent_faults.illegal == 0


def test_a_score_says_itself_in_a_sentence() -> None:
    assert str(play_pairs(east, east, 1, rules=SMALL.with_({"tick_limit": 1}))) == (
        "0 wins, 2 draws, 0 losses, 0 failed turns: score 0.500 (0.000 to 1.000)"
    )


def test_what_is_no_fighter_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'rush'"):
        play_pairs(east, "rsh")
    with pytest.raises(PolicyError, match="nor a function"):
        play_pairs(3, "rush")  # type: ignore[arg-type]
    with pytest.raises(PolicyError, match=r"cannot read the bot file absent\.py"):
        play_pairs(Path("absent.py"), "rush")


def test_the_example_in_the_docstring_holds() -> None:
    done = doctest.testmod(tournaments.testing)

    assert (done.failed, done.attempted > 0) == (0, True)
