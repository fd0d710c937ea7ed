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


A_PLANNER_S_MATCH = """
import sys
import numpy as np
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from numba.core.dispatcher import Dispatcher
from policies.precompile import precompile
from policies.registry import load

def loaded():
    modules = [module for name, module in sys.modules.items() if name.startswith("policies.")]
    return {(name, str(one)) for module in modules for name, found in vars(module).items()
            if isinstance(found, Dispatcher) for one in found.signatures}

ruleset = load_rules("paper")
planner = load(sys.argv[1])
precompile(planner)
before = loaded()
planner.settings = {"is_sure": -1e9}  # it plays what it has found
games = BatchedGame(ruleset, 1)
games.start([0], [MatchKeys(map_key=bytes(32), match_key=bytes(32))])
orders = np.zeros(games.state.cell.shape, np.int8)
side = planner(ruleset, Team.BLUE, 1)
side.start(np.zeros(1, np.intp))
for _ in range(3):
    side.act(games.observe()[Team.BLUE], orders[:, : games.n_units[Team.BLUE]])
    games.step(orders)
print(len(before) > 0, *sorted(name for name, _ in loaded() - before))
"""


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("planner", ["planner-fast", "planner-deep"])
def test_a_planner_loads_no_kernel_when_it_first_leaves_its_blueprint(planner: str) -> None:
    """Its kernels take too long to compile for another empty cache."""
    done = subprocess.run(
        [sys.executable, "-c", A_PLANNER_S_MATCH, planner], capture_output=True, text=True, timeout=300, check=False
    )

    assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr


@pytest.mark.parametrize("fighter", ["champion", "patrol"] if os.environ.get("ARENA_TEST_SIZE") == "full" else ["patrol"])
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


def test_planners_are_compiled_once_after_the_scripts_whose_belief_they_call() -> None:
    kernels = {kernel.name: kernel for kernel in fighter_kernels(["planner", "planner-fast", "turtle"])}
    [alone] = fighter_kernels(["planner-fast"])

    assert {name: kernel.stage for name, kernel in kernels.items()} == {"turtle": 0, "planner": 1, "planner-fast": 2}
    assert kernels["planner-fast"].seconds < 1 < kernels["turtle"].seconds
    assert alone.stage == 0
    assert alone.seconds == kernels["planner"].seconds + kernels["turtle"].seconds
