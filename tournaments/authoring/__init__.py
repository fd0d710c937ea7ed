"""What an author of a bot works with: what the arena tells of a bot that fails."""
