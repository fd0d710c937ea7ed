"""How long a fighter thinks about its turns, in games of a batch under `paper`."""

import time

import numpy as np
from numpy.typing import NDArray

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from arena.policy import BatchFactory


class Games:
    """Games of a batch, begun anew as they end."""

    def __init__(self, blue: BatchFactory, red: BatchFactory, batch: int) -> None:
        ruleset = load_rules("paper")
        self._games = BatchedGame(ruleset, batch)
        self.fighters = {team: make(ruleset, team, batch) for team, make in ((Team.BLUE, blue), (Team.RED, red))}
        self._orders = {team: np.zeros((batch, self._games.n_units[team]), np.int8) for team in Team}
        self._n_begun = 0
        self._secret = secret_from_seed(0)

    def play_tick(self) -> int:
        """Play a tick, and return the nanoseconds that blue thought."""
        over = np.flatnonzero(self._games.is_over)
        if len(over):
            self._start(over)
        seen = self._games.observe()
        self.fighters[Team.RED].act(seen[Team.RED], self._orders[Team.RED])
        began_ns = time.perf_counter_ns()
        self.fighters[Team.BLUE].act(seen[Team.BLUE], self._orders[Team.BLUE])
        took_ns = time.perf_counter_ns() - began_ns
        self._games.step(np.concatenate([self._orders[Team.BLUE], self._orders[Team.RED]], axis=1))
        return took_ns

    def _start(self, over: NDArray[np.intp]) -> None:
        numbers = range(self._n_begun, self._n_begun + len(over))
        keys = [
            MatchKeys(map_key=derive_map_key(self._secret, "bench", n), match_key=derive_match_key(self._secret, f"bench/{n}"))
            for n in numbers
        ]
        self._n_begun += len(over)
        self._games.start(over, keys)
        for fighter in self.fighters.values():
            fighter.start(over)


def time_turns(
    blue: BatchFactory, red: BatchFactory, batch: int, n_turns: int, most_s: float, *, turn_time_s: float | None = None
) -> list[int]:
    """Return what each of blue's turns took, in nanoseconds: so many, or fewer once it has thought for `most_s`.

    Parameters
    ----------
    turn_time_s
        What blue is told that a turn may take; None where no clock runs.
    """
    games = Games(blue, red, batch)
    if turn_time_s is not None:
        games.fighters[Team.BLUE].set_turn_time(turn_time_s)
    taken: list[int] = []
    while len(taken) < n_turns and sum(taken) < most_s * 1e9:
        taken.append(games.play_tick())
    return taken
