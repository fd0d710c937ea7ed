"""Who meets whom, how often, and who is better."""
