"""`arena replay export`, as a user runs it, and what its pictures show."""

import subprocess
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from arena.display.image import ImageFrame, draw, frames_of
from arena.game.observation import Observation
from arena.game.ruleset import Ruleset, load
from arena.game.types import Code, Team
from arena.local.venue import MatchRecord, play_batch
from arena.policy import BatchFactory
from arena.protocol.observation_codec import ObservationWriter
from arena.records.journal import Journal, read_journal
from arena.records.plan import MatchPlan
from arena.records.recording import load_recording
from arena.records.replay import replay
from arena.records.transcript import TranscriptHeader, TranscriptWriter
from policies import registry

Run = Callable[..., subprocess.CompletedProcess[str]]
CELL = 12
FIGHT = "F.......\n.U..u...\n" + 5 * "........\n" + ".......f\n"


@pytest.fixture(scope="module")
def data(planned: Callable[..., MatchPlan]) -> bytes:
    """Return the journal of a match in which units fell, and a flag was captured."""
    fighter, rush = registry.load("fighter"), registry.load("rush")
    for record in play_batch(load("paper"), [planned(f"m/{number}", "ann", "bob") for number in range(20)], fighter, rush):
        if record.journal is not None and 8 <= record.result.ticks <= 30 and record.result.ending.name == "CAPTURE":
            journal = read_journal(record.journal)
            if any(not games.state.alive.all() for games in replay(journal)):
                return record.journal
    raise AssertionError("no match of some ticks")


@pytest.fixture(scope="module")
def journal(data: bytes) -> Journal:
    return read_journal(data)


@pytest.fixture
def file(data: bytes, tmp_path: Path) -> Path:
    (tmp_path / "match.journal").write_bytes(data)
    return tmp_path / "match.journal"


@pytest.fixture
def transcript(journal: Journal, tmp_path: Path) -> Path:
    """Return what red saw of that match."""
    header = TranscriptHeader(
        match="m", pit="pit", pit_key=bytes(32), entry_key=bytes(32), name="bob", opponent="ann", team=Team.RED,
        ruleset=journal.header.ruleset, commitment=bytes(32),
    )  # fmt: skip
    path = tmp_path / "m.transcript"
    writer = TranscriptWriter(path, header)
    for games in replay(journal):
        if not games.has_ended(0):
            writer.add(ObservationWriter(games.observe()[Team.RED], 0).write(), bytes(6))
    assert journal.ending is not None
    writer.end(journal.ending)
    return path


def test_a_gif_has_a_picture_of_every_tick(arena: Run, file: Path, journal: Journal, tmp_path: Path) -> None:
    out = tmp_path / "a.gif"
    done = arena("replay", "export", file, "--gif", "--out", out, "--cell", CELL, "--speed", 10)

    assert (done.returncode, done.stdout.partition(",")[0]) == (0, f"{out}: {len(journal.ticks) + 1} ticks")
    with Image.open(out) as image:
        shown_ms = []
        for frame in range(image.n_frames):
            image.seek(frame)
            shown_ms.append(image.info["duration"])
        assert (image.format, image.width) == ("GIF", 2 * 20 * CELL + 3 * CELL)
    assert sum(shown_ms) == 100 * len(journal.ticks) + 2000  # equal pictures in a row are stored as one
    assert shown_ms[-1] >= 2000


@pytest.mark.parametrize("tick", [None, 0, 3])
def test_a_png_shows_one_tick_the_last_if_none_is_named(here: Run, file: Path, tmp_path: Path, tick: int | None) -> None:
    out = tmp_path / "a.png"
    done = here("replay", "export", file, "--png", "--out", out, *([] if tick is None else ["--tick", tick]))

    frames = list(frames_of(load_recording(file), None))
    assert done.returncode == 0
    with Image.open(out) as image:
        assert image.format == "PNG"
        assert np.array_equal(np.asarray(image), np.asarray(draw(frames[-1 if tick is None else tick], 16)))


