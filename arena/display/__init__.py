"""Matches for the eye: boards as text, frames as data, replays in the terminal, pictures and moving pictures."""
