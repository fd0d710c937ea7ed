"""Fight and judge: all fights on the same positions, then the fallen are removed, then the end is called."""

import numpy as np
from numpy.typing import NDArray

from arena.game.compiled import (
    ending_of,
    home_bonus,
    is_captured,
    is_eliminated,
    is_home,
    is_in_reach,
    own_strength,
    score_of,
    squared_distance,
    survives,
    survives_without_chance,
    winner_of,
)
from arena.game.philox import Purpose, philox
from arena.game.state import Event, Rule, Shape, State, StateField, Tables, Trait
from arena.game.types import Termination
from arena.jit import jit


@jit(inline=True)
def fight(game: int, shape: Shape, state: State, tables: Tables, work: NDArray[np.int64]) -> None:
    """Remove the units that fall this tick.

    Parameters
    ----------
    work
        int64, shape (4, 32): scratch memory.
    """
    if _is_contact(game, shape, state, tables):
        _fight(game, shape, state, tables, work)


@jit(inline=True)
def _is_contact(game: int, shape: Shape, state: State, tables: Tables) -> bool:
    """Whether any living walking unit has an enemy in range."""
    _, blue, blue_walkers, _, red_walkers = shape
    contact = False
    for one in range(blue_walkers):
        here = int(state.cell[game, one])
        for other in range(blue, blue + red_walkers):
            reach = max(tables.unit[one, Trait.REACH], tables.unit[other, Trait.REACH])
            near = is_in_reach(_squared(tables, here, int(state.cell[game, other])), reach)
            contact |= near & (state.alive[game, one] != 0) & (state.alive[game, other] != 0)
    return contact


@jit(inline=True)
def _squared(tables: Tables, one: int, other: int) -> int:
    """Return the squared Euclidean distance between two cells."""
    down = tables.place[one, 0] - tables.place[other, 0]
    right = tables.place[one, 1] - tables.place[other, 1]
    return int(squared_distance(down, right))


@jit()
def _fight(game: int, shape: Shape, state: State, tables: Tables, work: NDArray[np.int64]) -> None:
    _, blue, blue_walkers, _, red_walkers = shape
    tick = state.field[game, StateField.TICK]
    falls = work[0]
    for walker in range(blue_walkers + red_walkers):
        team = 0 if walker < blue_walkers else 1
        index = walker - team * blue_walkers
        unit = index + team * blue
        falls[walker] = 0
        if not state.alive[game, unit]:
            continue
        here = int(state.cell[game, unit])
        friends, enemies, is_in_range = 0, 0, False
        for other_walker in range(blue_walkers + red_walkers):
            other_team = 0 if other_walker < blue_walkers else 1
            other = other_walker + other_team * (blue - blue_walkers)
            if not state.alive[game, other]:
                continue
            strength = tables.unit[other, Trait.STRENGTH]
            if other == unit:
                friends += own_strength(strength, tables.rule[Rule.SELF_COUNTS])
            elif is_in_reach(_squared(tables, here, int(state.cell[game, other])), tables.unit[other, Trait.REACH]):
                if other_team == team:
                    friends += strength
                else:
                    enemies += strength
                    is_in_range = True
        if not is_in_range:
            continue
        state.event[game, Event.FOUGHT, unit] = tick + 1
        at_home = is_home(state.ground[game, here], team)
        if tables.rule[Rule.RANDOM_COMBAT]:
            word = int(np.int64(philox(state.key[game, Purpose.FIGHT, team], tick, index, Purpose.FIGHT, 0)[0]))
            falls[walker] = not survives(word, friends + home_bonus(at_home), enemies + home_bonus(not at_home))
        else:
            falls[walker] = not survives_without_chance(at_home)
    for walker in range(blue_walkers + red_walkers):
        if falls[walker]:
            team = 0 if walker < blue_walkers else 1
            unit = walker + team * (blue - blue_walkers)
            state.alive[game, unit] = 0
            state.event[game, Event.FELL, unit] = tick + 1
            state.field[game, StateField.BLUE_LIVING + team] -= 1


@jit(inline=True)
def judge(game: int, shape: Shape, state: State, tables: Tables) -> None:
    """Close the tick: count it, score it, and call the end if it has come.

    Source: paper, Eq. 4 and the text under it; what it leaves open, `docs/reference/rules.md`.
    """
    _, blue, blue_walkers, red, red_walkers = shape
    state.field[game, StateField.TICK] += 1
    blue_captures = _captures(game, state, 0, blue_walkers, state.field[game, StateField.RED_FLAG])
    red_captures = _captures(game, state, blue, blue + red_walkers, state.field[game, StateField.BLUE_FLAG])
    blue_lost = blue - state.field[game, StateField.BLUE_LIVING]
    red_lost = red - state.field[game, StateField.RED_LIVING]
    blue_falls, red_falls = is_eliminated(blue_walkers, blue_lost), is_eliminated(red_walkers, red_lost)
    captures, tick = blue_captures | red_captures, state.field[game, StateField.TICK]
    if captures:
        _mark_captures(game, shape, state)
    ending = ending_of(captures, blue_falls | red_falls, tick, tables.rule[Rule.TICK_LIMIT])
    achieved = int(blue_captures) - int(red_captures) if captures else int(red_falls) - int(blue_falls)
    score = score_of(ending, achieved, red_lost, blue_lost)
    state.field[game, StateField.SCORE] = score
    state.field[game, StateField.ENDING] = ending
    if ending != Termination.RUNNING:
        state.field[game, StateField.WINNER] = winner_of(score)


@jit(inline=True)
def _captures(game: int, state: State, first: int, last: int, flag: int) -> bool:
    captures = False
    for unit in range(first, last):
        captures |= is_captured(state.cell[game, unit], flag, state.alive[game, unit])
    return captures


@jit()
def _mark_captures(game: int, shape: Shape, state: State) -> None:
    _, blue, blue_walkers, _, red_walkers = shape
    for walker in range(blue_walkers + red_walkers):
        unit = walker if walker < blue_walkers else blue + walker - blue_walkers
        flag = state.field[game, StateField.RED_FLAG if walker < blue_walkers else StateField.BLUE_FLAG]
        if is_captured(state.cell[game, unit], flag, state.alive[game, unit]):
            state.event[game, Event.CAPTURED, unit] = state.field[game, StateField.TICK]
