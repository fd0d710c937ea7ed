"""Strangers' code in a process of its own, behind a wall: what it sees of the machine, and what it may use."""
