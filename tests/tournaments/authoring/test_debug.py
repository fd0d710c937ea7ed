"""`arena debug`: a bot is given again what it saw, and stopped where its author wants to look."""

import io
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.game.types import Team
from arena.protocol.observation_codec import ObservationWriter
from arena.records.journal import save_journal
from arena.records.journal_folder import load_journal
from arena.records.replay import replay
from arena.records.transcript import TranscriptHeader, TranscriptWriter

Run = Callable[..., subprocess.CompletedProcess[str]]
BOT = '''
class Bot:
    """Its orders hang on all that it has seen, on the seed, on its team and on how often it was asked."""

    def start(self, info):
        self.total, self.team = 0, info.team

    def act(self, observation):
        self.total += observation.seed % 1000 + len(observation.enemies) + int(observation.grid.sum()) + self.team
        luck = self.total + int(observation.rng.integers(5))
        return [(luck + unit.index) % 5 for unit in observation.units]
'''
TICK = 6


@pytest.fixture
def bot(tmp_path: Path) -> Path:
    (tmp_path / "mine.py").write_text(BOT)
    return tmp_path / "mine.py"


@pytest.fixture
def journal(here: Run, bot: Path, tmp_path: Path) -> Path:
    """Return the journal of a match that the bot plays as red."""
    done = here(
        "play", bot, "rush", "--pairs", 1, "--seed", 4, "--workers", 1, "--set", "tick_limit=14", "--journals", tmp_path / "kept"
    )
    assert done.returncode == 0
    [path] = (tmp_path / "kept").glob("*rush-blue*")
    assert len(load_journal(path).ticks) > TICK
    return path


@pytest.fixture
def transcript(journal: Path, tmp_path: Path) -> Path:
    """Return what a client of a pit would have kept of red's seat."""
    match = load_journal(journal)
    n_blue = len(match.header.ruleset.team(Team.BLUE))
    header = TranscriptHeader(
        match="m", pit="p", pit_key=bytes(32), entry_key=bytes(32), name="mine", opponent="rush", team=Team.RED,
        ruleset=match.header.ruleset, commitment=bytes(32),
    )  # fmt: skip
    with TranscriptWriter(tmp_path / "red.transcript", header) as writer:
        for tick, games in zip(match.ticks, replay(match), strict=False):
            writer.add(ObservationWriter(games.observe()[Team.RED], 0).write(), tick.orders[n_blue:])
        assert match.ending is not None
        writer.end(match.ending.seen_by(Team.RED))
    return tmp_path / "red.transcript"


@pytest.fixture
def debug(here: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., tuple[int, list[str]]]:
    """Run `arena debug` with commands for pdb; return the exit code, and all lines."""
    monkeypatch.setenv("HOME", str(tmp_path))  # where a .pdbrc of the user's is not

    def run(*arguments: object, commands: str = "") -> tuple[int, list[str]]:
        monkeypatch.setattr(sys, "stdin", io.StringIO(commands))
        done = here("debug", *arguments)
        return done.returncode, [*done.stdout.splitlines(), *done.stderr.splitlines()]

    return run


def change(bot: Path, before: str, after: str) -> None:
    assert before in BOT
    bot.write_text(BOT.replace(before, after))


@pytest.mark.parametrize("kind", ["journal", "transcript"])
def test_an_unchanged_bot_orders_what_it_ordered(request: pytest.FixtureRequest, debug: Run, bot: Path, kind: str) -> None:
    code, lines = debug(request.getfixturevalue(kind), "--policy", bot)

    assert (code, lines[1:]) == (0, ["its orders are those that were played, at all 14 ticks"])
    assert "mine as red against rush: 14 ticks" in lines[0]


def test_a_changed_bot_is_told_its_first_difference(debug: Run, bot: Path, journal: Path) -> None:
    change(bot, "unit.index) % 5", f"unit.index + (unit.index == 2 and observation.tick >= {TICK})) % 5")
    words = ["stay", "north", "east", "south", "west"]
    was = load_journal(journal).ticks[TICK].orders[6 + 2]

    code, lines = debug(journal, "--policy", bot)

    assert (code, lines[1:]) == (1, [f"tick {TICK}: ugv 2 {words[(was + 1) % 5]}, it was {words[was]}"])


