"""`arena play --transcripts`: what each seat of a local match saw and noted, as a client of a pit keeps it."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.game.types import Team
from arena.records.journal_folder import load_journal
from arena.records.transcript import load_transcript
from arena.records.verification import watch

Run = Callable[..., subprocess.CompletedProcess[str]]
BOT = """
def act(observation):
    observation.log("tick", observation.tick)
    return [9] if observation.tick == 4 else [observation.tick % 5] * len(observation.units)
"""
OPTIONS = ("--pairs", 2, "--seed", 3, "--set", "tick_limit=8", "--workers", 1)


@pytest.fixture
def bot(tmp_path: Path) -> Path:
    (tmp_path / "mine.py").write_text(BOT)
    return tmp_path / "mine.py"


def test_both_seats_of_each_match_are_kept_and_the_match_is_the_same(here: Run, bot: Path, tmp_path: Path) -> None:
    alone, kept, seats = (tmp_path / name for name in ("alone", "kept", "seats"))
    assert here("play", bot, "rush", *OPTIONS, "--journals", alone).returncode == 0

    assert here("play", bot, "rush", *OPTIONS, "--journals", kept, "--transcripts", seats).returncode == 0

    assert sorted((path.name, path.read_bytes()) for path in alone.iterdir()) == sorted(
        (path.name, path.read_bytes()) for path in kept.iterdir()
    )
    assert len(list(seats.iterdir())) == 8
    for path in kept.iterdir():
        journal = load_journal(path)
        shown, names = watch(journal), (journal.header.blue, journal.header.red)
        for team in Team:
            transcript = load_transcript(seats / f"{path.stem}+{team.name.lower()}.transcript")
            header = transcript.header
            assert (header.pit, header.match, header.name, header.opponent, header.team) == (
                "local", journal.name, names[team], names[team.other], team,
            )  # fmt: skip
            assert [seen for seen, _ in transcript.ticks] == shown[team][:-1]
            assert journal.ending is not None
            assert transcript.ending == journal.ending.seen_by(team)
            for tick, (_, orders) in enumerate(transcript.ticks):
                is_refused = names[team] == "mine" and tick == 4
                assert journal.keeps(tick, team, orders)
                assert (orders == b"\xff" * 6) == is_refused
                assert transcript.annotations[tick]["log"] == ([f"tick {tick}"] if names[team] == "mine" else [])


def test_a_transcript_of_a_local_match_is_shown_and_debugged(here: Run, bot: Path, tmp_path: Path) -> None:
    here("play", bot, "rush", *OPTIONS, "--transcripts", tmp_path / "seats")
    path = tmp_path / "seats" / "play+mine+rush+0001+mine-blue+0+blue.transcript"

    shown, debugged = here("replay", "show", path, "--tick", 2), here("debug", path, "--policy", bot)

    assert shown.stdout.splitlines()[-1] == "log: tick 2"
    assert debugged.returncode == 0
    assert "tick 4: 1 orders for 6 units; so it was in the match" in debugged.stdout


def test_what_is_not_kept_is_said(here: Run, bot: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    clock = here("play", bot, "rush", "--transcripts", tmp_path / "seats", "--turn-time", 1)
    no_folder = here("play", bot, "rush", "--transcripts", tmp_path / "file")
    cheat = here("play", bot, "oracle_rush", *OPTIONS, "--transcripts", tmp_path / "cheat")

    assert (clock.returncode, no_folder.returncode, cheat.returncode) == (2, 2, 0)
    assert "leave out --turn-time" in clock.stderr
    assert f"cannot keep transcripts in {tmp_path / 'file'}: " in no_folder.stderr
    assert {load_transcript(path).header.name for path in (tmp_path / "cheat").iterdir()} == {"mine"}
