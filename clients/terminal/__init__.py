"""A person plays in the terminal: the board, the units' orders, and the keys."""
