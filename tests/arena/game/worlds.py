"""Rulesets and states to test with: any that the rules allow, however unlikely, and states drawn as text.

A `BatchedGame` row and an `oracle.Match` hold the same facts; `to_match` and `facts_of` carry them across.
"""

from typing import Any

import numpy as np
import oracle
from hypothesis import strategies as st
from numpy.typing import NDArray

from arena.game.board import parse_board
from arena.game.engine import BatchedGame, lay_out
from arena.game.ruleset import MAX_UNITS, Ruleset, UnitType, load
from arena.game.state import StateField
from arena.game.types import FLAGS, HALVES, Code, Team, Termination

SEEDS = st.integers(0, 2**32 - 1)


@st.composite
def rulesets(draw: st.DrawFn, max_side: int = 64, equal_teams: bool = False) -> Ruleset:
    """Any ruleset: every switch, up to four types of unit, teams of up to 16; small boards most of the time."""
    side = 2 * draw(st.one_of(st.integers(4, min(6, max_side // 2)), st.integers(4, max_side // 2)))
    left = [MAX_UNITS, MAX_UNITS]
    units = []
    for number in range(draw(st.integers(0, 4))):
        flies = draw(st.integers(0, 2)) == 0
        blue = draw(st.integers(0, left[0]))
        red = min(blue, left[1]) if equal_teams else draw(st.integers(0, left[1]))
        left = [left[0] - blue, left[1] - red]
        units.append(
            UnitType(
                name=f"type{number}",
                step=draw(st.integers(0, 8)) if flies else draw(st.sampled_from([1, 1, 1, 1, 0])),
                sight=draw(st.one_of(st.integers(0, 5), st.integers(0, 100))),
                attack=draw(st.one_of(st.integers(0, 3), st.integers(0, 100))),
                strength=draw(st.one_of(st.integers(0, 3), st.integers(0, 1000))),
                flies=flies,
                blue=blue,
                red=red,
            )
        )
    switch = st.booleans()
    return Ruleset(
        name="any",
        side=side,
        tick_limit=draw(st.integers(1, 40)),
        fog=draw(st.sampled_from([True, True, False])),
        random_combat=draw(switch),
        attack_at_range=draw(switch),
        self_counts=draw(switch),
        obstacles=draw(switch),
        mirror=equal_teams and draw(switch),
        flag_in_back_third=draw(switch),
        units=tuple(units),
    )


def scatter(
    games: BatchedGame, row: int, rng: np.random.Generator, *, n_obstacles: int | None = None, fallen: float = 0.1
) -> None:
    """Set a row to any state at all: flags, obstacles and units anywhere, some fallen, any keys, within the tick limit."""
    rules, state = games.ruleset, games.state
    side = rules.side
    cells = rng.permutation(side * side)
    walks = ~np.array([unit.flies for team in Team for unit in rules.team(team)], bool)
    room = side * side - int(walks.sum()) - 2
    n_obstacles = int(rng.integers(0, min(room, side * side // 3) + 1)) if n_obstacles is None else n_obstacles
    first_is_left = bool(rng.integers(2))
    halves = np.where((np.arange(side * side) % side < side // 2) == first_is_left, *HALVES)
    state.ground[row, : side * side] = halves
    state.ground[row, cells[:n_obstacles]] = Code.OBSTACLE
    for team, cell in zip(Team, cells[n_obstacles : n_obstacles + 2], strict=True):
        state.ground[row, cell] = FLAGS[team]
        state.field[row, StateField.BLUE_FLAG + team] = cell
    standing = rng.permutation(cells[n_obstacles:])[: walks.sum()]
    state.cell[row, walks] = standing
    state.cell[row, ~walks] = rng.integers(0, side * side, (~walks).sum())
    state.alive[row] = np.where(walks, rng.random(len(walks)) >= fallen, True)
    state.key[row] = rng.integers(0, 2**32, (2, 2, 2), dtype=np.uint32)
    settle(games, row, tick=int(rng.integers(0, rules.tick_limit)))


def settle(games: BatchedGame, row: int, tick: int) -> None:
    """Make the public facts of a row fit its units: a running game at some tick."""
    fact, alive = games.state.field[row], games.state.alive[row]
    n_blue = games.n_units[Team.BLUE]
    living = [int(alive[:n_blue].sum()), int(alive[n_blue:].sum())]
    fact[StateField.TICK], fact[StateField.ENDING], fact[StateField.WINNER] = tick, Termination.RUNNING, -1
    fact[StateField.BLUE_LIVING], fact[StateField.RED_LIVING] = living
    lost = n_blue - living[0], games.n_units[Team.RED] - living[1]
    fact[StateField.SCORE] = max(-100, min(100, 10 * (lost[1] - lost[0])))


def to_match(games: BatchedGame, row: int) -> oracle.Match:
    """Return the oracle's reading of a row."""
    rules, state = games.ruleset, games.state
    side = rules.side
    ground = {divmod(cell, side): int(state.ground[row, cell]) for cell in range(side * side)}
    kinds = [(team, index, kind) for team in Team for index, kind in enumerate(rules.team(team))]
    units = [
        oracle.Unit(team, index, kind, divmod(int(cell), side), bool(alive))
        for (team, index, kind), cell, alive in zip(kinds, state.cell[row], state.alive[row], strict=True)
    ]
    keys = {(purpose, team): tuple(int(k) for k in state.key[row, purpose, team]) for purpose in range(2) for team in Team}
    fact = state.field[row]
    winner = None if fact[StateField.WINNER] < 0 else Team(fact[StateField.WINNER])
    return oracle.Match(
        rules,
        ground,
        units,
        keys,
        int(fact[StateField.TICK]),
        Termination(fact[StateField.ENDING]),
        winner,
        int(fact[StateField.SCORE]),
    )


def facts_of(games: BatchedGame, row: int) -> dict[str, Any]:
    """Return everything that a tick may change."""
    fact, state = games.state.field[row], games.state
    return {
        "cells": [divmod(int(cell), games.ruleset.side) for cell in state.cell[row]],
        "alive": [bool(alive) for alive in state.alive[row]],
        "tick": int(fact[StateField.TICK]),
        "ending": int(fact[StateField.ENDING]),
        "winner": int(fact[StateField.WINNER]),
        "score": int(fact[StateField.SCORE]),
        "living": [int(fact[StateField.BLUE_LIVING]), int(fact[StateField.RED_LIVING])],
        "events": [np.flatnonzero(flags[row]).tolist() for flags in games.events],
    }


def facts_of_match(match: oracle.Match) -> dict[str, Any]:
    return {
        "cells": [unit.cell for unit in match.units],
        "alive": [unit.alive for unit in match.units],
        "tick": match.tick,
        "ending": int(match.ending),
        "winner": -1 if match.winner is None else int(match.winner),
        "score": match.score,
        "living": [match.living(team) for team in Team],
        "events": [sorted(units) for units in (match.fought, match.fell, match.captured)],
    }


def copy_of(games: BatchedGame, rows: Any = slice(None)) -> BatchedGame:
    """Return games of their own in the same states."""
    state = type(games.state)(*(array[rows].copy() for array in games.state))
    twin = BatchedGame(games.ruleset, len(state.cell))
    for mine, theirs in zip(twin.state, state, strict=True):
        mine[:] = theirs
    twin._seat_keys[:] = games._seat_keys[:, rows]
    return twin


def bytes_of(games: BatchedGame) -> list[bytes]:
    return [array.tobytes() for array in games.state]


def random_orders(rng: np.random.Generator, games: BatchedGame) -> NDArray[np.int8]:
    """Orders that mostly move, and now and then are no order at all."""
    shape = games.state.cell.shape
    orders = rng.integers(0, 5, shape, dtype=np.int8)
    rubbish = rng.integers(-128, 128, shape, dtype=np.int8)
    return np.where(rng.random(shape) < 0.05, rubbish, orders).astype(np.int8)


# Drawn as text


def rules_for(board: str, base: str = "paper", **overrides: Any) -> Ruleset:
    """Return a shipped ruleset with a board of its own; `ugv` and `uav` override single values of a unit type."""
    units = {name: overrides.pop(name) for name in ("ugv", "uav") if name in overrides}
    return load(base).with_({"board": board, "units": units, **overrides})


def lay(rules: Ruleset, n_games: int = 1, seed: int = 0) -> BatchedGame:
    """Return games at the start of the ruleset's board, each with keys of its own."""
    games = BatchedGame(rules, n_games)
    board = parse_board(str(rules.board))
    lay_out(games.state, games.tables, 0, board, rules)
    for array in games.state:
        array[:] = array[0]
    games.state.key[:] = np.random.default_rng(seed).integers(0, 2**32, games.state.key.shape, dtype=np.uint32)
    return games


ARROWS = {"^": 1, ">": 2, "v": 3, "<": 4}


def march(drawn: str, n_games: int = 1, seed: int = 0, **overrides: Any) -> tuple[BatchedGame, list[str]]:
    """Play one tick of a board on which arrows are blue UGVs and their orders, U and u stay, and nobody hits anybody."""
    board = "".join("U" if c in ARROWS else c for c in drawn)
    rules = rules_for(board, ugv={"attack": 0}, **overrides)
    games = lay(rules, n_games, seed)
    letters = [c for c in drawn if c in ARROWS or c == "U"]
    orders = np.zeros(games.state.cell.shape, np.int8)
    orders[:, : len(letters)] = [ARROWS.get(c, 0) for c in letters]
    games.step(orders)
    return games, [picture(games, row) for row in range(n_games)]


def picture(games: BatchedGame, row: int = 0) -> str:
    """Return a row as text: what lies there, and above it the living units."""
    side = games.ruleset.side
    letters = {Code.OBSTACLE: "#", Code.BLUE_FLAG: "F", Code.RED_FLAG: "f"}
    cells = [letters.get(Code(code), ".") for code in games.state.ground[row, : side * side]]
    kinds = [(team, unit) for team in Team for unit in games.ruleset.team(team)]
    for (team, kind), cell, alive in reversed(list(zip(kinds, games.state.cell[row], games.state.alive[row], strict=True))):
        if alive:
            cells[cell] = ("A" if kind.flies else "U") if team is Team.BLUE else ("a" if kind.flies else "u")
    return "\n".join(" ".join(cells[row * side : (row + 1) * side]) for row in range(side))


def drawing(text: str) -> str:
    """Return a drawing as `picture` would write it."""
    return "\n".join(" ".join(line.split()) for line in text.strip().splitlines())


def interval(chance: float, n: int, sigmas: float = 5.0) -> tuple[float, float]:
    """Return where a frequency of `n` draws lies but once in two million times."""
    width = sigmas * (chance * (1 - chance) / n) ** 0.5
    return chance - width, chance + width


def is_near(frequency: float, chance: float, n: int) -> bool:
    low, high = interval(chance, n)
    return low <= frequency <= high
