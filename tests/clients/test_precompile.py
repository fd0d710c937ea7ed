"""What a client compiles before it asks for a seat."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from policies.each_seat import EachSeatFactory
from policies.precompile import fighter_kernels, precompile
from policies.registry import OWN, shipped

FIRST_MATCH = """
import os, sys
import numpy as np
from arena.game.engine import BatchedGame, warm
from arena.game.keys import MatchKeys
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
ruleset = load_rules("paper")
warm(ruleset)
os.environ["NUMBA_CACHE_DIR"] = sys.argv[2]  # an empty one, for fighters
from arena.jit import load_kernels
from policies.precompile import precompile
from policies.registry import load

fighter = load(sys.argv[1])
precompile(fighter)

def play():
    games = BatchedGame(ruleset, 1)
    games.start([0], [MatchKeys(map_key=bytes(32), match_key=bytes(32))])
    orders = np.zeros(games.state.cell.shape, np.int8)
    sides = {team: fighter(ruleset, team, 1) for team in Team}
    for side in sides.values():
        side.start(np.zeros(1, np.intp))
    for _ in range(4):
        for team, seen in games.observe().items():
            sides[team].act(seen, np.split(orders, [games.n_units[Team.BLUE]], 1)[team])
        games.step(orders)

print("ready" if load_kernels(play) else "would compile within its first match")
"""


@pytest.mark.parametrize("fighter", ["champion", "patrol"])
def test_on_a_new_machine_all_is_compiled_before_the_first_match(fighter: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FIRST_MATCH, fighter, str(tmp_path)],
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )

    assert (done.returncode, done.stdout) == (0, "ready\n"), done.stderr


def test_every_fighter_of_ours_has_its_kernels() -> None:
    names = [*OWN, *shipped()]

    assert {kernel.name for kernel in fighter_kernels([*names, "bot.py", "exec:cat", "human"])} == set(names)


def test_a_strangers_bot_is_left_alone() -> None:
    def refuse() -> object:
        raise AssertionError("it was made")

    precompile(EachSeatFactory(refuse))


def test_what_a_family_of_fighters_shares_is_compiled_by_its_first() -> None:
    stages = {kernel.name: kernel.stage for kernel in fighter_kernels(["turtle", "rush", "squad", "patrol", "champion"])}

    assert stages == {"turtle": 0, "rush": 0, "squad": 1, "patrol": 1, "champion": 1}
