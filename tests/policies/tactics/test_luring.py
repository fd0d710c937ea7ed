"""Luring, in whole matches against the fighter that stays at home."""

import numpy as np
import pytest

from arena.game.keys import secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import load
from arena.local.venue import play_batch
from arena.policy import Orders
from policies.heuristics.defend import Defend
from policies.heuristics.role_team import RoleTeam
from policies.tactics.roles import ATTACK, DECOY, WAIT
from tournaments.fixture import plan_fixture

PAPER = load("paper")
N_PAIRS = 30


class Watched(RoleTeam):
    """Notes where decoys stand, who runs while others wait, and which decoys are gone a tick later."""

    def __init__(self, *words: object) -> None:
        super().__init__(*words)  # type: ignore[arg-type]
        self.n_seen = self.n_gone = self.n_races = 0
        self.lost_races: list[tuple[int, int]] = []
        self._decoy = np.full(len(self.belief.tick), -1)

    def act(self, sight: Observations, orders: Orders) -> None:
        (seat,) = range(len(sight.tick))
        if self._decoy[seat] >= 0:
            self.n_gone += not sight.alive[seat, self._decoy[seat]]
        super().act(sight, orders)
        role = self.plan.role
        self._decoy[seat] = int(np.flatnonzero(role == DECOY)[0]) if DECOY in role else -1
        self.n_seen += DECOY in role
        if DECOY in role or WAIT in role:
            to_flag = self.belief.to_flag[seat]
            walkers = (sight.enemy_cell[seat] >= 0) & (sight.enemy_flies[seat] == 0)
            guards = to_flag[sight.enemy_cell[seat][walkers]]
            for unit in np.flatnonzero(role == ATTACK):
                self.n_races += 1
                if len(guards) and to_flag[sight.cell[seat, unit]] > guards.min():
                    self.lost_races.append((int(unit), int(sight.tick[seat])))


@pytest.fixture(scope="module")
def watched() -> list[Watched]:
    """Play some matches one by one."""
    fighters: list[Watched] = []

    def make(*words: object) -> Watched:
        fighters.append(Watched(*words))
        return fighters[-1]

    for plan in plan_fixture("lure", "role_team", "defend", N_PAIRS, secret_from_seed(5)):
        if plan.blue == "role_team":
            assert list(play_batch(PAPER, [plan], make, Defend))
    return fighters


def test_decoys_show_themselves_and_are_seldom_caught(watched: list[Watched]) -> None:
    n_seen, n_gone = sum(one.n_seen for one in watched), sum(one.n_gone for one in watched)

    assert sum(one.n_seen > 0 for one in watched) > N_PAIRS / 3
    assert n_gone < n_seen / 50


def test_only_who_is_nearer_to_the_flag_than_every_guard_in_sight_runs(watched: list[Watched]) -> None:
    assert sum(one.n_races for one in watched) > N_PAIRS
    assert not [race for one in watched for race in one.lost_races]
