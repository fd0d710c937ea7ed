"""The calls of bots by this process: which one is under way, where the bot stands in it, and what it prints meanwhile."""
