from arena.games import *  # temporary: moves to arena.games
from arena.games import lay_out, tables_of
