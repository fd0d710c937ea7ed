"""The kernels do what `docs/reference/rules.md` says, as `oracle.py` reads it: any ruleset, any state, any orders."""

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
import oracle
from hypothesis import given
from hypothesis import strategies as st
from worlds import SEEDS, facts_of, facts_of_match, random_orders, rulesets, scatter, to_match

from arena.game.engine import BatchedGame
from arena.game.ruleset import Ruleset, UnitType
from arena.game.types import Code, Team, Termination


@given(rulesets(), SEEDS, st.integers(1, 4))
def test_a_tick_is_what_the_design_says(rules: Ruleset, seed: int, n_games: int) -> None:
    rng = np.random.default_rng(seed)
    games = BatchedGame(rules, n_games)
    for row in range(n_games):
        scatter(games, row, rng)
    matches = [to_match(games, row) for row in range(n_games)]
    n_ticks = 4 if rules.side > 24 else 12
    assert_same_sight(games, matches)
    for tick in range(n_ticks):
        orders = random_orders(rng, games)
        games.step(orders)
        play_and_compare(games, matches, orders)
        if tick == n_ticks - 1:
            assert_same_sight(games, matches)


def test_in_a_crowd_everything_happens_and_as_the_design_says(size: Callable[[int, int], int]) -> None:
    """Thousands of ticks on boards so full that units meet at every one; what a tick holds is counted from outside."""
    rng = np.random.default_rng(20)
    happened: Counter[str] = Counter()
    for round_ in range(size(350, 9_000)):
        rules = crowded(rng, round_)
        games = BatchedGame(rules, 8)
        for row in range(games.n_games):
            scatter(games, row, rng, n_obstacles=int(rng.integers(0, 4)))
        matches = [to_match(games, row) for row in range(games.n_games)]
        for _ in range(8):
            orders = meddlesome_orders(rng, games)
            before = [facts_of(games, row) for row in range(games.n_games)]
            games.step(orders)
            play_and_compare(games, matches, orders)
            for match, facts, row_orders in zip(matches, before, orders.tolist(), strict=True):
                if facts["ending"] == Termination.RUNNING:
                    happened["tick"] += 1
                    happened.update(what_happened(match, facts["cells"], facts["alive"], row_orders))
        assert_same_sight(games, matches)

    assert happened["tick"] > size(8_000, 200_000)
    enough = size(15, 500)
    rare = {kind: happened[kind] for kind in KINDS if happened[kind] < enough}
    assert not rare, f"hardly happened: {rare}; in all: {happened}"


KINDS = (
    "swap",
    "claim",
    "claim of three",
    "claim across teams",
    "chain",
    "rotation",
    "blocked",
    "off the board",
    "into an obstacle",
    "rubbish",
    "over an obstacle",
    "shared by UAVs",
    "survived",
    "fell",
    "CAPTURE",
    "ELIMINATION",
    "TICK_LIMIT",
    "draw",
)


def crowded(rng: np.random.Generator, round_: int) -> Ruleset:
    """Return a ruleset that packs units onto a small board; each switch is on in half of the rounds."""
    side = int(rng.choice([4, 6, 8]))
    most = {4: 5, 6: 9, 8: 12}[side]
    kinds = (("foot", 1, most, False), ("eye", int(rng.integers(1, 4)), 4, True))
    foot, eye = (
        UnitType(
            name=name,
            step=step,
            sight=int(rng.integers(0, 5)),
            attack=int(rng.integers(0, 4)),
            strength=int(rng.integers(0, 4)),
            flies=flies,
            blue=int(rng.integers(1, most_of_it)),
            red=int(rng.integers(1, most_of_it)),
        )
        for name, step, most_of_it, flies in kinds
    )
    guard = UnitType(
        name="guard", step=0, sight=1, attack=1, strength=2, blue=int(rng.integers(0, 2)), red=int(rng.integers(0, 2))
    )
    switches = [bool(round_ >> bit & 1) for bit in range(4)]
    return Ruleset(
        name="crowd",
        side=side,
        tick_limit=int(rng.integers(6, 30)),
        fog=switches[0],
        random_combat=switches[1],
        attack_at_range=switches[2],
        self_counts=switches[3],
        units=(foot, eye, guard),
    )


def meddlesome_orders(rng: np.random.Generator, games: BatchedGame) -> np.ndarray:
    """Orders by which units of a row wander, whirl in rings of four, or all press towards one cell."""
    orders = random_orders(rng, games)
    rows, columns = np.divmod(games.state.cell, games.ruleset.side)
    n = games.n_games
    down, right = rng.integers(0, 2, (2, n, 1))
    whirl = np.array([[2, 3], [1, 4]])[(rows + down) % 2, (columns + right) % 2]
    to_row, to_column = rng.integers(0, games.ruleset.side, (2, n, 1)) - np.stack([rows, columns])
    press = np.where(rng.random(rows.shape) < 0.5, np.where(to_row < 0, 1, 3), np.where(to_column > 0, 2, 4))
    plan = rng.integers(0, 3, (n, 1))
    heeds = rng.random(rows.shape) < 0.9
    return np.where(heeds & (plan == 1), whirl, np.where(heeds & (plan == 2), press, orders)).astype(np.int8)


