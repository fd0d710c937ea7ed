"""A match and a transcript of it, for the tests of what the pages show of them."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from serving import EVIL, Archive, serving

from arena.annotations import Annotations
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.game.types import Team
from arena.local.venue import play_batch
from arena.protocol.observation_codec import ObservationWriter
from arena.records.journal import Journal, read_journal
from arena.records.replay import replay
from arena.records.transcript import TranscriptHeader, TranscriptWriter
from policies import registry
from tournaments.fixture import plan_fixture

MATCH = "0123456789abcdef"
Note = Callable[[Annotations, int], None]


@pytest.fixture(scope="session")
def data() -> bytes:
    """Return the journal of a match of some ticks with fights and falls."""
    plans = plan_fixture("friday", "patrol", "fighter", 4, secret_from_seed(3))
    for record in play_batch(load("paper"), plans, registry.load("patrol"), registry.load("fighter")):
        if record.journal is not None and record.result.ticks >= 20:
            return record.journal
    raise AssertionError("no match of some ticks")


@pytest.fixture(scope="session")
def journal(data: bytes) -> Journal:
    return read_journal(data)


@pytest.fixture(scope="session")
def home(data: bytes) -> Iterator[str]:
    with serving(Archive({MATCH: data})) as home:
        yield home


@pytest.fixture(scope="session")
def transcribe() -> Callable[[Path, Note, bytes], Path]:
    """Return how red's transcript of a match is written, whose bot notes on each tick what it is told to."""

    def write(path: Path, note: Note, data: bytes) -> Path:
        journal = read_journal(data)
        header = TranscriptHeader(
            match=journal.name, pit="pit", pit_key=bytes(32), entry_key=bytes(32), name="mybot", opponent=EVIL, team=Team.RED,
            ruleset=journal.header.ruleset, commitment=bytes(32),
        )  # fmt: skip
        writer = TranscriptWriter(path, header)
        for number, games in enumerate(replay(journal)):
            if not games.has_ended(0):
                notes = Annotations(journal.header.ruleset.side)
                note(notes, number)
                observation = ObservationWriter(games.observe()[Team.RED], 0).write()
                writer.add(observation, journal.ticks[number].orders[6:], 1_000, notes.pack())
        assert journal.ending is not None
        writer.end(journal.ending.seen_by(Team.RED))
        return path

    return write


@pytest.fixture
def replayed(home: str) -> str:
    return f"{home}/match/{MATCH}"