def test_without_out_the_picture_lies_here_under_the_name_of_the_match(
    here: Run, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")

    assert here("replay", "export", file, "--png").returncode == 0
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["match.png"]


@pytest.mark.parametrize("team", Team)
def test_a_scene_shows_what_a_team_sees_beside_the_truth(file: Path, journal: Journal, team: Team) -> None:
    frames = frames_of(load_recording(file), team)

    for games, frame in zip(replay(journal), frames, strict=True):
        (label, seen), (_, truth) = frame.boards
        assert label == f"what {team.name.lower()} sees"
        assert np.array_equal(seen, games.grids()[team, 0])
        assert np.array_equal(truth, games.truth(0))
    assert frame.title == "blue ann against red bob"
    assert frame.caption.startswith(f"tick {len(journal.ticks)} of 100   score ")


def test_a_fallen_unit_is_marked_in_the_tick_in_which_it_fell_and_in_no_other(file: Path, journal: Journal) -> None:
    states = [(games.state.alive[0].copy(), games.state.cell[0].copy()) for games in replay(journal)]
    frames = list(frames_of(load_recording(file), None))
    fell = [frozenset()]
    for (before, _), (after, cells) in pairwise(states):
        fell.append(
            frozenset(divmod(int(cell), 20) for cell, was, lives in zip(cells, before, after, strict=True) if was and not lives)
        )

    assert [frame.fallen for frame in frames] == fell
    assert any(fell)


def test_the_flag_that_was_captured_is_marked_in_the_last_tick(file: Path) -> None:
    *frames, last = frames_of(load_recording(file), None)

    assert all(not frame.captured for frame in frames)
    [flag] = last.captured
    assert last.boards[1][1][flag] in (Code.BLUE_UGV, Code.RED_UGV)


def test_units_that_fought_and_live_are_marked(
    played: Callable[..., MatchRecord], every_tick: Callable[..., BatchFactory], tmp_path: Path
) -> None:
    """They come into range on their own halves, where nobody falls if chance is off."""
    rules = load("paper").with_({"board": FIGHT, "tick_limit": 1, "random_combat": False})
    path = tmp_path / "fight.journal"
    path.write_bytes(played(rules, blue=every_tick([2]), red=every_tick([0])).journal or b"")

    fought = [frame.fought for frame in frames_of(load_recording(path), None)]

    assert fought[0] == frozenset()
    assert fought[-1] == {(1, 2), (1, 4)}


def test_a_transcript_shows_what_its_seat_saw_and_remembered(
    here: Run, transcript: Path, file: Path, journal: Journal, tmp_path: Path
) -> None:
    seen = [games.observe()[Team.RED].seat(0, journal.header.ruleset) for games in replay(journal)][:-1]
    frames = list(frames_of(load_recording(transcript), None))

    assert [frame.title for frame in frames] == ["bob plays red against ann"] * len(seen)
    for one, frame in zip(seen, frames, strict=True):
        check_memory(one, frame)
    assert here("replay", "export", transcript, "--png", "--out", tmp_path / "t.png").returncode == 0


def check_memory(seen: Observation, frame: ImageFrame) -> None:
    (_, grid), (_, known) = frame.boards
    assert np.array_equal(grid, seen.grid)
    assert frame.faded is not None
    assert np.array_equal(frame.faded, grid == Code.HIDDEN)
    assert np.array_equal(known[~frame.faded], grid[~frame.faded])


def test_every_code_and_every_mark_looks_different() -> None:
    """In colour, and in grey: blue and orange are not told apart by hue alone."""
    grid = np.array([[-1, 0, 1, 2], [3, 4, 5, 6], [7, 8, 0, 1], [0, 1, 0, 1]], np.int8)
    plain = ImageFrame(title="", caption="", boards=(("", grid), ("", grid)))
    image = draw(plain, 24)
    cells = {}
    for code in Code:
        row, column = (int(value) for value in np.argwhere(grid == code)[0])
        left, top = 24 + column * 24, 24 * 4 + row * 24
        cells[code] = image.crop((left, top, left + 23, top + 23))

    assert len({cell.tobytes() for cell in cells.values()}) == len(Code)
    pieces = [code for code in Code if code not in (Code.BLUE_HALF, Code.RED_HALF)]
    greys = [np.asarray(cells[code].convert("L"), int) for code in pieces]
    for number, one in enumerate(greys):
        assert all((np.abs(one - other) > 40).sum() > 20 for other in greys[:number])
    for marks in ({"fought": frozenset({(3, 3)})}, {"fallen": frozenset({(3, 3)})}, {"captured": frozenset({(3, 3)})}):
        marked = draw(ImageFrame(title="", caption="", boards=plain.boards, **marks), 24)
        changed = np.argwhere((np.asarray(marked) != np.asarray(image)).any(axis=2))
        assert len(changed) > 20
        assert (changed[:, 1] >= 24 * 6 + 24 * 3 - 3).all(), "a mark stands on the right board alone"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "say one of --gif, for every tick, --png, for one, --html, for a page, and --journal, for the journal itself"),
        (
            ["--gif", "--png"],
            "say one of --gif, for every tick, --png, for one, --html, for a page, and --journal, for the journal itself",
        ),
        (
            ["--out", "match.txt"],
            "say one of --gif, for every tick, --png, for one, --html, for a page, and --journal, for the journal itself",
        ),
        (["--html", "--tick", "3"], "--tick is for --png; --html shows every tick"),
        (["--html", "--team", "red"], "--team is for pictures; --html has both views"),
        (["--gif", "--tick", "3"], "--tick is for --png; --gif shows every tick"),
        (["--png", "--tick", "101"], "--tick is 101; the match has ticks 0 to "),
        (["--png", "--tick", "-1"], "--tick is -1; the match has ticks 0 to "),
        (["--png", "--team", "green"], "--team is 'green'; it must be blue or red"),
        (["--png", "--out", "/no/such/folder/a.png"], "cannot write /no/such/folder/a.png: No such file or directory"),
    ],
)
def test_what_cannot_be_drawn_is_one_sentence(here: Run, file: Path, arguments: list[str], says: str) -> None:
    done = here("replay", "export", file, *arguments)

    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert done.stderr.startswith(f"arena: {says}")


