"""The versions of the store's tables, one after another, and the way from each to the next."""
