"""Matches that only look like matches: for fighters, which may not know the rules, and must live on any ground."""

import signal
import sys
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from oracle import GO

from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, HALVES, Code, Team
from policies.training.allocator import KEEP
from tournaments.cli import main

PADDING = 3
"""Cells past the board that mean nothing, as `Observations` allows."""


class PretendedMatch:
    """Random ground, units that go where they are told, and random deaths. Everything follows from `seed`."""

    def __init__(self, ruleset: Ruleset, team: Team, seed: int) -> None:
        self.ruleset, self.team, self.tick = ruleset, team, 0
        self._rng = rng = np.random.default_rng(seed)
        side = ruleset.side
        columns = np.arange(side) < side // 2
        halves = np.where(np.broadcast_to(columns, (side, side)), HALVES[0], HALVES[1])
        halves = [halves, halves[:, ::-1], halves.T, rng.permuted(halves)][rng.choice(4, p=[0.4, 0.4, 0.1, 0.1])]
        self.ground = np.where(rng.random((side, side)) < rng.choice([0.0, 0.1, 0.4]), Code.OBSTACLE, halves).astype(np.int8)
        for flag in FLAGS:
            if rng.random() < 0.9:
                self.ground[tuple(rng.integers(side, size=2))] = flag
        self.units = {team: ruleset.team(team) for team in Team}
        free = np.flatnonzero(self.ground != Code.OBSTACLE)
        self.cell = {team: rng.choice(free if len(free) else [0], len(units)) for team, units in self.units.items()}
        self.alive = {team: np.ones(len(units), np.uint8) for team, units in self.units.items()}
        self.seed = rng.integers(2**64, dtype=np.uint64)

    def sight(self) -> NDArray[np.bool_]:
        """Return which cells the team sees."""
        side = self.ruleset.side
        rows, columns = np.indices((side, side))
        seen = np.full((side, side), not self.ruleset.fog)
        for unit, cell, alive in zip(self.units[self.team], self.cell[self.team], self.alive[self.team], strict=True):
            if alive:
                seen |= (rows - cell // side) ** 2 + (columns - cell % side) ** 2 <= unit.sight**2
        return seen

    def go(self, orders: NDArray[np.int8]) -> None:
        """Move the team as told and the enemy at random; let some fall."""
        enemy = self.team.other
        self._move(self.team, orders)
        self._move(enemy, self._rng.integers(5, size=len(self.units[enemy])))
        for alive in self.alive.values():
            alive &= self._rng.random(len(alive)) > 0.02
        self.seed = self._rng.integers(2**64, dtype=np.uint64)
        self.tick += 1

    def _move(self, team: Team, orders: NDArray[np.integer]) -> None:
        side = self.ruleset.side
        for index, unit in enumerate(self.units[team]):
            rows, columns = GO.get(int(orders[index]), (0, 0))
            for _ in range(unit.step * int(self.alive[team][index])):
                row, column = divmod(int(self.cell[team][index]), side)
                row, column = row + rows, column + columns
                if 0 <= row < side and 0 <= column < side and (unit.flies or self.ground[row, column] != Code.OBSTACLE):
                    self.cell[team][index] = row * side + column


def gather(matches: Sequence[PretendedMatch]) -> Observations:
    """Return what the team sees in each match."""
    ruleset, team = matches[0].ruleset, matches[0].team
    side, n, n_own = ruleset.side, len(matches), len(ruleset.team(team))
    seen = Observations.blank(
        ruleset,
        team,
        n,
        tick=np.array([match.tick for match in matches], np.int32),
        ground=np.full((n, side * side + PADDING), 99, np.int8),
        cell=np.array([match.cell[team] for match in matches], np.int16).reshape(n, n_own),
        alive=np.array([match.alive[team] for match in matches], np.uint8).reshape(n, n_own),
        living=np.array([[match.alive[t].sum() for t in (team, team.other)] for match in matches], np.int16),
        seed=np.array([match.seed for match in matches], np.uint64),
    )
    for seat, match in enumerate(matches):
        sight = match.sight()
        seen.ground[seat, : side * side] = np.where(sight, match.ground, Code.HIDDEN).ravel()
        enemies = zip(match.cell[team.other], match.alive[team.other], match.units[team.other], strict=True)
        in_sight = sorted((int(cell), ruleset.units.index(unit)) for cell, alive, unit in enemies if alive and sight.flat[cell])
        for place, (cell, kind) in enumerate(in_sight):
            seen.enemy_cell[seat, place] = cell
            seen.enemy_type[seat, place] = kind
            seen.enemy_flies[seat, place] = ruleset.units[kind].flies
    return seen


@pytest.fixture(scope="session")
def pretend() -> Callable[[Ruleset, Team, int], PretendedMatch]:
    return PretendedMatch


@pytest.fixture(scope="session")
def seen_in() -> Callable[[Sequence[PretendedMatch]], Observations]:
    return gather


@pytest.fixture
def train(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Run `arena train` in this process, which spares what a process of its own costs to start."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for name, value in KEEP.items():
        monkeypatch.setenv(name, value)  # without these, the command would start this process anew

    def run(*arguments: object) -> None:
        monkeypatch.setattr(sys, "argv", ["arena", "train", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        if ended.value.code:
            raise ended.value

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)
