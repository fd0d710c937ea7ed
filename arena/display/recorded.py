"""A match from its file, a journal or the transcript of a seat, as a person looks at it in a terminal."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from arena.display.scene import Scene, View, scenes_of_journal, scenes_of_transcript, views_of_journal, views_of_transcript
from arena.display.words import format_last_tick, format_losses
from arena.game.types import Team
from arena.records.recording import load_recording
from arena.records.transcript import Transcript


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedMatch:
    """What there is to look at."""

    scenes: Iterator[Scene]
    """Every tick, once."""
    last: int
    """The number of the last; -1 if there is none."""
    views: tuple[View, ...]
    epilogue: Iterator[str]
    """How it ended, in lines, not clean; once, and made when it is asked for."""
    is_of_one_seat: bool


def open_match(file: Path, team: Team | None) -> RecordedMatch:
    """Read a file; `team` is whose view of a journal comes first, blue's without it.

    Raises
    ------
    JournalError
        It cannot be read.
    """
    recording = load_recording(file)
    if isinstance(recording, Transcript):
        return RecordedMatch(
            scenes=scenes_of_transcript(recording),
            last=len(recording.ticks) - 1,
            views=views_of_transcript(recording.header.team),
            epilogue=_tell_the_end(recording),
            is_of_one_seat=True,
        )
    return RecordedMatch(
        scenes=scenes_of_journal(recording),
        last=len(recording.ticks),
        views=views_of_journal(Team.BLUE if team is None else team),
        epilogue=iter(() if recording.ending is None else (recording.ending.describe(),)),
        is_of_one_seat=False,
    )


def _tell_the_end(transcript: Transcript) -> Iterator[str]:
    seen, team = list(transcript.observations()), transcript.header.team
    yield from format_losses(seen)
    if transcript.ending is None:
        how = "stops" if transcript.is_whole else "was cut short"
        yield f"the transcript {how} after {len(seen)} ticks, without an ending"
        yield f"unfinished as {team.name.lower()}"
    else:
        yield format_last_tick(seen, transcript.ending)
        yield transcript.ending.describe(team)
