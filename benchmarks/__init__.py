"""How fast the arena is on this machine, as `arena bench` measures it in a checkout. A module here is a benchmark: `run`."""
