"""The commands that need the whole arena: leagues, play, evaluate, serve, web, bench."""
