from commands import join, nursery, port, quick_arena, quick_start, serve, shared_start

__all__ = ["arena", "join", "nursery", "port", "serve", "shared_start", "start"]

start, arena = quick_start, quick_arena
