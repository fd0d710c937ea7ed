"""The live ladder: online ratings, matchmaking, and what is kept of them."""
