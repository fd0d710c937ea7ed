"""A league of two ends at the pair that decides, whatever happens on the way."""

import json
import random
import subprocess
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from outcomes import ended

from arena.game.types import Team
from arena.records.plan import MatchPlan
from tournaments.league.file import parse_league
from tournaments.league.league import League
from tournaments.league.schedule import plan_league
from tournaments.outcome import Outcome
from tournaments.ratings.sprt import Sprt, Verdict
from tournaments.reports.formats import to_json, to_markdown, to_text
from tournaments.reports.page import to_html
from tournaments.reports.report import Report, make_report
from tournaments.running.duel import LEAST_BATCH, Duel, judge, next_batch
from tournaments.running.scheduler import Folders, Scheduler
from tournaments.store.store import Store
from tournaments.venues.setting import VenueSetting

Arena = Callable[..., subprocess.CompletedProcess[str]]
BOUNDS = {"elo0": 0.0, "elo1": 100.0, "alpha": 0.05, "beta": 0.05}
FACTS = {"challenger": "rush", "entries": {"patrol": "patrol", "rush": "rush"}, "sprt": BOUNDS}
POINTS = (0.0, 0.5, 1.0)


def league(n_pairs: int = 200) -> League:
    return parse_league(
        f'seed = 1\npairs = {n_pairs}\npairing = "sprt"\nentries = ["rush", "patrol"]\n[sprt]\nelo1 = 100', "l", Path()
    )


def end(plan: MatchPlan, points: float) -> Outcome:
    """Return a match that brought `rush` so many points."""
    rush = Team.BLUE if plan.blue == "rush" else Team.RED
    return ended(plan.identity, plan.blue, plan.red, {0.0: rush.other, 0.5: None, 1.0: rush}[points])


