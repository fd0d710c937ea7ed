"""Who sits opposite the learner, or teaches it: is told how matches ended, and what goes wrong with it is told once."""

import json
import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small import PAPER, SETTINGS, make_seats

from arena.envs.batched import StepResult
from arena.errors import InputError
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.policy import BatchPolicy, MatchResult, Orders
from policies.networks.models import TeamNetwork, TeamShape
from policies.training.clone import Teacher, collect_lesson
from policies.training.opponents import Newest, Seated, check_learner
from policies.training.rollout import Results, collect

SMALL = TeamShape(channels=8, blocks=1, patch=5, local=8, hidden=16)


class Listener(BatchPolicy):
    """Stays, and writes down what it is told."""

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self.heard: list[tuple[int, MatchResult | None]] = []

    def act(self, observations: Observations, orders: Orders) -> None:
        orders[:] = 0

    def start(self, seats: np.ndarray) -> None:
        self.heard += [(seat, None) for seat in seats.tolist()]

    def end(self, seat: int, result: MatchResult) -> None:
        self.heard.append((seat, result))


def turn(has_ended: list[bool]) -> StepResult:
    n = len(has_ended)
    return StepResult(
        score=np.full(n, 20, np.int32), has_ended=np.array(has_ended), winner=np.full(n, int(Team.BLUE), np.int32),
        ending=np.full(n, int(Termination.TICK_LIMIT), np.int32), ticks=np.arange(n, dtype=np.int32) + 90,
    )  # fmt: skip


def test_a_fighter_is_told_how_its_matches_ended_before_the_next_ones_begin() -> None:
    listener = Listener(PAPER, Team.RED, 2)

    Seated("listener", listener, np.array([1, 3])).start(turn([True, False, False, True]))

    lost = MatchResult(ending=Termination.TICK_LIMIT, winner=Team.BLUE, score=-20, ticks=93)
    assert listener.heard == [(1, lost), (1, None)]


BOT = """
import json
from pathlib import Path
class Bot:
    def act(self, observation):
        raise ValueError("no idea")
    def end(self, result):
        with Path({log!r}).open("a") as file:
            print(json.dumps([result.score, result.ticks]), file=file)
"""


def test_a_bot_that_fails_is_told_of_once_and_hears_every_ending(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    log, bot = tmp_path / "log", tmp_path / "bot.py"
    bot.write_text(BOT.format(log=str(log)))
    results = Results()
    with caplog.at_level(logging.WARNING):
        seats = make_seats(replace(SETTINGS, games=4, opponents={str(bot): 1.0}))
        collect(seats, TeamNetwork(SMALL).eval(), 210, results)

    warned = [record.getMessage() for record in caplog.records if "no idea" in record.getMessage()]
    assert len(warned) == 1
    assert str(bot) in warned[0]
    heard = [json.loads(line) for line in log.read_text().splitlines()]
    assert sorted(ticks for _, ticks in heard) == sorted(results.ticks)
    assert len(heard) >= 8


def test_a_planner_that_is_cloned_hears_what_was_done_in_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    seats = make_seats(replace(SETTINGS, games=2, opponents={"patrol": 1.0}))
    teacher = Teacher("rush", seats)
    heard = []
    monkeypatch.setattr(teacher, "hear", lambda actions: heard.append(actions.copy()))
    done = []
    step = seats.step
    monkeypatch.setattr(seats, "step", lambda seen, actions, results: done.append(actions) or step(seen, actions, results))

    collect_lesson(seats, teacher, TeamNetwork(SMALL).eval(), 3, 0.5, np.random.default_rng(0))

    assert len(heard) == 3
    assert all(np.array_equal(one, other) for one, other in zip(heard, done, strict=True))


def test_who_wins_always_is_surely_good_and_not_surely_perfect() -> None:
    mean, low, high = Newest([1.0] * 40).interval()
    assert (mean, high) == (1.0, 1.0)
    assert 0.9 < low < 0.95
    assert Newest([1.0] * 39 + [0.0]).interval()[2] == 1.0


def test_one_network_does_not_play_both_of_two_teams_that_differ() -> None:
    other = PAPER.with_({"units": {"ugv": {"red": 3}, "uav": {"red": 3}}})

    with pytest.raises(InputError, match="the teams have other units, so one network cannot play both"):
        check_learner(other, {"self": 0.1, "rush": 0.9})
    check_learner(other, {"rush": 1.0})
    check_learner(PAPER, {"self": 1.0})
