"""`docs/reference/rules.md`, read slowly in plain Python: no numpy, no bits, no cleverness. What the kernels must equal.

It was written from the text of the rules, not from the kernels. Where the text leaves a choice open (which word of
Philox decides what, where a rectangle of even height has its centre), `arena.game.draw` decides.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from arena.game.ruleset import Ruleset, UnitType
from arena.game.types import Code, Team, Termination

BLUE, RED = Team.BLUE, Team.RED
MOVE, FIGHT, BOARD = 0, 1, 2
GO = {1: (-1, 0), 2: (0, 1), 3: (1, 0), 4: (0, -1)}
HALF = {BLUE: Code.BLUE_HALF, RED: Code.RED_HALF}
FLAG = {BLUE: Code.BLUE_FLAG, RED: Code.RED_FLAG}
UGV = {BLUE: Code.BLUE_UGV, RED: Code.RED_UGV}
UAV = {BLUE: Code.BLUE_UAV, RED: Code.RED_UAV}
Cell = tuple[int, int]
Key = tuple[int, int]


def philox(key: Key, counter: tuple[int, int, int, int]) -> tuple[int, int, int, int]:
    """Philox 4x32-10, as its paper gives it."""
    a, b, c, d = counter
    k0, k1 = key
    for _ in range(10):
        left, right = 0xD2511F53 * a, 0xCD9E8D57 * c
        a, b, c, d = (right >> 32) ^ b ^ k0, right % 2**32, (left >> 32) ^ d ^ k1, left % 2**32
        k0, k1 = (k0 + 0x9E3779B9) % 2**32, (k1 + 0xBB67AE85) % 2**32
    return a, b, c, d


@dataclass
class Unit:
    team: Team
    index: int
    """Within its team."""
    kind: UnitType
    cell: Cell
    alive: bool = True

    @property
    def walks(self) -> bool:
        return self.alive and not self.kind.flies


@dataclass
class Match:
    rules: Ruleset
    ground: dict[Cell, int]
    """What lies on each cell, units apart."""
    units: list[Unit]
    keys: dict[tuple[int, Team], Key]
    """Of each purpose and team."""
    tick: int = 0
    ending: Termination = Termination.RUNNING
    winner: Team | None = None
    score: int = 0
    """Blue's."""
    fought: set[int] = field(default_factory=set)
    """Units, by place in `units`, that had a fight in the last tick."""
    fell: set[int] = field(default_factory=set)
    """Units that it cost."""
    captured: set[int] = field(default_factory=set)
    """Units that took a flag in it."""

    def word(self, unit: Unit, purpose: int) -> int:
        return philox(self.keys[purpose, unit.team], (self.tick, unit.index, purpose, 0))[0]

    def living(self, team: Team) -> int:
        return sum(unit.alive for unit in self.units if unit.team is team)


# One tick, the same for both teams


def play(match: Match, orders: Sequence[int]) -> None:
    """Play one tick; `orders` are of blue's units, then of red's."""
    if match.ending is not Termination.RUNNING:
        return
    move(match, orders)
    fight(match)
    match.tick += 1
    judge(match)


def move(match: Match, orders: Sequence[int]) -> None:
    """1. Move, at once."""
    target: dict[int, Cell] = {}
    for i, (unit, order) in enumerate(zip(match.units, orders, strict=True)):
        if unit.kind.flies:
            if unit.alive:
                unit.cell = fly(match.rules.side, unit.cell, order, unit.kind.step)
        elif unit.alive:
            target[i] = walk(match, unit.cell, order, unit.kind.step)
    at = {i: match.units[i].cell for i in target}
    words = {i: match.word(match.units[i], MOVE) for i in target}
    changed = True
    while changed:
        changed = False
        for i in target:
            if target[i] == at[i]:
                continue
            faces_one_that_stays = any(at[j] == target[i] == target[j] for j in target if j != i)
            would_swap = any(at[j] == target[i] and target[j] == at[i] for j in target)
            rivals = [j for j in target if j != i and target[j] == target[i] and target[j] != at[j]]
            loses_the_cell = any((words[j], -j) > (words[i], -i) for j in rivals)
            if would_swap:
                for j in target:
                    if at[j] == target[i]:
                        target[j] = at[j]
            if faces_one_that_stays or would_swap or loses_the_cell:
                target[i] = at[i]
                changed = True
    for i, cell in target.items():
        match.units[i].cell = cell


