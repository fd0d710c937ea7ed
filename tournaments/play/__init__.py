"""Two fighters against each other, at once and without a store."""
