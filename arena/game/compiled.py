"""`arena.game.rules` for kernels: the very same functions, compiled into their callers."""

from arena.game import rules
from arena.jit import jit

_inline = jit(inline=True)
is_move = _inline(rules.is_move)
row_after = _inline(rules.row_after)
column_after = _inline(rules.column_after)
is_on_board = _inline(rules.is_on_board)
can_enter = _inline(rules.can_enter)
wins_cell = _inline(rules.wins_cell)
squared_distance = _inline(rules.squared_distance)
is_in_reach = _inline(rules.is_in_reach)
is_home = _inline(rules.is_home)
home_bonus = _inline(rules.home_bonus)
own_strength = _inline(rules.own_strength)
survives = _inline(rules.survives)
odds = _inline(rules.odds)
survives_without_chance = _inline(rules.survives_without_chance)
is_captured = _inline(rules.is_captured)
is_eliminated = _inline(rules.is_eliminated)
ending_of = _inline(rules.ending_of)
score_of = _inline(rules.score_of)
winner_of = _inline(rules.winner_of)
is_in_sight = _inline(rules.is_in_sight)
