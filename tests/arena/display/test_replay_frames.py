"""A journal as frames: what a page is told is what the match, played again, was."""

import json
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest

from arena.annotations import Annotations
from arena.display import replay_frames
from arena.display.replay_frames import describe_match, describe_recording
from arena.errors import JournalError
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.game.types import Team
from arena.local.venue import play
from arena.protocol.observation_codec import ObservationWriter
from arena.records.journal_folder import load_journal
from arena.records.replay import replay
from arena.records.transcript import TranscriptHeader, TranscriptWriter
from policies.registry import load as load_policy
from tournaments.fixture import plan_fixture

CODES = "?012345678"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    plans = plan_fixture("friday", "rush", "random", 1, secret_from_seed(3))[:1]
    list(play(load("paper"), plans, load_policy, journals=tmp_path, n_workers=1))
    (path,) = tmp_path.glob("*.journal")
    return path


def test_every_tick_is_told_as_it_was(file: Path) -> None:
    journal = load_journal(file)
    told = describe_match(file.read_bytes())

    assert told["broken"] is None
    assert told["names"] == [journal.header.blue, journal.header.red]
    assert journal.ending is not None
    assert told["ending"] == journal.ending.to_dict()
    assert len(told["ticks"]) == len(journal.ticks) + 1
    told_orders = [tick["orders"] and "".join(tick["orders"]) for tick in told["ticks"]]
    assert told_orders == [*("".join(map(str, tick.orders)) for tick in journal.ticks), None]
    living = [[1] * 6] * 2
    for tick, games in zip(told["ticks"], replay(journal), strict=True):
        before, living = living, [[alive for _, _, alive in team] for team in tick["units"]]
        fell = [[team, unit] for team in Team for unit in range(6) if before[team][unit] and not living[team][unit]]
        assert tick["events"]["fell"] == fell
        assert all(unit in tick["events"]["fought"] for unit in fell)
        assert bool(tick["events"]["captured"]) == (told["ending"]["ending"] == "capture" and tick is told["ticks"][-1])
        boards = [games.truth(0), *(games.grids()[team, 0] for team in Team)]
        for text, board in zip([tick["truth"], *tick["seen"]], boards, strict=True):
            assert np.array_equal(np.array([CODES.index(letter) - 1 for letter in text]), board.ravel())
        units = [(row * 20 + column, alive) for team in tick["units"] for row, column, alive in team]
        assert units == list(zip(games.state.cell[0].tolist(), games.state.alive[0].tolist(), strict=True))


def test_a_journal_that_was_changed_is_told_up_to_there(file: Path) -> None:
    journal, data = load_journal(file), file.read_bytes()

    told = describe_match(data.replace(journal.ticks[3].chain, bytes(32)))

    assert told["broken"]["tick"] == 4
    assert [tick["tick"] for tick in told["ticks"]] == [0, 1, 2, 3]


def test_a_match_that_is_not_over_is_not_told(file: Path) -> None:
    data = file.read_bytes()
    last = load_journal(file).ticks[-1].chain

    with pytest.raises(JournalError, match="the match is not over"):
        describe_match(data[: data.index(last) + len(last)])


def transcribe(file: Path, out: Path, team: Team) -> bytes:
    """Return the transcript of a seat in the match of a journal; its bot notes something on every tick."""
    journal = load_journal(file)
    header = TranscriptHeader(
        match="m", pit="pit", pit_key=bytes(32), entry_key=bytes(32), name="ann", opponent="bob", team=team,
        ruleset=journal.header.ruleset, commitment=bytes(32),
    )  # fmt: skip
    own = slice(0, 6) if team is Team.BLUE else slice(6, 12)
    writer = TranscriptWriter(out, header)
    for number, games in enumerate(replay(journal)):
        if not games.has_ended(0):
            notes = Annotations(20)
            notes.log("tick", number)
            notes.draw.cell(1, 2, "red", "A")
            notes.draw.heat(np.arange(400).reshape(20, 20))
            observation = ObservationWriter(games.observe()[team], 0).write()
            writer.add(observation, journal.ticks[number].orders[own], 1_000, notes.pack())
    assert journal.ending is not None
    writer.end(journal.ending.seen_by(team))
    return out.read_bytes()


@pytest.mark.parametrize("team", Team)
def test_a_transcript_tells_what_its_seat_saw_and_what_its_bot_noted_and_nothing_of_the_enemy(
    file: Path, tmp_path: Path, team: Team
) -> None:
    match = describe_recording(file.read_bytes())
    told = json.loads(json.dumps(describe_recording(transcribe(file, tmp_path / "a.transcript", team))))

    assert told["ending"] == match["ending"]
    assert told["names"] == (["ann", "bob"] if team is Team.BLUE else ["bob", "ann"])
    assert told["team"] == team
    assert len(told["ticks"]) == len(match["ticks"]) - 1
    for seen, true in zip(told["ticks"], match["ticks"], strict=False):
        for name in ("tick", "score", "living"):
            assert seen[name] == true[name]
        for name in ("seen", "units", "orders"):
            assert seen[name][team] == true[name][team]
            assert not seen[name][team.other]
        assert seen["events"]["fell"] == [unit for unit in true["events"]["fell"] if unit[0] == team]
        assert seen["truth"] is None
        assert all(now in (then, "?") for now, then in zip(seen["seen"][team], seen["known"], strict=True))
        assert seen["annotations"]["log"] == [f"tick {seen['tick']}"]
        cell, heat = seen["annotations"]["draw"]
        assert cell == {"cell": [1, 2], "colour": "red", "text": "A"}
        assert b64decode(heat["heat"])[-1] == 255


@pytest.mark.parametrize(("bound", "most"), [("MOST_TICKS", 3), ("MOST_CELLS", 3 * 20**2)])
def test_what_is_too_long_for_a_page_is_said_so(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bound: str, most: int
) -> None:
    monkeypatch.setattr(replay_frames, bound, most)

    for data in (file.read_bytes(), transcribe(file, tmp_path / "a.transcript", Team.RED)):
        with pytest.raises(JournalError, match="a page shows 3 at most"):
            describe_recording(data)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "neither a journal nor a transcript"),
        (b"\x89PNG\r\n" + bytes(100), "neither a journal nor a transcript"),
        (b"ARENA-JOURNAL-9\n" + bytes(9), "the journal is of format 9"),
        (b"ARENA-TRANSCRIPT-9\n" + bytes(9), "the transcript is of format 9"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_sentence(data: bytes, sentence: str) -> None:
    with pytest.raises(JournalError, match=sentence):
        describe_recording(data)
