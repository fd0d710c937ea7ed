"""A module for each version of the tables; a stored version is never edited, only followed by the next."""
