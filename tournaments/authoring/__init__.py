"""What the author of a bot works with: a bench to write, check and compare on."""
