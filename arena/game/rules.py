from arena.games import *  # temporary: moves to arena.games