def fly(side: int, cell: Cell, order: int, step: int) -> Cell:
    """Go up to `step` cells, stop at the border."""
    down, right = GO.get(order, (0, 0))
    for _ in range(step):
        beyond = cell[0] + down, cell[1] + right
        if 0 <= beyond[0] < side and 0 <= beyond[1] < side:
            cell = beyond
    return cell


def walk(match: Match, cell: Cell, order: int, step: int) -> Cell:
    """Name a target on the board and no obstacle, or stay."""
    down, right = GO.get(order, (0, 0)) if step else (0, 0)
    target = cell[0] + down, cell[1] + right
    return target if match.ground.get(target, Code.OBSTACLE) != Code.OBSTACLE else cell


def fight(match: Match) -> None:
    """2. Fight, at once: all on the same positions, then the fallen are removed."""
    match.fought.clear()
    match.fell.clear()
    for i, unit in enumerate(match.units):
        if not unit.walks:
            continue
        others = [other for other in match.units if other.walks and other is not unit and hits(match.rules, other, unit)]
        friends = [other for other in others if other.team is unit.team]
        enemies = [other for other in others if other.team is not unit.team]
        if not enemies:
            continue
        match.fought.add(i)
        is_home = match.ground[unit.cell] in (HALF[unit.team], FLAG[unit.team])
        if match.rules.random_combat:
            for_it = sum(other.kind.strength for other in friends) + (1 if is_home else 0)
            if match.rules.self_counts:
                for_it += unit.kind.strength
            against_it = sum(other.kind.strength for other in enemies) + (0 if is_home else 1)
            survives = survives_with(match.word(unit, FIGHT), for_it, against_it)
        else:
            survives = is_home
        if not survives:
            match.fell.add(i)
    for i in match.fell:
        match.units[i].alive = False


def hits(rules: Ruleset, one: Unit, other: Unit) -> bool:
    """Whether `one` has the cell of `other` in range."""
    squared = (one.cell[0] - other.cell[0]) ** 2 + (one.cell[1] - other.cell[1]) ** 2
    return squared <= one.kind.attack**2 if rules.attack_at_range else squared < one.kind.attack**2


def survives_with(word: int, for_it: int, against_it: int) -> bool:
    """F / (F + E), in integers."""
    return (word * (for_it + against_it)) >> 32 < for_it


def judge(match: Match) -> None:
    """3. Judge."""
    match.captured = {i for i, u in enumerate(match.units) if u.walks and match.ground[u.cell] == FLAG[u.team.other]}
    captured = {team: any(match.units[i].team is team for i in match.captured) for team in Team}
    eliminated = {team: is_eliminated(match, team) for team in Team}
    lost = {team: sum(not unit.alive for unit in match.units if unit.team is team) for team in Team}
    match.score = max(-100, min(100, 10 * (lost[RED] - lost[BLUE])))
    if any(captured.values()):
        match.ending = Termination.CAPTURE
        match.score = 100 * captured[BLUE] - 100 * captured[RED]
    elif any(eliminated.values()):
        match.ending = Termination.ELIMINATION
        match.score = 100 * eliminated[RED] - 100 * eliminated[BLUE]
    elif match.tick == match.rules.tick_limit:
        match.ending = Termination.TICK_LIMIT
    else:
        return
    match.winner = BLUE if match.score > 0 else RED if match.score < 0 else None


def is_eliminated(match: Match, team: Team) -> bool:
    ugvs = [unit for unit in match.units if unit.team is team and not unit.kind.flies]
    return bool(ugvs) and not any(unit.alive for unit in ugvs)


# What a team sees


def sight(match: Match, team: Team) -> set[Cell]:
    """Euclidean disc, union over living units; nothing blocks sight."""
    if not match.rules.fog:
        return set(match.ground)
    eyes = [unit for unit in match.units if unit.alive and unit.team is team]
    return {
        (row, column)
        for row, column in match.ground
        if any((row - eye.cell[0]) ** 2 + (column - eye.cell[1]) ** 2 <= eye.kind.sight**2 for eye in eyes)
    }


def ground_seen(match: Match, team: Team) -> list[list[int]]:
    seen, side = sight(match, team), match.rules.side
    return [[match.ground[r, c] if (r, c) in seen else Code.HIDDEN for c in range(side)] for r in range(side)]


def grid_seen(match: Match, team: Team) -> list[list[int]]:
    """The Table 2 board: UGV over UAV over flag over obstacle over half; of two UAVs in a cell, the viewer's own."""
    board = ground_seen(match, team)
    living = [unit for unit in match.units if unit.alive]
    below = [(u.cell, UAV[u.team]) for u in living if u.kind.flies and u.team is not team]
    own = [(u.cell, UAV[u.team]) for u in living if u.kind.flies and u.team is team]
    above = [(u.cell, UGV[u.team]) for u in living if not u.kind.flies]
    for (row, column), code in below + own + above:
        if board[row][column] != Code.HIDDEN:
            board[row][column] = code
    return board


