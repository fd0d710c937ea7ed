"""A league as data: its file, entries, schedule, secret, and what counts as an edit."""
