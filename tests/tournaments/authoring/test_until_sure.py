"""Two fighters play until one is shown to be better, and no longer."""

import json
import random
import subprocess
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle, islice
from pathlib import Path

import pytest

from arena.game.keys import secret_from_seed
from arena.game.types import Team, Termination
from arena.local.venue import MatchRecord
from arena.policy import Faults, MatchResult
from arena.records.plan import MatchPlan
from tournaments.authoring.until_sure import Comparison, play_until_sure
from tournaments.fixture import plan_fixture
from tournaments.ratings.sprt import Verdict

Run = Callable[..., subprocess.CompletedProcess[str]]
PLANS = plan_fixture("play", "new", "old", 300, secret_from_seed(1))
BEGUN = Comparison.begin("new", "old", 50)
STRONG = [2.0, 1.5, 1.0, 2.0, 0.0]
"""What a stronger fighter scores in its pairs, again and again."""
EVEN = [1.0, 2.0, 0.0, 1.0, 1.0]


def end(plan: MatchPlan, winner: str | None) -> MatchRecord:
    won = None if winner is None else Team.BLUE if plan.blue == winner else Team.RED
    result = MatchResult(ending=Termination.CAPTURE, winner=won, score=0, ticks=9)
    return MatchRecord(plan=plan, result=result, faults=(Faults(), Faults()), n_unreadable=(0, 0), journal=None)


class Venue:
    """Plays no match: the first fighter's pairs end as given, in any order; it keeps how many were asked for at a time."""

    def __init__(self, scores: Sequence[float]) -> None:
        self.batches: list[int] = []
        self._scores = list(islice(cycle(scores), len(PLANS)))

    def play(self, plans: Sequence[MatchPlan]) -> Iterator[MatchRecord]:
        self.batches.append(len(plans))
        ended = []
        for plan in plans:
            pair, leg = divmod(PLANS.index(plan), 2)
            points = min(max(self._scores[pair] - leg, 0), 1) if self._scores[pair] != 1 else (1 - leg)
            ended.append(end(plan, {0.0: "old", 0.5: None, 1.0: "new"}[points]))
        return iter(random.Random(3).sample(ended, len(ended)))


def decide(scores: Sequence[float], n_pairs: int = 300) -> tuple[Comparison, list[MatchRecord], Venue, list[str]]:
    venue, said = Venue(scores), list[str]()
    found, records = play_until_sure(PLANS[: 2 * n_pairs], BEGUN, venue.play, said.append)
    return found, records, venue, said


def test_the_stronger_one_is_found_whichever_it_is() -> None:
    first, second = decide(STRONG)[0], decide([2 - score for score in STRONG])[0]

    assert (first.better, first.forward.verdict) == ("new", Verdict.ACCEPTED)
    assert (second.better, second.backward.verdict) == ("old", Verdict.ACCEPTED)
    assert first.forward == second.backward
    assert first.says().startswith("new is better than old: 0.66 +- 0.09 after ")
    assert second.says().startswith("old is better than new: 0.66 +- 0.09 after ")


def test_equals_are_found_to_be_equal() -> None:
    found = decide(EVEN)[0]

    assert (found.better, found.are_equal, found.is_decided) == (None, True, True)
    assert found.says().startswith("neither new nor old is better by 50 Elo: new scores 0.50 +- ")


def test_what_is_not_decided_is_said_to_be_so() -> None:
    found, records, venue, _ = decide(EVEN, n_pairs=20)

    assert (found.is_decided, len(records), venue.batches) == (False, 40, [32, 8])
    assert found.says().startswith(
        "it is not shown who is better, new or old: new scores 0.50 +- 0.14 after 20 pairs; allow more"
    )


def test_it_stops_at_the_deciding_pair_and_counts_no_match_beyond() -> None:
    found, records, venue, said = decide(STRONG)

    n_pairs = len(found.scores)
    assert found.scores == tuple(islice(cycle(STRONG), n_pairs))
    assert [record.plan for record in records] == PLANS[: 2 * n_pairs]
    assert sum(venue.batches[:-1]) < 2 * n_pairs <= sum(venue.batches) < 600
    assert not BEGUN.add(found.scores[:-1]).is_decided
    assert len(said) == len(venue.batches) - 1


def test_the_deciding_pair_does_not_depend_on_the_batches() -> None:
    for scores in (STRONG, EVEN):
        played = list(islice(cycle(scores), 300))
        at_once, by_batches = BEGUN.add(played), BEGUN
        for begin in range(0, 300, 11):
            by_batches = by_batches.add([] if by_batches.is_decided else played[begin : begin + 11])

        assert at_once.is_decided
        assert at_once == by_batches


def test_a_test_that_has_said_no_does_not_look_again() -> None:
    """Who looked again would be right less often than it says."""
    found = BEGUN.add(list(islice(cycle(STRONG), 60)))

    assert found.backward.verdict is Verdict.REJECTED
    assert found.backward.n_pairs < found.forward.n_pairs == len(found.scores)


def test_progress_says_the_score_and_how_far_each_test_is() -> None:
    low, high = BEGUN.forward.bounds
    found = BEGUN.add([1.5, 1.0, 2.0, 0.5])

    assert found.progress() == (
        f"4 pairs: new scores 0.62 +- 0.32; log likelihood ratio, yes from {high:+.2f} on, no from {low:+.2f}: "
        f"new better {found.forward.llr:+.2f}, old better {found.backward.llr:+.2f}"
    )
    assert BEGUN.add(STRONG * 10).progress().endswith("old better no")


def test_the_command_plays_until_it_is_sure(here: Run) -> None:
    arguments = ("play", "rush", "random", "--until-sure", "--margin", 200, "--seed", 1, "--workers", 1, "--set", "tick_limit=40")
    found, text = json.loads(here(*arguments, "--json").stdout), here(*arguments)

    test = found["until_sure"]
    assert (test["verdict"], test["better"], test["margin_elo"]) == ("better", "rush", 200)
    assert test["llr"]["rush"] >= test["llr_high"] > 0 > test["llr_low"]
    assert found["wins"] + found["draws"] + found["losses"] == 2 * found["pairs"] <= 64
    assert text.stdout.splitlines()[-1] == test["says"]
    assert test["says"].startswith(f"rush is better than random: {found['score']:.2f}")


def test_two_files_of_one_name_are_told_apart(here: Run, tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    for path in (tmp_path / "mybot.py", tmp_path / "old" / "mybot.py"):
        path.write_text("def act(observation):\n    return [2 for _ in observation.units]\n")
    bots = tmp_path / "mybot.py", tmp_path / "old" / "mybot.py"
    done = here("play", *bots, "--until-sure", "--pairs", 2, "--seed", 1, "--workers", 1, "--set", "tick_limit=2")
    said = done.stdout.splitlines()

    assert said[-2] == f"mybot-2 is {tmp_path / 'old' / 'mybot.py'}"
    assert said[-1].startswith("it is not shown who is better, mybot or mybot-2: mybot scores 0.50 +- 0.78 after 2 pairs; ")


@pytest.mark.parametrize("arguments", [("--margin", 50), ("--margin", 0, "--until-sure"), ("--margin", 1e5, "--until-sure")])
def test_a_margin_that_means_nothing_is_refused(here: Run, arguments: tuple[object, ...]) -> None:
    assert here("play", "rush", "patrol", *arguments).returncode == 2
