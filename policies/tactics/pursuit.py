"""Going for a goal among other units: round obstacles, and aside where another unit stands in the way."""

from arena.game.philox import below
from arena.jit import jit
from policies.belief.memory import SeatMemory
from policies.belief.team_rules import TeamRules
from policies.chance import Words, one_in
from policies.tactics.moves import STAY, head_for, is_open


@jit()
def pursue(seat: int, unit: int, cell: int, goal: int, memory: SeatMemory, rules: TeamRules, words: Words) -> int:
    """Return the next step of a unit towards a goal, and remember its detour.

    A unit that was sent and is still where it was met another: half of the time it steps aside, since two that keep
    heading for each other's cells would stand there for ever.

    Parameters
    ----------
    words
        Four, as of `chance.draw`; the first three are used.
    """
    side, flies = rules.side, rules.flies[unit]
    row, column = cell // side, cell % side
    if cell == memory.sent_from[seat, unit] and one_in(words[1], 2):
        memory.sent_from[seat, unit], memory.detour[seat, unit] = -1, 0
        aside = 1 + int(below(words[2], 4))
        return aside if is_open(memory.ground, seat, side, row, column, aside, flies) else STAY
    action, detour = head_for(
        memory.ground, seat, side, row, column, goal, flies, rules.step[unit], int(memory.detour[seat, unit]), words[0]
    )
    memory.detour[seat, unit] = detour
    memory.sent_from[seat, unit] = -1 if action == STAY else cell
    return action
