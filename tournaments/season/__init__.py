"""A league that stays open: entries are submitted, and its pairs are chosen one by one by what tells most."""
