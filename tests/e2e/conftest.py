from commands import join, nursery, port, quick_arena, quick_start, serve, shared_start
from terminals import terminal

__all__ = ["arena", "join", "nursery", "port", "serve", "shared_start", "start", "terminal"]

start, arena = quick_start, quick_arena
