"""From what is known to orders: moves, paths, odds, roles, lanes, lures and scouting."""
