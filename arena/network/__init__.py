"""Zenoh: the sessions, the addresses of pits, and what a router lets clients do. Nothing else of ours imports it."""