def truth(match: Match) -> list[list[int]]:
    """The true Table 2 board: of two UAVs in a cell, the one of the lower index, blue's first."""
    board = [[match.ground[row, column] for column in range(match.rules.side)] for row in range(match.rules.side)]
    for flies, codes in ((True, UAV), (False, UGV)):
        for unit in reversed(match.units):
            if unit.alive and unit.kind.flies is flies:
                board[unit.cell[0]][unit.cell[1]] = codes[unit.team]
    return board


def enemies_seen(match: Match, team: Team) -> list[tuple[Cell, int]]:
    """(cell, type) of each enemy in sight, sorted."""
    seen = sight(match, team)
    return sorted(
        (u.cell, match.rules.units.index(u.kind)) for u in match.units if u.alive and u.team is not team and u.cell in seen
    )


# Boards


@dataclass
class Drawn:
    attempt: int
    ground: dict[Cell, int]
    flags: list[Cell]
    cells: list[list[Cell]]
    """Of each team's units."""


def draw(rules: Ruleset, key: Key) -> Drawn | None:
    """Draw again until every UGV reaches the enemy flag, at most 1,000 times."""
    return next(
        (drawn for attempt in range(1000) if (drawn := draw_once(rules, key, attempt)) and is_playable(rules, drawn)), None
    )


def draw_once(rules: Ruleset, key: Key, attempt: int) -> Drawn | None:
    """Return one board, or None if somebody found no free cell."""
    side = rules.side

    def words(item: int) -> tuple[int, int, int, int]:
        return philox(key, (attempt, item, BOARD, 0))

    def below(word: int, n: int) -> int:
        return word * n >> 32

    def turned(cell: Cell) -> Cell:
        return side - 1 - cell[0], side - 1 - cell[1]

    blue_is_left = below(words(0)[0], 2) == 0
    whose = {(r, c): BLUE if (c < side // 2) is blue_is_left else RED for r in range(side) for c in range(side)}
    ground: dict[Cell, int] = {cell: HALF[team] for cell, team in whose.items()}
    longest = max(1, side // 5)
    for item in range(1, 1 + (int(side**0.5) if rules.obstacles else 0)):
        row, column = (below(word, side) for word in words(item)[:2])
        high, wide = (1 + below(word, longest) for word in words(item)[2:])
        for cell in ground:
            if row - high <= cell[0] < row + high and column - wide <= cell[1] < column + wide:
                ground[cell] = Code.OBSTACLE
    if rules.mirror:
        for cell in ground:
            if whose[cell] is RED:
                ground[cell] = Code.OBSTACLE if ground[turned(cell)] == Code.OBSTACLE else HALF[RED]
    flags: list[Cell] = []
    cells: list[list[Cell]] = [[], []]
    free = [cell for cell in sorted(ground) if ground[cell] != Code.OBSTACLE]
    for team in Team:
        for thing in range(1 + len(rules.team(team))):
            if rules.mirror and team is RED:
                place = turned(([flags[BLUE], *cells[BLUE]])[thing])
            else:
                own = [cell for cell in free if whose[cell] is team]
                if thing == 0 and rules.flag_in_back_third:
                    own = [(r, c) for r, c in own if min(c, side - 1 - c) < max(1, side // 6)]
                if not own:
                    return None
                place = own[below(words(16 + 32 * team + thing)[0], len(own))]
            free.remove(place)
            if thing == 0:
                flags.append(place)
                ground[place] = FLAG[team]
            else:
                cells[team].append(place)
    return Drawn(attempt, ground, flags, cells)


def is_playable(rules: Ruleset, drawn: Drawn) -> bool:
    """Whether every UGV has a way to the enemy flag."""
    for team in Team:
        reached = {drawn.flags[team.other]}
        frontier = list(reached)
        while frontier:
            row, column = frontier.pop()
            for down, right in GO.values():
                cell = row + down, column + right
                if cell not in reached and drawn.ground.get(cell, Code.OBSTACLE) != Code.OBSTACLE:
                    reached.add(cell)
                    frontier.append(cell)
        if any(cell not in reached for cell, kind in zip(drawn.cells[team], rules.team(team), strict=True) if not kind.flies):
            return False
    return True
