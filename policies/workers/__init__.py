"""Fighters in processes of their own: asked without waiting, under limits, and behind a wall if they are strangers'."""