@pytest.mark.parametrize("form", ["--gif", "--png"])
def test_a_transcript_without_a_tick_is_no_picture(arena: Run, transcript: Path, form: str) -> None:
    """As that of a client that was killed before its first turn."""
    whole = transcript.read_bytes()
    transcript.write_bytes(whole[: 24 + int.from_bytes(whole[20:24], "little")])

    done = arena("replay", "export", transcript, form, "--out", transcript.with_suffix(".picture"))

    assert (done.returncode, done.stderr) == (2, "arena: the match has no ticks, so there is nothing to draw\n")
    assert not transcript.with_suffix(".picture").exists()


def test_a_team_is_not_chosen_for_a_transcript(arena: Run, transcript: Path) -> None:
    done = arena("replay", "export", transcript, "--png", "--team", "red")

    assert (done.returncode, done.stderr) == (2, "arena: --team is for journals; a transcript is what one seat saw\n")


def test_a_journal_that_breaks_is_not_drawn_as_if_it_held(
    here: Run, data: bytes, journal: Journal, small_rules: Ruleset, tmp_path: Path
) -> None:
    changed = bytearray(data)
    changed[data.index(journal.ticks[4].chain) + 32 + 1] ^= 1
    (tmp_path / "broken.journal").write_bytes(changed)

    done = here("replay", "export", tmp_path / "broken.journal", "--gif", "--out", tmp_path / "a.gif")

    assert (done.returncode, done.stderr.splitlines()[-1]) == (
        1,
        "arena: the journal does not verify: at tick 6 its orders or its state were changed",
    )
    assert not (tmp_path / "a.gif").exists()


def test_below_the_boards_stands_what_the_shapes_mean() -> None:
    """Whole words, on however many lines a small board leaves them; as many for every tick, or a GIF would jump."""
    legends = {}
    for side in (4, 20):
        grid = np.full((side, side), Code.BLUE_HALF, np.int8)
        frame = ImageFrame(title="", caption="", boards=(("", grid), ("", grid)))
        image = draw(frame, 16)
        assert image.size == draw(ImageFrame(title="t", caption="f", boards=frame.boards, fallen=frozenset({(1, 1)})), 16).size
        below = np.asarray(image.convert("L"), int)[16 * 4 + 16 * side + 1 :]
        legends[side] = int(below.shape[0] / 16)
        ink = np.argwhere(below < 200)
        assert len(ink) > 100
        assert ink[:, 1].max() < image.width - 8
        assert ink[:, 0].max() < len(below) - 1

    assert legends[4] > legends[20]


def test_a_name_of_a_megabyte_costs_a_picture_no_more_than_a_long_one(file: Path) -> None:
    frame = next(frames_of(load_recording(file), None))

    pictures = [draw(replace(frame, title=title), CELL) for title in (1_000_001 * "A", 1_000 * "A", 100 * "A\n")]

    assert pictures[0] == pictures[1]
    assert pictures[0].size == pictures[2].size
