"""`arena replay`, as a user runs it."""

import json
import os
import pty
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from arena.display.text import draw_board
from arena.game.ruleset import Ruleset, load
from arena.game.types import Team
from arena.local.venue import MatchRecord, play_batch
from arena.policy import BatchFactory
from arena.records.journal import Journal, read_journal, save_journal
from arena.records.journal_bundle import BundleWriter
from arena.records.plan import MatchPlan
from arena.records.replay import replay
from policies import registry

Run = Callable[..., subprocess.CompletedProcess[str]]
ARENA = [sys.executable, "-c", "from tournaments.cli import main; main()"]
CELLS = set("·:UAFuaf#")


@pytest.fixture(scope="module")
def data(planned: Callable[..., MatchPlan]) -> bytes:
    """Return the journal of a match under the paper's rules, which lasts some ticks."""
    rush, patrol = registry.load("rush"), registry.load("patrol")
    for record in play_batch(load("paper"), [planned(f"paper/{number}", "rush", "patrol") for number in range(9)], rush, patrol):
        if record.journal is not None and 8 <= record.result.ticks <= 30:
            return record.journal
    raise AssertionError("no match of some ticks")


@pytest.fixture
def file(data: bytes, tmp_path: Path) -> Path:
    save_journal(str(tmp_path), "match", data)
    return tmp_path / "match.journal"


@pytest.fixture(scope="module")
def journal(data: bytes) -> Journal:
    return read_journal(data)


@pytest.fixture
def broken(data: bytes, journal: Journal, tmp_path: Path) -> Path:
    """Return a journal whose orders were changed at tick 6."""
    changed = bytearray(data)
    changed[data.index(journal.ticks[4].chain) + 32 + 1] ^= 1
    path = tmp_path / "broken.journal"
    path.write_bytes(changed)
    return path


def letters(cells: object) -> list[str]:
    return draw_board(cells, is_wide=False).plain.split("\n")  # type: ignore[arg-type]


def boards(text: str) -> tuple[list[str], list[str]]:
    """Return the two boards of a printed frame, one letter a cell."""
    rows = text.splitlines()[2:22]
    return [row[:40:2] for row in rows], [row[43:83:2].ljust(20) for row in rows]


def test_verify_says_that_a_journal_holds(arena: Run, here: Run, file: Path, journal: Journal) -> None:
    table, document = arena("replay", "verify", "--local", file), here("replay", "verify", "--local", file, "--json")

    assert (table.returncode, document.returncode) == (0, 0)
    assert journal.canonical_hash in table.stdout
    assert table.stdout.splitlines()[-1] == "1 of 1 journals hold"
    assert json.loads(document.stdout) == {
        "file": str(file),
        "ok": True,
        "ticks": len(journal.ticks),
        "canonical_hash": journal.canonical_hash,
        "seals": None,
        "keys": None,
    }


def test_verify_says_at_which_tick_a_journal_was_changed(here: Run, file: Path, broken: Path) -> None:
    sentence = "at tick 6 its orders or its state were changed"
    table, document = here("replay", "verify", "--local", broken, file), here("replay", "verify", broken, "--json")

    assert (table.returncode, document.returncode, table.stderr) == (1, 1, "")
    assert sentence in table.stdout
    assert table.stdout.splitlines()[-1] == "1 of 2 journals hold"
    facts = json.loads(document.stdout)
    assert (facts["ok"], facts["ticks"]) == (False, 6)
    assert sentence in facts["error"]


def test_verify_says_where_a_journal_was_cut(here: Run, data: bytes, tmp_path: Path) -> None:
    (tmp_path / "cut.journal").write_bytes(data[:-40])

    done = here("replay", "verify", tmp_path / "cut.journal", "--json")

    assert done.returncode == 1
    assert f"it ends at byte {len(data) - 40}, within its ending" in json.loads(done.stdout)["error"]


def test_verify_takes_folders(here: Run, file: Path, broken: Path) -> None:
    done = here("replay", "verify", "--local", file.parent, "--json")

    assert done.returncode == 1
    assert [(Path(check["file"]).name, check["ok"]) for check in json.loads(done.stdout)] == [
        ("broken.journal", False),
        ("match.journal", True),
    ]


