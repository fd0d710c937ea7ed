"""The game: pure rules, no clock, no I/O."""
