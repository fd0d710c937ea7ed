"""A match as it was recorded: by its referee in a journal, or by the client of a seat in a transcript."""

from pathlib import Path

from arena.records.framing import load
from arena.records.journal import Journal, read_journal
from arena.records.journal_folder import read_recorded
from arena.records.transcript import Transcript, begins_transcript, read_transcript


def read_recording(data: bytes) -> Journal | Transcript:
    """Read the bytes of either; what begins as no transcript is read as a journal, and raises as `read_journal` does."""
    return read_transcript(data) if begins_transcript(data) else read_journal(data)


def load_recording(path: Path) -> Journal | Transcript:
    """Read a file, or a journal in a bundle; errors name it."""
    return load(path, read_recording, read_recorded)