def play_and_compare(games: BatchedGame, matches: list[oracle.Match], orders: np.ndarray) -> None:
    for row, match in enumerate(matches):
        oracle.play(match, orders[row].tolist())
        assert facts_of(games, row) == facts_of_match(match), f"row {row}"


def assert_same_sight(games: BatchedGame, matches: list[oracle.Match]) -> None:
    """The true board, both teams' Table 2 boards, their grounds, and the enemies they can name."""
    side, n_cells = games.ruleset.side, games.ruleset.side**2
    grids, seen = games.grids(), games.observe()
    for row, match in enumerate(matches):
        assert games.truth(row).tolist() == oracle.truth(match)
        for team in Team:
            assert grids[team, row].tolist() == oracle.grid_seen(match, team)
            assert seen[team].ground[row, :n_cells].reshape(side, side).tolist() == oracle.ground_seen(match, team)
            spotted = zip(seen[team].enemy_cell[row].tolist(), seen[team].enemy_type[row].tolist(), strict=True)
            assert [(divmod(cell, side), kind) for cell, kind in spotted if cell >= 0] == oracle.enemies_seen(match, team)
            observation = seen[team].seat(row, games.ruleset)
            assert observation.grid.tolist() == oracle.grid_seen(match, team)
            assert observation.tick == match.tick
            assert observation.living == (match.living(team), match.living(team.other))
            assert observation.score == (match.score if team is Team.BLUE else -match.score)
            assert [(unit.row, unit.column) for unit in observation.units] == [u.cell for u in match.units if u.team is team]
            assert [unit.alive for unit in observation.units] == [u.alive for u in match.units if u.team is team]
            assert seen[team].enemy_flies[row].tolist()[: len(observation.enemies)] == [
                enemy.flies for enemy in observation.enemies
            ]
            assert [(enemy.type, enemy.flies) for enemy in observation.enemies] == [
                (games.ruleset.units[kind].name, games.ruleset.units[kind].flies) for _, kind in oracle.enemies_seen(match, team)
            ]


def what_happened(match: oracle.Match, cells: list[oracle.Cell], alive: list[bool], orders: Sequence[int]) -> set[str]:
    """Name what one tick held, from the positions before it, the orders, and what became of them."""
    kinds = set()
    side = match.rules.side
    walkers = [i for i, unit in enumerate(match.units) if alive[i] and not unit.kind.flies]
    holder = {cells[i]: i for i in walkers}
    wanted = {}
    for i in walkers:
        if orders[i] not in range(5):
            kinds.add("rubbish")
        elif orders[i] and match.units[i].kind.step:
            down, right = oracle.GO.get(int(orders[i]), (0, 0))
            wanted[i] = cells[i][0] + down, cells[i][1] + right
    for i, cell in wanted.items():
        moved = match.units[i].cell != cells[i]
        rivals = [j for j, other in wanted.items() if other == cell]
        if cell not in match.ground:
            kinds.add("off the board")
        elif match.ground[cell] == Code.OBSTACLE:
            kinds.add("into an obstacle")
        elif len(rivals) > 1 and any(match.units[j].cell == cell for j in rivals):
            kinds |= {"claim", "claim of three"} if len(rivals) > 2 else {"claim"}
            if len({match.units[j].team for j in rivals}) == 2:
                kinds.add("claim across teams")
        if cell in holder:
            if wanted.get(holder[cell]) == cells[i]:
                kinds.add("swap")
            elif not moved and len(rivals) == 1:
                kinds.add("blocked")
            elif moved:
                kinds.add("chain")
                if is_rotation(i, wanted, holder, match, cells):
                    kinds.add("rotation")
    flyers = [unit for unit in match.units if unit.kind.flies]
    if any(match.ground[unit.cell] == Code.OBSTACLE for unit in flyers):
        kinds.add("over an obstacle")
    if len({unit.cell for unit in flyers}) < len(flyers):
        kinds.add("shared by UAVs")
    if match.rules.random_combat and match.fought:
        kinds |= {"survived" if match.units[i].alive else "fell" for i in match.fought}
    if match.ending is not Termination.RUNNING:
        kinds |= {match.ending.name} | ({"draw"} if match.winner is None else set())
    assert all(0 <= unit.cell[0] < side and 0 <= unit.cell[1] < side for unit in match.units)
    return kinds


def is_rotation(
    first: int, wanted: dict[int, oracle.Cell], holder: dict[oracle.Cell, int], match: oracle.Match, cells: list[oracle.Cell]
) -> bool:
    """Whether a unit moved within a ring of units that each took the cell of the next."""
    unit = first
    for _ in range(len(cells)):
        if unit not in wanted or match.units[unit].cell == cells[unit] or wanted[unit] not in holder:
            return False
        unit = holder[wanted[unit]]
        if unit == first:
            return True
    return False
