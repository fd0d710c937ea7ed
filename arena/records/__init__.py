"""What is kept of a match: the journal of its referee, and the transcripts of its seats."""