def venue(strength: float, *, seed: int = 0) -> Callable[[VenueSetting, Sequence[MatchPlan]], Iterator[Outcome]]:
    """Return a venue on which `rush` wins this share of its matches; matches end in any order."""

    def play(_: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
        shuffled = list(plans)
        random.Random(seed).shuffle(shuffled)
        for plan in shuffled:
            yield end(plan, float(random.Random(plan.identity).random() < strength))

    return play


def run(
    folder: Path, play: Callable[..., Iterator[Outcome]], *, n: int | None = None, of: League | None = None
) -> tuple[Report, int]:
    """Run the league, or only until `n` more matches are stored; return its report, and how many matches are stored."""
    folder.mkdir(exist_ok=True)
    with Store(str(folder / "arena.db")) as store, Scheduler(of or league(), store, Folders(data=folder)) as scheduler:
        for _ in islice(scheduler.run(play), n):
            pass
        outcomes = store.outcomes(scheduler.row)
        return make_report(scheduler.row, outcomes, n_draws=10), len(outcomes)


def without_wall(report: Report) -> str:
    facts = json.loads(to_json(report))
    del facts["wall"]
    return json.dumps(facts)


def test_it_stops_at_the_first_pair_that_decides_and_says_what_was_played_beyond(tmp_path: Path) -> None:
    report, n_stored = run(tmp_path, venue(0.9))

    assert isinstance(report.duel, Duel)
    test = report.duel.sprt
    assert test.verdict is Verdict.ACCEPTED
    assert Sprt(**BOUNDS).run(_scores(report)[: test.n_pairs - 1]).verdict is Verdict.GOING_ON
    assert report.is_complete
    assert len(report.outcomes) == report.standings.n_matches == 2 * test.n_pairs
    assert n_stored == 2 * LEAST_BATCH
    assert report.duel.n_beyond == n_stored - 2 * test.n_pairs > 0
    assert f"rush is better than patrol: 100 Elo rather than 0, decided at pair {test.n_pairs}" in to_text(report)


def _scores(report: Report) -> list[float]:
    points = {outcome.identity: outcome.points("rush") for outcome in report.outcomes}
    scores: dict[str, float] = {}
    for identity, won in sorted(points.items()):
        pair = identity.split("/")[3]
        scores[pair] = scores.get(pair, 0.0) + won
    return list(scores.values())


def test_the_order_in_which_matches_end_changes_nothing(tmp_path: Path) -> None:
    one, other = (run(tmp_path / str(seed), venue(0.6, seed=seed))[0] for seed in (1, 2))

    assert without_wall(one) == without_wall(other)


@pytest.mark.parametrize("stops", [[1], [31, 1, 1], [33, 40], [5, 60]])
def test_however_it_was_stopped_it_ends_in_the_same_report(tmp_path: Path, stops: list[int]) -> None:
    undisturbed = run(tmp_path / "one", venue(0.65, seed=7))

    for number, n in enumerate(stops):
        run(tmp_path / "two", venue(0.65, seed=number), n=n)
    finished = run(tmp_path / "two", venue(0.65, seed=99))

    assert (without_wall(finished[0]), finished[1]) == (without_wall(undisturbed[0]), undisturbed[1])
    assert undisturbed[1] > 2 * LEAST_BATCH


def test_a_decided_league_plays_no_more(tmp_path: Path) -> None:
    run(tmp_path, venue(0.9))

    def refuse(*_: object) -> Iterator[Outcome]:
        raise AssertionError("it was decided")

    assert run(tmp_path, refuse)[0].is_complete
    assert run(tmp_path, refuse, of=league(300))[0].is_complete


def test_an_undecided_league_says_so_and_goes_on_with_more_pairs(tmp_path: Path) -> None:
    few, n_few = run(tmp_path, venue(0.57), of=league(10))
    many, _ = run(tmp_path, venue(0.57), of=league(2_000))
    at_once, _ = run(tmp_path / "other", venue(0.57), of=league(2_000))

    assert n_few == 20
    assert few.is_complete
    assert "it stays undecided whether rush is better than patrol, after all 10 pairs" in to_text(few)
    assert many.duel is not None
    assert many.duel.is_decided
    assert without_wall(many) == without_wall(at_once)


def test_a_pair_behind_a_gap_does_not_count() -> None:
    plans = plan_league(league(60), bytes(32))
    outcomes = [end(plan, 1.0) for plan in plans]
    gap = [outcome for outcome in outcomes if "/0003/rush-blue" not in outcome.identity]
    whole, broken = judge(FACTS, outcomes), judge(FACTS, gap)

    assert whole is not None
    assert broken is not None
    assert whole.is_decided
    assert not broken.is_decided
    assert broken.sprt.n_pairs == 3
    assert len(broken.outcomes) == len(gap)
    assert "not decided yet" in broken.verdict(60)


@given(st.permutations(range(40)), st.data())
def test_a_verdict_needs_no_more_than_the_pairs_up_to_it(order: list[int], data: st.DataObject) -> None:
    plans = plan_league(league(20), bytes(32))
    outcomes = [end(plan, data.draw(st.sampled_from(POINTS))) for plan in plans]
    found = judge(FACTS, [outcomes[number] for number in order])
    assert found is not None
    up_to = judge(FACTS, found.outcomes)

    assert up_to is not None
    assert up_to.sprt == found.sprt == Sprt(**BOUNDS).run(_pairs(outcomes))


def _pairs(outcomes: Sequence[Outcome]) -> list[float]:
    won = [outcome.points("rush") for outcome in outcomes]
    return [one + other for one, other in zip(won[::2], won[1::2], strict=True)]


def test_batches_are_the_same_wherever_a_league_was_stopped() -> None:
    plans = plan_league(league(400), bytes(32))
    done: set[str] = set()
    batches = []
    while batch := next_batch(plans, done):
        batches.append(batch)
        assert [plan.identity for plan in next_batch(plans, done | {plan.identity for plan in batch[:5]})] == [
            plan.identity for plan in batch[5:]
        ]
        done |= {plan.identity for plan in batch}

    assert [plan for batch in batches for plan in batch] == plans
    assert len(batches[0]) == 2 * LEAST_BATCH
    assert len(batches) < 20


def test_every_report_tells_the_test(tmp_path: Path) -> None:
    report, _ = run(tmp_path, venue(0.1))
    facts = json.loads(to_json(report))["sprt"]

    assert facts["verdict"] == "rejected"
    assert facts["llr"] <= facts["llr_low"]
    assert {name: facts[name] for name in BOUNDS} == BOUNDS
    assert sum(facts["pentanomial"]) == facts["pairs"] == len(report.outcomes) // 2
    for told in (to_text(report), to_markdown(report).replace("\\", ""), to_html(report, tmp_path / "a.html", tmp_path)):
        assert facts["says"] in told
        assert f"log likelihood ratio {facts['llr']:+.2f}" in told
        assert f"{facts['matches_beyond']} matches beyond the deciding pair are stored and do not count" in told


@pytest.mark.usefixtures("one_core")
def test_the_commands_run_a_test_to_its_end(here: Arena, tmp_path: Path) -> None:
    file, data = tmp_path / "duel.toml", tmp_path / "data"
    file.write_text('seed = 1\npairs = 100\npairing = "sprt"\nentries = ["rush", "random"]\n[sprt]\nelo1 = 100')

    ran = here("tournament", "run", file, "--venue", "local", "--data", data, "--json")
    status = here("tournament", "status", "--data", data, "--json")

    document, events = json.loads(ran.stdout), [json.loads(line) for line in ran.stderr.splitlines()]
    assert document["sprt"]["verdict"] == "accepted"
    assert json.loads(status.stdout)[0] == {"league": "duel", "entries": 2, "played": 32, "planned": 200, "complete": True}
    assert [event["event"] for event in events] == ["begin", *["match"] * 32, "end"]
    assert [event["played"] for event in events[1:-1]] == list(range(1, 33))
    assert all({"of", "per_s", "left_s", "identity", "ending", "winner"} <= event.keys() for event in events[1:-1])
