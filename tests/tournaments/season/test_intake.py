"""Submissions are checked behind the wall, one by one: what passes plays, what does not leaves a sentence."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from authors import BOT, Season, pack

from arena.submission import Submission as Packed
from arena.submission import digest_of
from policies.workers.files import fighter_in
from tournaments.league.season import SeasonTerms
from tournaments.season import intake as intake_module
from tournaments.store.season_store import ACCEPTED, REFUSED, WAITING, Submission

pytestmark = pytest.mark.usefixtures("wall", "compiled")


@pytest.fixture
def season(tmp_path: Path) -> Iterator[Season]:
    season = Season(tmp_path, SeasonTerms())
    with season.store:
        yield season


def submit(season: Season, packed: bytes, entry: str = "ann") -> Submission:
    digest = season.submitted.keep(entry, packed)
    return season.store.submit(season.row, entry=entry, owner="k", digest=digest, n_bytes=len(packed), now_s=season.now_s)


def check_all(season: Season, **changes: object) -> list[Submission]:
    intake = season.intake(**changes)
    while intake.check_next():
        continue
    return season.store.submissions(season.row)


def test_what_passes_its_check_is_the_version_that_plays(season: Season) -> None:
    packed = Packed(
        kind="bot", main="bot.py", files={"bot.py": b"from plan import act\n", "plan.py": BOT, "data/x.bin": b"x"}
    ).pack()
    submit(season, packed)

    [one] = check_all(season)

    assert (one.state, one.number) == (ACCEPTED, 1), one.says
    assert one.report is not None
    assert (one.report["ok"], one.report["bot"], one.report["size_bytes"]) == (True, "ann", len(packed))
    assert one.report["no_wall"] is None
    [version] = [version for version in season.store.versions(season.row) if version.entry == "ann"]
    assert version.fingerprint == digest_of(packed)
    assert fighter_in(season.folder / version.spec).endswith(f"/submissions/{digest_of(packed)}/bot.py")
    assert season.kept() == [digest_of(packed)]


def bot(code: str) -> bytes:
    return pack(code.encode())


BAD = {
    "no Python": (bot("def act(:\n"), "this is not Python"),
    "no bot": (bot("x = 1\n"), "has no bot"),
    "dies at once": (bot("import os\nos._exit(3)\n"), "it cannot start"),
    "dies in a turn": (bot("import os\ndef act(seen):\n    os._exit(3)\n"), "its process ended with exit code 3"),
    "hangs in a turn": (bot("def act(seen):\n    while True: pass\n"), "no answer within 0.5 s"),
    "hangs at once": (bot("while True: pass\n"), "it was not ready after 1 s"),
    "a checkpoint that is none": (Packed(kind="checkpoint", main="a.safetensors", files={"a.safetensors": b"x"}).pack(), ""),
    "a program that is not there": (Packed(kind="program", main="./gone", files={"program": b"./gone"}).pack(), ""),
    "a program that hears one line": (
        Packed(kind="program", main="sh -c 'read line'", files={"program": b""}).pack(),
        "it gave orders in none of its",
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_what_fails_its_check_leaves_a_sentence_and_no_content(what: str, season: Season) -> None:
    packed, says = BAD[what]
    submit(season, packed)

    [one] = check_all(season, patience_s=1.0 if what == "hangs at once" else 20.0)

    assert one.state == REFUSED
    assert says in one.says
    assert one.says.isprintable()
    assert str(season.folder) not in one.says + str(one.report)
    assert season.kept() == []
    assert list(season.store.get("course").definition["entries"]) == ["rush"]


def test_those_behind_a_bomb_are_checked(season: Season, monkeypatch: pytest.MonkeyPatch) -> None:
    """What no upload lets through, and a check that fails for a reason of ours."""
    bomb = submit(season, b"arena submission 1\n\xff\xff\xff\xff", "bomb")
    broken = submit(season, pack(BOT + b"# broken\n"), "broken")
    submit(season, pack(), "good")
    true_check = intake_module.check

    def check(spec: str, *arguments: object, **options: object) -> object:
        if b"# broken" in Path(spec).read_bytes():
            raise ZeroDivisionError
        return true_check(spec, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(intake_module, "check", check)

    found = {one.entry: one for one in check_all(season)}

    assert found["bomb"].id == bomb.id
    assert found["bomb"].says == "the submission names too many files; at most 200 are taken"
    assert found["broken"].id == broken.id
    assert found["broken"].says.startswith("its check failed, and not by what it says of itself")
    assert found["good"].state == ACCEPTED


def test_a_submission_that_was_withdrawn_during_its_check_does_not_play(season: Season) -> None:
    one = submit(season, pack())
    intake = season.intake()
    true_check = intake._check

    def check(given: Submission, folder: Path) -> object:
        season.store.refuse(season.row, one, "it was withdrawn")
        return true_check(given, folder)

    intake._check = check  # type: ignore[assignment, method-assign]

    assert intake.check_next()
    assert [(given.state, given.says) for given in season.store.submissions(season.row)] == [(REFUSED, "it was withdrawn")]
    assert season.kept() == []


def test_one_that_is_withdrawn_as_its_check_ends_does_not_play_and_can_come_again(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = submit(season, pack())
    intake = season.intake()
    true_enter = season.submitted.enter

    def enter(folder: Path, digest: str) -> str:
        season.store.refuse(season.row, one, "it was withdrawn")
        submit(season, pack())
        return true_enter(folder, digest)

    monkeypatch.setattr(season.submitted, "enter", enter)

    assert intake.check_next()
    assert [given.state for given in season.store.submissions(season.row)] == [REFUSED, WAITING]
    assert season.store.find_entry(season.row, "ann") is None
    monkeypatch.undo()
    assert intake.check_next()
    assert [given.state for given in season.store.submissions(season.row)] == [REFUSED, ACCEPTED]


CHECKING = """
import sys
from pathlib import Path
from authors import Season
from tournaments.league.season import SeasonTerms
season = Season(Path(sys.argv[1]), SeasonTerms())
season.intake(patience_s=60.0).check_next()
"""


def test_what_is_checked_by_a_process_that_is_killed_still_waits(season: Season) -> None:
    packed = bot("import time\ntime.sleep(600)\n")
    submit(season, packed)
    command = [sys.executable, "-c", CHECKING, str(season.folder)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    with subprocess.Popen(command, env=environment) as process:
        until_s = time.monotonic() + 60
        while not any(name.startswith("checking-") for name in season.kept()):
            assert process.poll() is None
            assert time.monotonic() < until_s
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
    assert len(season.kept()) == 2
    (season.folder / "submissions" / digest_of(packed)).mkdir()  # as if it had died between two steps

    intake = season.intake(patience_s=1.0)

    assert season.kept() == [f"{digest_of(packed)}.ann.packed"]
    assert [one.state for one in season.store.submissions(season.row)] == [WAITING]
    assert intake.check_next()
    assert [one.state for one in season.store.submissions(season.row)] == [REFUSED]