@pytest.mark.parametrize("command", ["verify", "show"])
def test_a_file_that_is_not_there_is_one_sentence(here: Run, command: str) -> None:
    done = here("replay", command, "absent.journal")

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "arena: cannot read absent.journal: No such file or directory\n"


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("tick", [0, 5])
def test_show_draws_what_a_team_sees_beside_the_truth(here: Run, file: Path, journal: Journal, team: Team, tick: int) -> None:
    done = here("replay", "show", file, "--tick", tick, "--team", team.name.lower())

    for number, games in enumerate(replay(journal)):
        if number == tick:
            seen, truth = letters(games.grids()[team, 0]), letters(games.truth(0))
    title, names, *_ = done.stdout.splitlines()
    assert title.startswith(f"blue rush against red patrol   tick {tick} of 100   score +0   units 6:6")
    assert names.split("   ")[0] == f"what {team.name.lower()} sees"
    assert boards(done.stdout) == (seen, truth)
    assert len(done.stdout.splitlines()) == 22


def test_show_hides_in_the_fog_what_the_truth_shows(here: Run, file: Path) -> None:
    seen, truth = boards(here("replay", "show", file, "--tick", 0).stdout)

    cells = [pair for rows in zip(seen, truth, strict=True) for pair in zip(*rows, strict=True)]
    assert {left for left, _ in cells} <= CELLS | {" "}
    assert {right for _, right in cells} <= CELLS
    assert all(left in (" ", right) for left, right in cells)
    assert sum(left == " " for left, _ in cells) > 50
    assert {"U", "A", "F", "u", "a", "f"} <= {right for _, right in cells}


def test_show_prints_every_tick_where_there_is_no_terminal(arena: Run, file: Path, journal: Journal) -> None:
    done = arena("replay", "show", file)

    titles = [line for line in done.stdout.splitlines() if line.startswith("blue rush against red patrol")]
    assert [f"tick {number} of 100" in title for number, title in enumerate(titles)] == [True] * (len(journal.ticks) + 1)
    assert f"after {len(journal.ticks)} ticks, score" in done.stdout.splitlines()[-1]
    assert "\x1b" not in done.stdout
    assert done.returncode == 0


def test_show_has_no_winner_in_a_draw(
    here: Run, small_rules: Ruleset, played: Callable[..., MatchRecord], every_tick: Callable[..., BatchFactory], tmp_path: Path
) -> None:
    stay = every_tick([0, 0])
    (tmp_path / "draw.journal").write_bytes(played(small_rules, blue=stay, red=stay).journal or b"")

    done = here("replay", "show", tmp_path / "draw.journal")

    assert done.stdout.splitlines()[-1] == "draw by tick limit after 8 ticks, score +0 for blue"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--team", "green"], "--team is 'green'; it must be blue or red"),
        (["--tick", "-1"], "--tick is -1; the match has ticks 0 to "),
        (["--tick", "101"], "--tick is 101; the match has ticks 0 to "),
    ],
)
def test_show_refuses_what_it_cannot_show(here: Run, file: Path, arguments: list[str], says: str) -> None:
    done = here("replay", "show", file, *arguments)

    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert done.stderr.startswith(f"arena: {says}")


def test_show_plays_a_broken_journal_until_it_breaks(here: Run, broken: Path) -> None:
    done = here("replay", "show", broken)

    titles = [line for line in done.stdout.splitlines() if line.startswith("blue rush")]
    assert done.returncode == 1
    assert len(titles) == 6
    assert done.stderr == "arena: the journal does not verify: at tick 6 its orders or its state were changed\n"


def test_show_finds_a_tick_before_the_break_and_none_after(here: Run, broken: Path) -> None:
    before, after = here("replay", "show", broken, "--tick", 5), here("replay", "show", broken, "--tick", 6)

    assert (before.returncode, before.stderr) == (0, "")
    assert (after.returncode, after.stdout) == (1, "")


