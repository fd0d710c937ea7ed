"""One match as a state machine without I/O: orders and the time go in, effects come out."""