def test_pdb_stops_at_the_first_line_of_act_at_its_tick(debug: Run, bot: Path, transcript: Path) -> None:
    code, lines = debug(
        transcript, "--policy", bot, "--tick", TICK, commands="p ('tick', observation.tick)\np ('asked', self.total > 0)\nc\n"
    )

    said = "\n".join(lines)
    assert code == 0
    assert "mine.py(9)act()" in said
    assert "-> self.total += observation.seed" in said
    assert "def act(self, observation):" in said
    assert f"('tick', {TICK})" in said
    assert "('asked', True)" in said
    assert lines[-1].endswith("its orders are those that were played, at all 14 ticks")


def test_with_a_tick_the_first_difference_is_told_too(debug: Run, bot: Path, journal: Path) -> None:
    change(bot, "self.total + int", "self.total + (observation.tick == 2) + int")

    code, lines = debug(journal, "--policy", bot, "--tick", TICK, commands="p observation.tick\nq\n")

    assert code == 1
    assert lines[1].startswith("tick 2: ugv 0 ")
    assert any(line.endswith(f"(Pdb) {TICK}") for line in lines)
    assert len([line for line in lines if line.startswith("tick ")]) == 1


@pytest.mark.parametrize(
    ("after", "says"),
    [
        ("1 // (observation.tick - 3) * 0 + self.total + int", "tick 3: ZeroDivisionError: integer "),
        ("[][min(3 - observation.tick, 0)] if observation.tick > 2 else self.total + int", "tick 3: IndexError: "),
    ],
)
def test_a_bot_that_raises_before_the_tick_is_looked_at_there(
    debug: Run, bot: Path, journal: Path, after: str, says: str
) -> None:
    change(bot, "self.total + int", after)

    code, lines = debug(journal, "--policy", bot, "--tick", TICK, commands="up\np observation.tick\nq\n")
    compared, told = debug(journal, "--policy", bot)

    assert (code, compared) == (1, 1)
    assert lines[1].startswith(says)
    assert any("mine.py(" in line for line in lines)
    assert any(line.endswith("(Pdb) 3") for line in lines)
    assert told[1].startswith(says)
    assert "; it was ugv 0 " in told[1]
    assert not any("Traceback" in line for line in told)


def test_a_bot_that_cannot_start_is_looked_at_there(debug: Run, bot: Path, journal: Path) -> None:
    change(bot, "info.team", "info.teams")

    code, lines = debug(journal, "--policy", bot, "--tick", 0, commands="p info.team\nq\n")

    assert code == 1
    assert lines[1].startswith("before tick 0: AttributeError: ")
    assert any("Team.RED" in line for line in lines)


def test_a_bot_that_cancels_itself_or_cannot_be_made_is_told_like_any_other(debug: Run, bot: Path, journal: Path) -> None:
    change(bot, "return [(", "raise __import__('asyncio').CancelledError; return [(")
    cancelled, told = debug(journal, "--policy", bot)
    bot.write_text("class Bot:\n    def __new__(cls, side): pass\n    def act(self, observation): pass\n")
    unmade, said = debug(journal, "--policy", bot)

    assert (cancelled, unmade) == (1, 1)
    assert told[1].startswith("tick 0: asyncio.exceptions.CancelledError (mine.py, line ")
    assert said[1].startswith("before tick 0: TypeError: Bot.__new__() missing 1 required positional argument: 'side'; all")


