"""Keys on disk: those of entries and pits, and which pits are known. Nothing that is there is ever written over."""
