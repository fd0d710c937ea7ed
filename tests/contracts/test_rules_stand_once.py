"""Each rule of a tick stands in `arena.game.rules` alone: change it there, and everybody follows.

Each mutant runs in a process of its own, uncompiled: a rule that is changed before anything else is imported is changed for all.
Whoever still held a copy of a rule would give the old answer.
"""

import inspect
import json
import os
import subprocess
import sys
from functools import cache

import pytest

from arena.game import compiled, rules

PROBE = """
import json, sys
import numpy as np
from arena.game import bits
bits.lowest_bit = lambda word: (int(word) & -int(word)).bit_length() - 1  # what LLVM has, where nothing is compiled
bits.popcount = lambda word: int(word).bit_count()
from arena.game import rules
exec(sys.argv[1])
from arena.display.frame import describe_rules
from arena.errors import BoardError
from arena.game.board import parse_board
from arena.game.engine import BatchedGame, lay_out
from arena.game.kernel import step
from arena.game.observation import find_legal_actions
from arena.game.ruleset import UnitType, load
from arena.game.types import Team
from clients.human.routes import Routes, lead
from policies.belief.belief import make_belief
from policies.belief.bitrows import low_bits
from policies.belief.memory import Sight
from policies.belief.team_rules import team_rules
from policies.tactics.moves import is_open
from policies.tactics.odds import can_hit, weigh

def play(board, orders, **changes):
    ruleset = load("paper").with_({"board": board, **changes})
    games = BatchedGame(ruleset, 1)
    lay_out(games.state, games.tables, 0, parse_board(board), ruleset)
    step(games.state, np.array([orders], np.int8), games.tables, np.zeros((4, 32), np.int64), True)
    return games

def odds_of_falling(cell, at):
    ruleset = load("paper").with_({"side": 4, "units": {"ugv": {"blue": 1, "red": 1}, "uav": {"blue": 0, "red": 0}}})
    known, belief = team_rules(ruleset, Team.BLUE), make_belief(ruleset, Team.BLUE, 1)
    belief.enemy_half[0, :] = low_bits(4) & ~low_bits(2)
    one = np.ones((1, 1), np.int16)
    sight = Sight(np.zeros((1, 16), np.int8), cell * one, one, at * one, 0 * one, 0 * one, one[0], one, one[0], one[0])
    return weigh(0, 0, cell, sight, belief, known, np.array([cell]), np.zeros((1, 2)))[0]

def is_playable(board):
    try:
        return bool(parse_board(board))
    except BoardError:
        return False

wall, meet, flag = "F..f\\n.U#.\\n....\\nu...", "F..f\\n..U.\\n....\\n..u.", "F.Uf\\n....\\n....\\nu..."
ground = parse_board(wall).ground.reshape(1, -1)
known = team_rules(load("paper"), Team.BLUE)
met = play(meet, [0, 0], random_combat=False)
chance = play(meet, [0, 0])
captured = play(flag, [2, 0]).state.field[0]
ugv = describe_rules(load("paper"))["kinds"]["ugv"]
routes = Routes(4)
routes.learn(ground.reshape(4, 4))
print(json.dumps({
    "step into a wall": int(play(wall, [2, 0]).state.cell[0, 0]),
    "legal into a wall": bool(find_legal_actions(ground, 4, np.array([[5]]), np.ones((1, 1)), np.zeros(1))[0, 0, 2]),
    "a script's way into a wall": bool(is_open(ground, 0, 4, 1, 1, 2, 0)),
    "a person's way into a wall": len(routes.find(UnitType(name="u", step=1, sight=1), (1, 1), (1, 2), ())[0]),
    "a board without a way": is_playable("F.#f\\n.U##\\n....\\nu..."),
    "step to the edge": int(play("F..f\\n..U.\\n....\\nu...", [2, 0]).state.cell[0, 0]),
    "a person's step to the edge": lead((2, 2), 2, 1, 4),
    "legal to the edge": bool(find_legal_actions(ground, 4, np.array([[10]]), np.ones((1, 1)), np.zeros(1))[0, 0, 2]),
    "a script's way to the edge": bool(is_open(ground, 0, 4, 2, 2, 2, 0)),
    "reach of a walker": [int(met.tables.unit[0, 2]), int(known.reach[0]), ugv["reach"]],
    "who falls by place": met.state.alive[0].tolist(),
    "an enemy at the edge of reach": can_hit(0, 0, 2, known),
    "who falls by chance": chance.state.alive[0].tolist(),
    "odds at home": odds_of_falling(4, 5),
    "odds away": odds_of_falling(7, 6),
    "seen from a corner": int(met.tables.disc[0, 0, 0]),
    "ending": captured[1:4].tolist(),
}))
"""
WAYS = {
    "step into a wall", "legal into a wall", "a script's way into a wall", "a person's way into a wall", "a board without a way",
}  # fmt: skip
EDGE = {"step to the edge", "a person's step to the edge", "legal to the edge", "a script's way to the edge", "ending"}
FIGHTS = {"who falls by place", "who falls by chance"}
REACHED = {"an enemy at the edge of reach", *FIGHTS}
ODDS = {"odds at home", "odds away"}


