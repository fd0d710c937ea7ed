"""`arena replay show` of a transcript, as somebody runs it whose bot has lost."""

import re
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from worlds import lay, rules_for

from arena.annotations import Annotations
from arena.display.drawings import write_drawings
from arena.display.scene import scenes_of_transcript
from arena.display.text import draw_board
from arena.display.words import format_last_tick
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.policy import MatchResult
from arena.protocol.observation_codec import ObservationWriter
from arena.records.replay import match_result
from arena.records.transcript import TranscriptHeader, TranscriptWriter, load_transcript

Run = Callable[..., subprocess.CompletedProcess[str]]
STAY, NORTH, EAST, SOUTH, WEST = range(5)
BOARD = """
F....u
......
.U....
......
......
A....f
"""
RACE = rules_for(BOARD, ugv={"attack": 0, "sight": 1}, uav={"sight": 1, "step": 1})
"""Nobody hits anybody, and each sees the cells beside it."""
AMBUSH = rules_for(BOARD, ugv={"attack": 2, "sight": 3}, uav={"sight": 0, "step": 1}, random_combat=False)


def keep(
    path: Path,
    rules: Ruleset,
    team: Team,
    orders: Iterable[Sequence[int]],
    annotations: Mapping[int, bytes] = MappingProxyType({}),
    **changes: Any,
) -> Path:
    """Play a match with these orders (blue's U and A, red's u), and keep what one team was shown."""
    games = lay(rules)
    header = TranscriptHeader(
        match="m7", pit="home", pit_key=bytes(32), entry_key=bytes(32), name="mine", opponent="theirs", team=team, ruleset=rules,
        commitment=bytes(32),
    )  # fmt: skip
    own = slice(2, 3) if team is Team.RED else slice(0, 2)
    with TranscriptWriter(path, replace(header, **changes)) as transcript:
        writer = ObservationWriter(games.observe()[team], 0)
        for tick, told in enumerate(orders):
            actions = np.array([told], np.int8)
            transcript.add(writer.write(), actions[0, own].tobytes(), annotations=annotations.get(tick, b""))
            games.play(actions)
        if games.has_ended(0):
            result = match_result(games, 0)
            transcript.end(result if team is Team.BLUE else replace(result, score=-result.score))
    return path


@pytest.fixture
def race(tmp_path: Path) -> Path:
    """Return blue's side of a race that red wins, with blue's UAV on its way."""
    moves = [(SOUTH, NORTH, WEST)] * 2 + [(STAY, NORTH, WEST)] * 3
    return keep(tmp_path / "race.transcript", RACE, Team.BLUE, moves)


def boards(text: str, side: int = 6) -> list[tuple[list[str], list[str]]]:
    """Return the two boards of each printed frame, one letter a cell."""
    lines = text.splitlines()
    frames = []
    for start in (number + 1 for number, line in enumerate(lines) if line.startswith("what ")):
        right = lines[start - 1].index("and remembers")
        rows = [line.ljust(right + 2 * side) for line in lines[start : start + side]]
        frames.append(([row[: 2 * side : 2] for row in rows], [row[right : right + 2 * side : 2] for row in rows]))
    return frames


def test_what_the_seat_saw_stands_beside_what_it_remembers(arena: Run, race: Path) -> None:
    done = arena("replay", "show", race)

    assert (done.returncode, done.stderr) == (0, "")
    shown = boards(done.stdout)
    assert len(shown) == 5
    assert shown[0][0] == ["      ", " ·    ", "·U·   ", " ·    ", "·     ", "A·    "]
    assert shown[0][1] == shown[0][0]
    assert shown[2][0] == ["      ", "      ", "·     ", "A·    ", "·U·   ", " ·    "]
    assert shown[2][1] == ["      ", " ·    ", "···   ", "A··   ", "·U·   ", "··    "]
    assert shown[4][0][:3] == ["F     ", "A·    ", "·     "]
    for before, after in pairwise(shown):
        known = [{(r, c) for r, row in enumerate(rows) for c, x in enumerate(row) if x != " "} for _, rows in (before, after)]
        assert known[0] <= known[1]


