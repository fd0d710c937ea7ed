"""How fast the arena is on this machine, as `arena bench` measures it."""
