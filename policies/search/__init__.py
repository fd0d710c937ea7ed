"""Planners: fighters that look ahead with the rules themselves."""
