"""`arena submit`, as an author types it, against a season that checks what comes."""

import json
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from zipfile import ZipFile

import pytest
from authors import BOT, Season

from arena.protocol.messages import SeasonAnswer, SeasonRequest
from clients.commands.submit import complete_submission
from tournaments.reports.web_seasons import Seasons

Arena = Callable[..., subprocess.CompletedProcess[str]]
OpenSeason = Callable[..., Season]


@contextmanager
def checking(season: Season) -> Iterator[None]:
    """Check what comes, as a season does that runs."""
    with season.intake(patience_s=60.0) as intake:
        season.on_submission = intake.wake
        yield


def test_an_author_submits_follows_and_takes_back(open_season: OpenSeason, here: Arena, wall: None, tmp_path: Path) -> None:
    season, bot = open_season(), tmp_path / "mine.py"
    to = ("--to", season.address)
    with checking(season):
        bot.write_bytes(BOT)
        first = here("submit", bot, *to)
        bot.write_text("import sys\nsys.exit('\x1b[2J no plan')\n")
        second = here("submit", bot, *to, "--json")

    assert first.returncode == 0, first.stderr
    assert "mine: it waits for its check" in first.stderr
    assert "played behind a wall, under a pit's limits" in first.stdout
    assert first.stdout.splitlines()[-1] == "version 1 of mine plays from now on"
    told = json.loads(second.stdout)
    assert (second.returncode, told["ok"], told["number"], told["entry"]) == (1, False, None, "mine")
    assert "no plan" in told["says"]
    assert told["says"].isprintable()
    assert told["report"]["findings"][0]["sentence"] == told["says"]
    assert "\x1b" not in second.stdout + second.stderr

    mine = ("--name", "mine", *to)
    assert "version 1 of mine plays" in here("submit", "--status", *mine).stdout
    facts = json.loads(here("submit", "--status", *mine, "--json").stdout)
    assert [one["state"] for one in facts["submissions"]] == ["accepted", "refused"]
    (season.logs / "mine.log").write_text("one line\n\x1b[2Janother\n")
    assert here("submit", "--log", *mine).stdout == "one line\n\\x1b[2Janother\n"
    remote = here("submit", "--remote", *mine, "--json")
    assert json.loads(remote.stdout) == {"ok": True, "says": "version 2 of mine plays as soon as it joins"}
    assert here("submit", "--roll-back", 1, *mine).stdout == "version 1 of mine plays from now on\n"
    assert "plays no more" in here("submit", "--withdraw", *mine).stdout


def test_what_the_season_refuses_ends_with_1_and_a_sentence(open_season: OpenSeason, here: Arena, tmp_path: Path) -> None:
    season, bot = open_season(invites=["code"]), tmp_path / "mine.py"
    bot.write_bytes(BOT)

    refused = here("submit", bot, "--to", season.address)

    assert refused.returncode == 1
    assert refused.stderr.splitlines()[-1].endswith(
        "the season says no: this season wants an invite code; submit with --invite CODE"
    )


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("mine.py",), "say where the season is: --to ADDRESS"),
        (("--to", "tcp/127.0.0.1:1"), "name one thing to do"),
        (("mine.py", "--status", "--withdraw", "--to", "tcp/127.0.0.1:1"), "name one thing to do"),
        (("--status", "--to", "tcp/127.0.0.1:1"), "say which entry is meant: --name NAME"),
        (("--status", "--name", "nobody", "--to", "tcp/127.0.0.1:1"), "there is no key file"),
        (("gone.py", "--to", "tcp/127.0.0.1:1"), "cannot submit gone.py: No such file"),
        (("bad.zip", "--to", "tcp/127.0.0.1:1"), "which leads out of its folder"),
        (("mine.txt", "--to", "tcp/127.0.0.1:1"), "mine.txt is no fighter"),
        (("empty", "--to", "tcp/127.0.0.1:1"), "empty holds no fighter"),
    ],
)
def test_what_cannot_be_submitted_ends_with_2_and_a_sentence(
    arguments: tuple[str, ...], says: str, here: Arena, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("mine.py", "mine.txt"):
        Path(name).write_bytes(BOT)
    Path("empty").mkdir()
    with ZipFile("bad.zip", "w") as archive:
        archive.writestr("../bot.py", BOT)

    refused = here("submit", *arguments)

    assert refused.returncode == 2
    assert says in refused.stderr


def test_an_owner_is_given_a_link_that_opens_the_owners_view_of_the_web_page(
    open_season: OpenSeason, here: Arena, monkeypatch: pytest.MonkeyPatch
) -> None:
    season = open_season()
    monkeypatch.setattr(season.owners, "_describe", lambda _: {"page": "http://127.0.0.1:8000"})
    ann = ("--name", "ann", "--to", season.address)
    here("submit", "--remote", *ann)

    page, _, token = here("submit", "--status", *ann).stdout.partition("its page: ")[2].strip().partition("#token=")

    assert page == "http://127.0.0.1:8000/seasons/course/ann"
    seen = Seasons(season.folder, "").own("course", "ann", token, "127.0.0.1:8000")
    assert [one["state"] for one in seen["submissions"]] == ["accepted"]


def test_a_season_that_tells_junk_is_said_to(open_season: OpenSeason, here: Arena, monkeypatch: pytest.MonkeyPatch) -> None:
    season = open_season()

    def lie(request: SeasonRequest, now_s: float) -> SeasonAnswer:
        return SeasonAnswer(text="\x1b[2J", facts={"entry": []})

    monkeypatch.setattr(season.owners, "answer", lie)
    here("keys", "new", "ann")

    told = here("submit", "--status", "--name", "ann", "--to", season.address)

    assert told.returncode == 1
    assert "the season tells of ann in a way that this arena does not read" in told.stderr


def test_the_shell_completes_what_can_be_submitted(tmp_path: Path) -> None:
    for name in ("mine.py", "mine.zip", "mine.txt", "mine.safetensors"):
        (tmp_path / name).touch()
    (tmp_path / "mine").mkdir()

    found = complete_submission(f"{tmp_path}/mi")

    assert [Path(path).name for path in found] == ["mine", "mine.py", "mine.safetensors", "mine.zip"]