def test_a_reader_that_leaves_early_is_no_error(file: Path) -> None:
    command = f"{sys.executable} -c 'from tournaments.cli import main; main()' replay show '{file}' | head -n 3"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60, check=False)

    assert (done.stderr, len(done.stdout.splitlines())) == ("", 3)


def on_terminal(columns: int, *arguments: object) -> tuple[int, str]:
    """Run the command line on a terminal; return its exit code and all that it wrote there."""
    terminal, end = pty.openpty()
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": str(columns), "LINES": "40"}
    process = subprocess.Popen([*ARENA, *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=end, stderr=end, env=environment)
    os.close(end)
    pieces = []
    with suppress(OSError):  # what Linux says when the last writer has gone
        while piece := os.read(terminal, 1 << 16):
            pieces.append(piece)
    os.close(terminal)
    return process.wait(timeout=60), b"".join(pieces).decode()


@pytest.mark.parametrize(("columns", "is_wide"), [(100, True), (80, False)])
def test_show_is_a_film_on_a_terminal_without_keys(file: Path, journal: Journal, columns: int, is_wide: bool) -> None:
    """Each tick takes the place of the one before, in colours."""
    exit_code, text = on_terminal(columns, "replay", "show", file, "--speed", 1000)

    *frames, last = re.split("blue rush against red patrol", re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text).replace("\r", ""))
    assert exit_code == 0
    assert "\x1b[1A" in text
    assert "38;5;" in text
    assert len(frames) >= len(journal.ticks) + 1
    assert len(last.splitlines()[1]) == (83 if is_wide else 43)
    assert journal.ending is not None
    assert last.splitlines()[-1] == journal.ending.describe()


def test_journals_in_a_bundle_are_listed_checked_shown_and_taken_out_one_by_one(
    data: bytes, tmp_path: Path, here: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("kept").mkdir()
    with BundleWriter(Path("kept")) as writer:
        writer.add([("a/b", data), ("c", data), ("cut", data[:-9])])

    listed = here("replay", "list", "kept").stdout.splitlines()
    assert listed == ["kept/a+b.journal", "kept/c.journal", "kept/cut.journal"]
    assert json.loads(here("replay", "list", "kept/000001.journals", "--json").stdout)[1] == "kept/000001.journals/c.journal"
    checked = json.loads(here("replay", "verify", "--local", "kept", "--json").stdout)
    assert [(check["file"], check["ok"]) for check in checked] == list(zip(listed, [True, True, False], strict=True))
    assert here("replay", "verify", "--local", listed[0]).returncode == 0
    assert here("replay", "show", listed[1], "--tick", 0).returncode == 0
    assert here("replay", "export", listed[0], "--journal").returncode == 0
    assert Path("a+b.journal").read_bytes() == data
    assert here("replay", "export", "kept/000001.journals/c.journal", "--out", "c.journal").returncode == 0
    for arguments, says in (
        (("a+b.journal", "--journal"), "cannot write a+b.journal: File exists"),
        (("kept/d.journal", "--journal"), "cannot read kept/d.journal: No such file or directory"),
        (("kept/c.journal", "--journal", "--team", "red"), "--team is for pictures; --journal has both views"),
    ):
        done = here("replay", "export", *arguments)
        assert (done.returncode, done.stderr) == (2, f"arena: {says}\n")


def test_of_a_journal_that_a_full_disk_cuts_off_nothing_is_left(data: bytes, tmp_path: Path) -> None:
    """Else the next try would find half a journal there, and write over nothing."""
    file, copy = tmp_path / "match.journal", tmp_path / "copy.journal"
    file.write_bytes(data)
    full = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({len(data) - 1}, resource.RLIM_INFINITY)); {ARENA[-1]}"

    done = subprocess.run(
        [*ARENA[:-1], full, "replay", "export", file, "--journal", "--out", copy], capture_output=True, text=True, check=False
    )

    assert (done.returncode, done.stderr) == (2, f"arena: cannot write {copy}: File too large\n")
    assert not copy.exists()
