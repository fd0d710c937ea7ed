"""What a policy hears of a pit's clock from the client that carries it."""

from pathlib import Path

import numpy as np
from pit_in_process import play_on_the_network

from arena.game.keys import secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team
from arena.policy import BatchPolicy
from tournaments.fixture import plan_fixture

N_TICKS, N_SLOTS = 3, 2
TURN_TIME_S = 30.0


class Listener(BatchPolicy):
    """Writes down what it is told."""

    heard: tuple[object, ...] = ()

    def set_turn_time(self, seconds: float) -> None:
        self.heard += (seconds,)

    def start(self, seats: np.ndarray) -> None:
        self.heard += ("start",)

    def act(self, observations: Observations, orders: np.ndarray) -> None:
        self.heard += ("act",)


def test_each_policy_of_a_client_hears_before_it_starts_what_one_of_its_seats_may_take_of_a_turn(
    port: int, tmp_path: Path
) -> None:
    listeners: list[Listener] = []

    def make(ruleset: Ruleset, team: Team, n_seats: int) -> Listener:
        listeners.append(Listener(ruleset, team, n_seats))
        return listeners[-1]

    plans = plan_fixture("clock", "ann", "bob", 1, secret_from_seed(3))
    rules = load("paper").with_({"tick_limit": N_TICKS})

    played = play_on_the_network(rules, plans, port, tmp_path, N_SLOTS, turn_time_s=TURN_TIME_S, load=lambda _: make)

    assert len(played) == 2
    assert [listener.heard for listener in listeners] == [(TURN_TIME_S / N_SLOTS, "start", *["act"] * N_TICKS)] * 4
