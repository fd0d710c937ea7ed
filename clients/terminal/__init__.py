"""A person plays in the terminal: the board, what the units were told, and the keys."""
