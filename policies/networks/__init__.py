"""Trained fighters: features, models, checkpoints, and the policies that play them."""
