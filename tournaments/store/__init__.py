"""Results in SQL: the store, its schema, its migrations, and the lock of a league."""
