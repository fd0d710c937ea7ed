"""A fighter as it is tried: one match against another fighter, or against nobody, turn by turn, each of them timed."""

import time
from dataclasses import dataclass

import numpy as np

from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.policy import BatchFactory, Faults, MatchResult
from arena.records.replay import match_result

_FIRST = np.zeros(1, np.intp)


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """One answer of a fighter."""

    tick: int
    took_s: float
    orders: tuple[int, ...]
    """As it gave them; -1 for each unit where there is no legal answer."""
    faults: Faults
    """Of this turn; of `Trial.start`, too, in the first."""


class Trial:
    """One match of a fighter that is tried.

    Parameters
    ----------
    opponent
        Who plays the other side; nobody without one: all its units stay.
    name
        What the match is called where the fighter prints something.
    """

    def __init__(
        self,
        make: BatchFactory,
        ruleset: Ruleset,
        team: Team,
        keys: MatchKeys,
        opponent: BatchFactory | None = None,
        name: str = "trial",
    ) -> None:
        self.team = team
        self._fighter = make(ruleset, team, 1)
        self._fighter.name_match(0, name)
        self._opponent = None if opponent is None else opponent(ruleset, team.other, 1)
        self._games = BatchedGame(ruleset, 1)
        self._games.start([0], [keys])
        self._orders = {side: np.zeros((1, n_units), np.int8) for side, n_units in self._games.n_units.items()}

    def start(self) -> Faults:
        """Tell both that the match begins, and return what went wrong with that."""
        self._fighter.start(_FIRST)
        if self._opponent is not None:
            self._opponent.start(_FIRST)
        return self._fighter.take_faults(0)

    def play_turn(self) -> Turn:
        """Ask for a turn, and play it."""
        seen, tick = self._games.observe(), self.result.ticks
        own, other = self._orders[self.team], self._orders[self.team.other]
        own[:] = other[:] = 0
        if self._opponent is not None:
            self._opponent.act(seen[self.team.other], other)
        begun_s = time.perf_counter()
        self._fighter.act(seen[self.team], own)
        took_s = time.perf_counter() - begun_s
        orders = tuple(own[0].tolist())
        self._games.play(np.maximum(np.concatenate([self._orders[side] for side in Team], axis=1), 0))
        return Turn(tick=tick, took_s=took_s, orders=orders, faults=self._fighter.take_faults(0))

    @property
    def is_over(self) -> bool:
        """Whether the match has ended."""
        return self._games.has_ended(0)

    @property
    def result(self) -> MatchResult:
        """How the match ended, or stands."""
        return match_result(self._games, 0)

    def end(self) -> Faults:
        """Tell both how the match ended, or that it is void, and return what went wrong with that."""
        result = self.result
        if not self.is_over:
            result = MatchResult(
                ending=Termination.VOID, winner=None, score=result.score, ticks=result.ticks, reason="it was cut short"
            )
        self._fighter.end(0, result.seen_by(self.team))
        if self._opponent is not None:
            self._opponent.end(0, result.seen_by(self.team.other))
        return self._fighter.take_faults(0)
