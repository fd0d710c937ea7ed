"""Scripted fighters, one to a file: those that the game's authors shipped, repaired to live in the fog."""
