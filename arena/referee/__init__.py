"""Who owns the truth: matches, journals, and the venues that they are played in."""
