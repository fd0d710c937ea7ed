"""Ratings and their certainty: Davidson, bootstrap, sequential tests, standings, residuals."""
