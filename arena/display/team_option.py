"""The option `--team` of commands that show a match: whose view of a journal."""

from pathlib import Path

from arena.errors import InputError
from arena.game.types import Team
from arena.records.transcript import is_transcript


def read_team(chosen: str | None, file: Path) -> Team | None:
    """Return the team that is chosen for a journal; `InputError` if it is none, or if the file is a transcript."""
    if chosen is None:
        return None
    if chosen not in ("blue", "red"):
        raise InputError(f"--team is {chosen!r}; it must be blue or red")
    if is_transcript(file):
        raise InputError("--team is for journals; a transcript is what one seat saw")
    return Team[chosen.upper()]
