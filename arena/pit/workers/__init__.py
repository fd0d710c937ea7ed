"""Matches in processes of their own: workers, each with its session to the router of the pit, and the pit's side of them."""