@cache
def probe(mutant: str) -> dict[str, object]:
    """Return what everybody says of a few small boards under a mutant of the rules."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", PROBE, mutant], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, object] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize(
    ("mutant", "changed"),
    [
        ("rules.can_enter = lambda code, flies: True | (code == 0)", WAYS),
        ("rules.is_on_board = lambda row, column, side: (row >= 0) & (row < side) & (column >= 0) & (column < side - 1)", EDGE),
        ("rules.reach_of = lambda attack, at_range, flies: 3", {"reach of a walker", *REACHED}),
        ("rules.is_in_reach = lambda squared, reach: squared < reach", REACHED),
        (
            "rules.squared_distance = lambda down, right: 9 * (down**2 + right**2)",
            {"seen from a corner", *ODDS, *REACHED},
        ),
        ("rules.is_home = lambda code, team: code != team", FIGHTS),
        ("rules.HOME_BONUS = -1", {"who falls by chance", *ODDS}),
        ("rules.own_strength = lambda strength, counts: 10**6", {"who falls by chance", *ODDS}),
        ("rules.survives = lambda word, force, against: False", {"who falls by chance"}),
        ("rules.odds = lambda force, against: 2.0", ODDS),
        ("rules.survives_without_chance = lambda is_home: True", {"who falls by place"}),
        ("rules.is_in_sight = lambda squared, sight: squared < sight", {"seen from a corner"}),
        ("rules.is_captured = lambda cell, flag, alive: False", {"ending"}),
        ("rules.score_of = lambda ending, achieved, theirs, ours: -5", {"ending"}),
        ("rules.winner_of = lambda score: 1", {"ending"}),
    ],
)
def test_whoever_asks_follows_the_rules(mutant: str, changed: set[str]) -> None:
    before, after = probe(""), probe(mutant)

    assert {name for name in before if before[name] != after[name]} == changed


def test_the_compiled_rules_are_the_plain_ones() -> None:
    plain = {name: rule for name, rule in vars(rules).items() if inspect.isfunction(rule)}
    twins = {name: rule.py_func for name, rule in vars(compiled).items() if hasattr(rule, "py_func")}

    assert twins == {name: rule for name, rule in plain.items() if name != "reach_of"}


@pytest.mark.parametrize(("force", "against"), [(1, 1), (1, 2), (3, 1), (1000, 31)])
def test_odds_are_what_survival_comes_to_over_all_words(force: int, against: int) -> None:
    least, most = 0, 2**32
    while least < most:  # the first word that kills; survival goes down as the word goes up
        middle = (least + most) // 2
        least, most = (middle + 1, most) if rules.survives(middle, force, against) else (least, middle)

    assert rules.odds(force, against) == pytest.approx(least / 2**32, abs=2**-31)
