"""What a seat remembers, and what it infers of what it does not see."""
