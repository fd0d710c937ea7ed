"""What one seat saw in a match that was played, and what came of its answers: from a transcript, or from a journal."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from arena.errors import InputError
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team
from arena.protocol.observation_codec import ObservationReader
from arena.records.journal import Journal, Mark
from arena.records.recording import load_recording
from arena.records.replay import replay
from arena.records.transcript import Transcript


class Turn(NamedTuple):
    """What a seat saw at one tick, and what came of its answer."""

    tick: int
    seen: Observations
    """Of this seat alone, in memory that the next turn overwrites."""
    played: bytes
    """A byte per own unit."""
    mark: Mark
    """What the answer was, if no order in time."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedSeat:
    """One seat of a match that was played."""

    title: str
    """Who played whom, not clean."""
    ruleset: Ruleset
    team: Team
    n_turns: int
    turns: Iterator[Turn]
    """From tick 0, once."""
    is_whole: bool
    """Whether the match is recorded up to its end."""


def open_seat(file: Path, team: Team | None, bot: str) -> RecordedSeat:
    """Read a seat from a transcript, or from a journal, where `team` says which; without it, the one that is named like `bot`.

    Raises
    ------
    InputError
        The file cannot be read, or is of another version of the rules; or it is not said whose seat is meant.
    """
    recording = load_recording(file)
    if isinstance(recording, Transcript):
        return _seat_of_transcript(recording)
    names = recording.header.blue, recording.header.red
    named = [seat for seat in Team if names[seat] == bot]
    if team is None and len(named) != 1:
        who = "both seats are" if named else "no seat is"
        raise InputError(f"{who} {bot} in {file}, which blue {names[0]} and red {names[1]} played; say --team blue or --team red")
    return _seat_of_journal(recording, named[0] if team is None else team)


def _seat_of_transcript(transcript: Transcript) -> RecordedSeat:
    header = transcript.header
    reader = ObservationReader(header.ruleset, header.team)
    unreadable = [any(order not in tuple(Action) for order in orders) for _, orders in transcript.ticks]
    return RecordedSeat(
        title=f"match {header.match}: {header.name} as {header.team.name.lower()} against {header.opponent}",
        ruleset=header.ruleset,
        team=header.team,
        n_turns=len(transcript.ticks),
        turns=(
            Turn(tick, reader.read(observation), orders, Mark.UNREADABLE if unreadable[tick] else Mark(0))
            for tick, (observation, orders) in enumerate(transcript.ticks)
        ),
        is_whole=transcript.ending is not None,
    )


def _seat_of_journal(journal: Journal, team: Team) -> RecordedSeat:
    header = journal.header
    names, n_blue = (header.blue, header.red), len(header.ruleset.team(Team.BLUE))
    own = slice(0, n_blue) if team is Team.BLUE else slice(n_blue, None)
    return RecordedSeat(
        title=f"match {header.identity}: {names[team]} as {team.name.lower()} against {names[team.other]}",
        ruleset=header.ruleset,
        team=team,
        n_turns=len(journal.ticks),
        turns=(
            Turn(tick, games.observe()[team], record.orders[own], record.marks[team])
            for tick, (record, games) in enumerate(zip(journal.ticks, replay(journal), strict=False))
        ),
        is_whole=journal.ending is not None,
    )
