"""What a seat keeps of a match over the network, beside the pit's journal of it."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from commands import ARENA

from arena.game.types import Team
from arena.records.journal import Journal
from arena.records.journal_folder import load_journal
from arena.records.transcript import Transcript, load_transcript
from arena.records.verification import Standing, check_seals, compare

Start = Callable[..., Any]
Run = Callable[..., subprocess.CompletedProcess[str]]
BOT = '''
"""Thinks at one tick until there is a file to go on."""

import threading
from pathlib import Path


class Bot:
    def act(self, observation):
        if observation.tick == 8 and not Path({go!r}).exists():
            print("thinking", flush=True)
            while not Path({go!r}).exists():
                threading.Event().wait(0.05)
        return [observation.tick % 5] * len(observation.units)
'''
TELLER = """
from arena.annotations import Annotations
from policies.heuristics.rush import Rush


class Teller(Rush):
    def take_annotations(self, seat):
        notes = Annotations(self.ruleset.side)
        notes.log("explains" if self.explains else "is silent")
        return notes.pack()
"""


def journals(folder: Path) -> dict[str, Path]:
    """Return the journals of a pit, by match."""
    return {load_journal(path).name: path for path in (folder / "journals").glob("*.journal")}


def transcripts(folder: Path) -> dict[str, Path]:
    """Return the transcripts of a client, by match."""
    return {load_transcript(path).header.match: path for path in (folder / "transcripts").iterdir()}


def check_whole(transcript: Transcript, journal: Journal, team: Team) -> None:
    """Check that a transcript leaves out nothing of the match."""
    assert transcript.header.team is team
    assert transcript.is_whole
    assert transcript.ending is not None
    assert len(transcript.ticks) == len(journal.ticks)
    assert compare(journal, transcript) == ""
    checked = check_seals(journal)
    assert checked is not None
    assert (checked.commitment, checked.signature) == (Standing.HOLDS, Standing.HOLDS)
    assert checked.receipts == {Team.BLUE: Standing.HOLDS, Team.RED: Standing.HOLDS}


def test_a_seat_s_transcript_shows_its_match_and_is_checked_against_the_journal(
    serve: Start, join: Start, arena: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Red's fighter is of an installed package, and explains itself."""
    (tmp_path / "teller.py").write_text(TELLER)
    (tmp_path / "teller-1.dist-info").mkdir()
    (tmp_path / "teller-1.dist-info" / "METADATA").write_text("Name: teller\nVersion: 1\n")
    (tmp_path / "teller-1.dist-info" / "entry_points.txt").write_text("[arena.policies]\nteller = teller:Teller\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    pit = serve("--matches", 2)
    homes = {team: tmp_path / team.name for team in Team}
    players = [
        join("--team", "blue", "--policy", "roomba", "--matches", 2, "--data", homes[Team.BLUE]),
        join("--team", "red", "--policy", "teller", "--explain", "--matches", 2, "--data", homes[Team.RED], code=ARENA),
    ]
    assert [process.finish() for process in (*players, pit)] == [0, 0, 0]

    written = journals(tmp_path)
    kept = {team: transcripts(home) for team, home in homes.items()}
    assert len(written) == 2
    for team, player in zip(Team, players, strict=True):
        assert kept[team].keys() == written.keys()
        for match, path in written.items():
            check_whole(load_transcript(kept[team][match]), load_journal(path), team)
            said = f"match {match}: the journal is of this match, under the keys that the pit committed itself to\n"
            assert said in player.said

    one, other = written
    journal = load_journal(written[one])
    shown = arena("replay", "show", kept[Team.RED][one])
    assert (shown.returncode, shown.stderr) == (0, "")
    assert shown.stdout.startswith(f"pit pit, match {one}: teller plays red against roomba\n")
    assert shown.stdout.count("log: explains\n") == len(journal.ticks)
    titles = re.findall(r"^tick (\d+) of 100   score", shown.stdout, flags=re.MULTILINE)
    assert titles == [str(tick) for tick in range(len(journal.ticks))]
    assert journal.ending is not None
    word = "draw" if journal.ending.winner is None else "win" if journal.ending.winner is Team.RED else "loss"
    assert f"{word} as red by" in shown.stdout.splitlines()[-1]

    holds = arena("replay", "verify", written[one], "--transcript", kept[Team.BLUE][one])
    differs = arena("replay", "verify", written[one], "--transcript", kept[Team.BLUE][other])
    assert (holds.returncode, holds.stderr) == (0, "")
    assert "by pit, blue and red" in holds.stdout
    assert "1 of 1 journals hold" in holds.stdout
    assert differs.returncode == 1
    assert f"the transcript is of match {other}, the journal of {one}" in re.sub(r"\s+", " ", differs.stdout)
    assert "0 of 1 journals hold" in differs.stdout


def test_a_client_that_was_killed_and_came_back_has_a_whole_transcript(serve: Start, join: Start, tmp_path: Path) -> None:
    bot, go, home = tmp_path / "slow.py", tmp_path / "go", tmp_path / "home"
    bot.write_text(BOT.format(go=str(go)))
    pit = serve("--matches", 1, "--turn-time", 60)
    enemy = join("--team", "red", "--policy", "patrol", "--no-transcripts", "--no-audit", "--data", tmp_path / "enemy")
    first = join("--team", "blue", "--policy", bot, "--data", home).wait_for("thinking")

    first.kill()
    go.touch()
    second = join("--policy", bot, "--data", home)

    assert [process.finish() for process in (second, enemy, pit)] == [0, 0, 0]
    (journal,) = map(load_journal, journals(tmp_path).values())
    kept = [load_transcript(path) for path in sorted((home / "transcripts").iterdir())]
    ended = [transcript for transcript in kept if transcript.ending is not None]
    assert (len(kept), len(ended)) == (2, 1), "each process keeps its own, and one saw the end"
    check_whole(ended[0], journal, Team.BLUE)
    assert "the journal is of this match" in second.said
    assert "the journal is" not in enemy.said
    assert not (tmp_path / "enemy").exists()