def test_each_tick_says_what_was_known_and_ordered(arena: Run, race: Path) -> None:
    first, second, third, *_ = arena("replay", "show", race, "--tick", 2).stdout.splitlines()

    assert first == "pit home, match m7: mine plays blue against theirs"
    assert second == "tick 2 of 100   score +0   units 2:1"
    assert third == "orders: ugv 0 stay, uav 1 north"


def test_one_tick_alone_remembers_all_before(arena: Run, race: Path) -> None:
    whole, alone = arena("replay", "show", race), arena("replay", "show", race, "--tick", 4)

    assert boards(alone.stdout) == boards(whole.stdout)[4:]


def test_a_captured_flag_is_said_with_who_was_seen_beside_it(arena: Run, race: Path, tmp_path: Path) -> None:
    theirs = keep(tmp_path / "red.transcript", RACE, Team.RED, [(STAY, STAY, WEST)] * 5)

    lost, won = (arena("replay", "show", path).stdout.splitlines()[-3:] for path in (race, theirs))

    assert lost == [
        "enemies were in sight at no tick",
        "in tick 5 the own flag at (0, 0) was captured; in sight beside it before: nobody",
        "loss as blue by capture after 5 ticks, score -100",
    ]
    assert won[1:] == [
        "in tick 5 the enemy's flag at (0, 0) was captured",
        "win as red by capture after 5 ticks, score +100",
    ]


def test_the_fallen_are_said_with_their_place_and_who_was_in_sight(arena: Run, tmp_path: Path) -> None:
    """A blue UGV walks into red's half, where a red one meets it."""
    blue = keep(tmp_path / "blue.transcript", AMBUSH, Team.BLUE, [(EAST, STAY, WEST), (EAST, STAY, SOUTH)])

    done = arena("replay", "show", blue)

    assert done.stdout.splitlines()[-3:] == [
        "enemies were in sight at tick 1",
        "in tick 2 the last own units fell: ugv 0 at (2, 2); in sight before: ugv at (0, 4)",
        "loss as blue by elimination after 2 ticks, score -100",
    ]


def test_a_unit_that_fell_in_the_middle_has_a_line_of_its_own(arena: Run, tmp_path: Path) -> None:
    rules = rules_for(BOARD.replace(".U....", ".U...U"), ugv={"attack": 1, "sight": 2}, uav={"sight": 0, "step": 1}).with_(
        {"random_combat": False, "tick_limit": 3}
    )
    games = lay(rules)
    assert games.n_units == {Team.BLUE: 3, Team.RED: 1}
    path, own = tmp_path / "blue.transcript", slice(0, 3)
    header = TranscriptHeader(
        match="m", pit="p", pit_key=bytes(32), entry_key=bytes(32), name="a\x1b[2J", opponent="b", team=Team.BLUE, ruleset=rules,
        commitment=bytes(32),
    )  # fmt: skip
    with TranscriptWriter(path, header) as transcript:
        writer = ObservationWriter(games.observe()[Team.BLUE], 0)
        for told in [(STAY, STAY, STAY, SOUTH), (EAST, STAY, STAY, NORTH), (WEST, 99, NORTH, STAY)]:
            transcript.add(writer.write(), bytes(told[own]))
            games.play(np.array([told], np.int8))
        transcript.end(match_result(games, 0))

    done = arena("replay", "show", path)

    lines = done.stdout.splitlines()
    assert lines[-4:] == [
        "tick 1: ugv 1 fell at (2, 5); in sight before: ugv at (0, 5)",
        "enemies were in sight at tick 0",
        "in tick 3 the tick limit came, the score stayed at -10; 2 own and 1 enemy units lived before",
        "loss as blue by tick limit after 3 ticks, score -10",
    ]
    assert "orders: ugv 0 west, ugv 1 fallen, uav 2 north" in lines
    assert "\x1b" not in done.stdout
    assert lines[0] == r"pit p, match m: a\x1b[2J plays blue against b"


