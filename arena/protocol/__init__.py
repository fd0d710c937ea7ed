"""What the pit and its clients say to each other, as data, and as bytes."""
