from commands import join, port, serve, start

__all__ = ["join", "port", "serve", "start"]
