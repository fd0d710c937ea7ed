"""A board drawn as text as a game: the ruleset that it makes, and what a team is shown there."""

from collections.abc import Set
from typing import Any

from arena.game.board import Cell
from arena.game.engine import BatchedGame
from arena.game.keys import KEY_BYTES, MatchKeys
from arena.game.observation import NO_CLOCK_MS, Observation
from arena.game.rules import is_eliminated, score_of
from arena.game.ruleset import Ruleset, load
from arena.game.state import StateField, Trait
from arena.game.types import Team, Termination


def rules_on_board(text: str, rules: str | Ruleset, **changes: Any) -> Ruleset:
    """Return the rules of a match on a drawn board: those of a ruleset, or of the one with this name, with some changed."""
    return (load(rules) if isinstance(rules, str) else rules).with_({**changes, "board": text})


def observe_board(
    text: str,
    tick: int,
    team: Team,
    rules: str | Ruleset,
    fallen: Set[Cell],
    score: int | None,
    seed: int,
    clock_s: float | None,
    fog: bool | None,
) -> Observation:
    """Return what a team is shown on a drawn board; `Observation.from_board` says what all of it means."""
    ruleset = rules_on_board(text, rules, **({} if fog is None else {"fog": fog}))
    games = BatchedGame(ruleset, 1)
    games.start([0], [MatchKeys(map_key=bytes(KEY_BYTES), match_key=bytes(KEY_BYTES))])
    _remove(games, fallen)
    field = games.state.field[0]
    field[StateField.TICK] = _checked("tick", tick, 0, ruleset.tick_limit - 1)
    if score is not None:
        field[StateField.SCORE] = _checked("score", score, -100, 100) * (1 if team is Team.BLUE else -1)
    seen = games.observe()[team]
    seen.seed[0] = _checked("seed", seed, 0, 2**64 - 1)
    if clock_s is not None:
        seen.clock_ms[0] = round(1000 * _checked("clock_s", clock_s, 0, (NO_CLOCK_MS - 1) / 1000))
    return seen.seat(0, ruleset)


def _checked(name: str, value: Any, low: int, high: float) -> Any:
    if not low <= value <= high:
        raise ValueError(f"{name} is {value}; while a match is running, it is {low} to {high:.0f}")
    return value


def _remove(games: BatchedGame, fallen: Set[Cell]) -> None:
    """Let the units of a game's start on some cells have fallen, and the public facts follow."""
    state, side = games.state, games.ruleset.side
    cells = [divmod(cell, side) for cell in state.cell[0].tolist()]
    flies = games.tables.unit[:, Trait.FLIES].tolist()
    for row, column in sorted(fallen):
        if (row, column) not in cells or flies[cells.index((row, column))]:
            raise ValueError(f"no UGV is drawn at row {row}, column {column}, counted from 0; so none can have fallen there")
    for unit, cell in enumerate(cells):
        if cell in fallen:
            state.alive[0, unit] = False
            state.field[0, StateField.BLUE_LIVING + (unit >= games.n_units[Team.BLUE])] -= 1
    lost = {team: n_units - int(state.field[0, StateField.BLUE_LIVING + team]) for team, n_units in games.n_units.items()}
    for team, n_lost in lost.items():
        n_walkers = sum(not unit.flies for unit in games.ruleset.team(team))
        if is_eliminated(n_walkers, n_lost):
            raise ValueError(f"all UGVs of {team.name.lower()} have fallen, so the match is over and shows nothing more")
    state.field[0, StateField.SCORE] = score_of(int(Termination.RUNNING), 0, lost[Team.RED], lost[Team.BLUE])