def test_what_the_bot_noted_stands_under_its_tick(arena: Run, tmp_path: Path) -> None:
    notes = Annotations(RACE.side)
    notes.log("raw", "\x1b[2J")
    notes.draw.cell(1, 2, "red", "GO")
    notes.draw.path([(0, 0), (0, 1)])
    notes.draw.heat(np.eye(6)[::-1])
    path = keep(tmp_path / "noted.transcript", RACE, Team.BLUE, [(STAY, STAY, STAY)] * 2, annotations={1: notes.pack()})

    first, second = (arena("replay", "show", path, "--tick", tick).stdout.splitlines() for tick in (0, 1))

    assert second[-8:] == [r"log: raw \x1b[2J", "drawn:", "..---9", "--G-9-", "---9--", "--9---", "-9----", "9-----"]
    assert len(first) == len(second) - 8


def test_heat_maps_with_labels_stand_side_by_side_on_as_many_columns_as_there_are() -> None:
    notes = Annotations(3)
    notes.draw.path([(0, 0), (0, 1)])
    for number in range(3):
        notes.draw.heat(np.eye(3) * (number + 1), label=f"u{number}\t")

    assert write_drawings(notes.to_dict()["draw"], 3, 18) == [
        r"drawn:  u0\t:",
        "..-     9--",
        "---     -9-",
        "---     --9",
        r"u1\t:   u2\t:",
        "9--     9--",
        "-9-     -9-",
        "--9     --9",
    ]


def test_a_transcript_without_an_ending_says_so(arena: Run, race: Path, tmp_path: Path) -> None:
    stopped = keep(tmp_path / "stopped.transcript", RACE, Team.BLUE, [(STAY, STAY, STAY)] * 2)
    cut = tmp_path / "cut.transcript"
    cut.write_bytes(race.read_bytes()[:-1])
    nothing = keep(tmp_path / "nothing.transcript", RACE, Team.BLUE, [])

    ends = [arena("replay", "show", path).stdout.splitlines()[-2:] for path in (stopped, cut, nothing)]

    assert ends == [
        ["the transcript stops after 2 ticks, without an ending", "unfinished as blue"],
        ["the transcript was cut short after 5 ticks, without an ending", "unfinished as blue"],
        ["the transcript stops after 0 ticks, without an ending", "unfinished as blue"],
    ]
    assert "the match has no ticks" in arena("replay", "show", nothing, "--tick", 0).stderr


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--team", "blue"], "--team is for journals; a transcript is what one seat saw"),
        (["--tick", "5"], "--tick is 5; the match has ticks 0 to 4"),
    ],
)
def test_show_refuses_what_it_cannot_show(arena: Run, race: Path, arguments: list[str], says: str) -> None:
    done = arena("replay", "show", race, *arguments)

    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"arena: {says}\n")


def test_a_changed_transcript_is_one_sentence(arena: Run, race: Path) -> None:
    data = bytearray(race.read_bytes())
    data[-1] ^= 1
    race.write_bytes(data)

    done = arena("replay", "show", race)

    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert "race.transcript: the transcript was changed" in done.stderr


def test_what_is_remembered_is_dimmed(race: Path) -> None:
    transcript = load_transcript(race)
    console = Console(width=80, force_terminal=True, color_system="truecolor")
    pieces = []
    for scene in scenes_of_transcript(transcript):
        pane = scene.panes["and remembers"]
        with console.capture() as capture:
            console.print(draw_board(pane.grid, is_wide=False, dimmed=pane.dimmed))
        pieces.append(re.findall(r"\x1b\[2;[^m]*m([^\x1b]*)", capture.get()))

    n_remembered = [sum(piece.count("·") + piece.count("F") for piece in dimmed) for dimmed in pieces]
    assert n_remembered[:3] == [0, 4, 5]
    assert not {"U", "A"} & set("".join(pieces[4]))


def test_what_the_pit_ruled_is_said() -> None:
    result = MatchResult(ending=Termination.FORFEIT, winner=Team.RED, score=-100, ticks=3, reason="blue vanished")

    assert format_last_tick([], result) == "the pit ruled: blue vanished"
    assert format_last_tick([], replace(result, ending=Termination.VOID, reason="")) == "the pit ruled: no reason given"
    assert format_last_tick([], replace(result, ending=Termination.CAPTURE)) == "nothing was seen of this match"