def test_a_turn_that_failed_in_the_match_is_told_once_and_a_repaired_bot_differs(here: Run, debug: Run, bot: Path) -> None:
    change(bot, "return [(", "return [1] if observation.tick in (3, 5) else [(")
    here("play", bot, "rush", "--pairs", 1, "--seed", 4, "--workers", 1, "--set", "tick_limit=9", "--journals", bot.parent / "k")
    [path] = (bot.parent / "k").glob("*rush-blue*")

    same = debug(path, "--policy", bot)
    bot.write_text(BOT)
    repaired = debug(path, "--policy", bot)

    assert same[0] == 0
    assert same[1][1:] == [
        "tick 3: 1 orders for 6 units; so it was in the match", "its orders are those that were played, at all 9 ticks",
    ]  # fmt: skip
    assert repaired[0] == 1
    assert repaired[1][1].startswith("tick 3: ugv 0 ")
    assert repaired[1][1].endswith("; in the match its answer could not be read, and all stayed")


def test_our_fighters_and_programs_are_compared_alone(debug: Run, journal: Path, tmp_path: Path) -> None:
    (tmp_path / "stays.py").write_text(
        "import json\nfor line in map(json.loads, iter(input, '')):\n"
        "    if line['type'] == 'observation': print(json.dumps([0] * len(line['units'])), flush=True)\n"
    )
    program = f"exec:{sys.executable} {tmp_path / 'stays.py'}"

    assert debug(journal, "--policy", "rush")[1][1:] == ["its orders are those that were played, at all 14 ticks"]
    code, lines = debug(journal, "--policy", program, "--team", "blue")
    assert (code, lines[1][:7]) == (1, "tick 0:")
    assert "stay, it was " in lines[1]


def test_what_our_fighters_and_programs_note_at_a_tick_is_shown(debug: Run, journal: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.py").write_text(
        "import json\nfor line in map(json.loads, iter(input, '')):\n"
        "    if line['type'] == 'observation': print(json.dumps({'orders': [0] * len(line['units']), 'log': line['tick'] * 'x',"
        " 'draw': [{'cell': [0, line['tick']]}]}), flush=True)\n"
    )
    program = f"exec:{sys.executable} {tmp_path / 'notes.py'}"

    code, lines = debug(journal, "--policy", "rush", "--tick", 3)
    assert (code, lines[1:]) == (0, ["tick 3: it notes nothing", "its orders are those that were played, at all 14 ticks"])
    code, lines = debug(journal, "--policy", program, "--team", "blue", "--tick", 3)
    assert (code, lines[1][:7], lines[2:5]) == (1, "tick 0:", ["log: xxx", "drawn:", f"---*{16 * '-'}"])
    assert len(lines) == 4 + 20


def test_what_cannot_be_debugged_is_one_sentence(debug: Run, bot: Path, journal: Path, transcript: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.transcript"
    cut.write_bytes(transcript.read_bytes()[:-200])
    save_journal(str(tmp_path), "short", journal.read_bytes()[:300])
    (tmp_path / "other.py").write_text(BOT)
    other = tmp_path / "other.py"
    for arguments, says in [
        ((journal, "--policy", bot, "--tick", 14), "--tick is 14; the seat was asked for orders at ticks 0 to 13"),
        ((cut, "--policy", bot, "--tick", 13), "at ticks 0 to 12, and what came after is not recorded"),
        ((tmp_path / "short.journal", "--policy", bot), "within its header"),
        ((bot, "--policy", bot), "this is not a journal"),
        ((journal, "--policy", other), "no seat is other in "),
        ((transcript, "--policy", bot, "--team", "red"), "--team is for journals"),
        ((journal, "--policy", bot, "--team", "green"), "--team is 'green'; it must be blue or red"),
        ((journal, "--policy", tmp_path / "absent.py"), "absent.py"),
        ((tmp_path / "absent.journal", "--policy", bot), "No such file or directory"),
    ]:
        code, lines = debug(*arguments)
        assert (code, len(lines)) == (2, 1), lines
        assert says in lines[0]


def test_a_transcript_that_was_cut_short_is_compared_as_far_as_it_goes(debug: Run, bot: Path, transcript: Path) -> None:
    transcript.write_bytes(transcript.read_bytes()[:-200])

    code, lines = debug(transcript, "--policy", bot)

    assert code == 0
    assert lines[0].endswith("13 ticks, and what came after is not recorded")
    assert lines[1] == "its orders are those that were played, at all 13 ticks"
