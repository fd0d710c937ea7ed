"""A backup, restored elsewhere: the same reports, and journals that hold, on each database and from one to the other."""

import io
import json
import os
import re
import stat
import subprocess
import tarfile
from collections.abc import Callable
from pathlib import Path

import pytest
from outcomes import ended

from arena.errors import InputError
from arena.records.journal_bundle import BundleWriter
from arena.records.journal_folder import JournalFolder
from tournaments.backup import back_up, restore
from tournaments.store.store import Store

Run = Callable[..., subprocess.CompletedProcess[str]]
FACTS = {"ruleset": "paper", "rules": "1", "entries": {}, "clock": {}}
MOMENT = re.compile(r"\d{4}-\d\d-\d\d[T ][\d:]+")
"""When a report was printed."""
LEAGUE = 'name = "friday"\npairs = 1\nvenue = "local"\nentries = ["rush", "patrol"]\n'


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Return a folder with keys, a journal, and what only a running process needs."""
    folder = tmp_path / "data"
    (folder / "keys").mkdir(parents=True, mode=0o700)
    (folder / "journals").mkdir()
    key = folder / "keys" / "pit.key"
    key.write_text("private")
    key.chmod(0o600)
    for name in ("one.journal", ".spare-0", ".lock"):
        (folder / "journals" / name).write_text(name)
    return folder


def lay_out(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Return the mode and the content of everything in a folder."""
    return {
        str(path.relative_to(folder)): (stat.S_IMODE(path.stat().st_mode), path.read_bytes() if path.is_file() else b"")
        for path in folder.rglob("*")
        if not path.name.startswith("arena.db")
    }


def members(*named: tuple[str, bytes]) -> bytes:
    """Return a tar.gz."""
    made = io.BytesIO()
    with tarfile.open(fileobj=made, mode="w:gz") as tar:
        for name, content in named:
            info = tarfile.TarInfo(name)
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
    return made.getvalue()


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Play a small league, and return its folder."""
    from commands import run_here

    folder = tmp_path_factory.mktemp("played")
    (folder / "friday.toml").write_text(LEAGUE)
    run_here("tournament", "run", folder / "friday.toml", "--data", folder)
    return folder


def test_a_restored_league_has_the_same_reports_and_journals_that_hold(played: Path, here: Run, tmp_path: Path) -> None:
    made = here("backup", tmp_path / "all.tar.gz", "--data", played)
    restored = tmp_path / "restored"
    laid = here("restore", tmp_path / "all.tar.gz", "--data", restored)

    assert (made.returncode, laid.returncode) == (0, 0), made.stderr + laid.stderr
    assert "private keys are in it" in made.stdout
    assert stat.S_IMODE((tmp_path / "all.tar.gz").stat().st_mode) == 0o600
    for form in ("text", "json", "html"):
        before, after = (
            MOMENT.sub("", here("tournament", "report", "friday", "--format", form, "--data", folder).stdout)
            for folder in (played, restored)
        )
        assert before
        after = after.replace(str(restored), str(played))
        after = after.replace(os.path.relpath(restored), os.path.relpath(played))  # a link shows what is shorter
        assert after == before
    journals = sorted((restored / "journals" / "friday").glob("*.journal"))
    assert len(journals) == 2
    assert here("replay", "verify", "--local", *journals).returncode == 0
    again = here("tournament", "run", restored / "friday.toml", "--data", restored)
    assert again.returncode == 0
    assert len(list((restored / "journals" / "friday").glob("*.journal"))) == 2, "something was played again"


def test_a_bundle_that_grows_meanwhile_comes_back_with_the_journals_that_were_whole(data: Path, tmp_path: Path) -> None:
    with BundleWriter(data / "journals") as writer:
        writer.add([("a", b"one"), ("b", b"other")])
        [bundle] = (data / "journals").glob("*.journals")
        with bundle.open("ab") as file:
            file.write(b"J half of the next")
        back_up(tmp_path / "backup", data, "")
    restore(tmp_path / "backup", tmp_path / "new", "")

    kept = JournalFolder(tmp_path / "new" / "journals")
    assert {identity: kept.read(identity) for identity in kept.bundled()} == {"a": b"one", "b": b"other"}


def test_all_files_come_back_with_their_modes_but_those_of_running_processes(data: Path, tmp_path: Path) -> None:
    (data / "journals" / "elsewhere").symlink_to("/etc/passwd")
    os.mkfifo(data / "pipe")
    before = {
        name: found
        for name, found in lay_out(data / "keys").items() | lay_out(data / "journals").items()
        if name in ("pit.key", "one.journal")
    }

    copied = back_up(tmp_path / "backup", data, "")
    restore(tmp_path / "backup", tmp_path / "new", "")

    assert set(copied.left_out) == {"journals/elsewhere", "pipe"}
    assert (copied.n_files, copied.n_rows) == (2, None)
    assert lay_out(tmp_path / "new") == {
        "keys": (0o700, b""),
        "keys/pit.key": before["pit.key"],
        "journals": (stat.S_IMODE((data / "journals").stat().st_mode), b""),
        "journals/one.journal": before["one.journal"],
    }


@pytest.mark.parametrize("to", ["sqlite", "postgresql"])
def test_a_store_comes_back_on_either_database_and_goes_on(
    store_url: str, to: str, data: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    outcomes = [ended(f"friday/{number}", "a", "b", seats={}, reason="ä\N{SNOWMAN}") for number in range(3)]
    with Store(store_url) as store:
        league = store.enter("friday", FACTS, 1)
        for outcome in outcomes[:2]:
            store.add(league, outcome)
    target = f"sqlite:///{tmp_path / 'other.db'}" if to == "sqlite" else request.getfixturevalue("cluster").make_database()

    back_up(tmp_path / "backup", data, store_url)
    restore(tmp_path / "backup", tmp_path / "new", target)

    with Store(target, make=False) as store:
        assert store.latest() == league
        assert store.outcomes(league) == outcomes[:2]
        assert not store.add(league, outcomes[0])
        assert store.add(league, outcomes[2]), "its rows are numbered on from where they were"
        assert store.enter("saturday", FACTS, 1).id > league.id


@pytest.mark.parametrize("db", ["{data}/arena.db", "./data/arena.db", "sqlite:///{data}/../data/arena.db"])
def test_a_store_in_the_folder_is_no_file_of_it_however_it_is_named(
    db: str, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with Store(str(data / "arena.db")) as store:
        league = store.enter("friday", FACTS, 1)

        copied = back_up(tmp_path / "backup", Path("data"), db.format(data=data))
        restore(tmp_path / "backup", tmp_path / "new", "")

    assert copied.n_files == 2
    with Store(str(tmp_path / "new" / "arena.db"), make=False) as store:
        assert store.latest() == league


def test_a_store_is_backed_up_as_it_stands_at_one_moment(store_url: str, data: Path, tmp_path: Path) -> None:
    from tournaments.store.copies import CopiedStore

    with Store(store_url) as writer, CopiedStore(store_url, make=False) as copied, copied.tables() as (_, tables):
        name, lines = next(tables)
        seen = {name: list(lines)}
        writer.add(writer.enter("friday", FACTS, 1), ended("friday/0", "a", "b", seats={}))
        seen |= {name: list(lines) for name, lines in tables}

    assert {name: len(lines) for name, lines in seen.items()} == dict.fromkeys(seen, 1), "a row stands beside no league"
    assert {"leagues", "matches", "ladder_entries", "ladder_matches"} <= seen.keys()


def test_nothing_is_restored_over_what_is_there(data: Path, tmp_path: Path) -> None:
    back_up(tmp_path / "backup", data, "")
    before = lay_out(data)

    with pytest.raises(InputError, match="is not empty; restore into a new folder"):
        restore(tmp_path / "backup", data, "")
    with pytest.raises(InputError, match=r"cannot write the backup .*: File exists; name another file"):
        back_up(tmp_path / "backup", data, "")
    with pytest.raises(InputError, match=r"lies in .*, which it is a backup of"):
        back_up(data / "backup", data, "")

    assert lay_out(data) == before


def test_a_store_that_holds_results_is_not_restored_over(store_url: str, data: Path, tmp_path: Path) -> None:
    with Store(store_url) as store:
        store.enter("friday", FACTS, 1)
    back_up(tmp_path / "backup", data, store_url)

    with pytest.raises(InputError, match=r"there is a store at .* already"):
        restore(tmp_path / "backup", tmp_path / "new", store_url)

    assert not (tmp_path / "new").exists()


MANIFEST = ("manifest.json", b'{"format": 1, "arena": "9", "store": null}')


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"junk", "is no backup of the arena, or not all of one"),
        (members(("README", b"hello")), "it has no manifest.json"),
        (members(("manifest.json", b"{}")), "is no backup"),
        (
            members(("manifest.json", b'{"format": 9, "arena": "7.0"}')),
            "the backup is of format 9, by arena 7.0; update this one",
        ),
        (members(("manifest.json", b'{"format": 1, "arena": "9", "store": "9999"}')), "by a newer arena; update this one"),
        (members(MANIFEST, ("data/../../evil", b"x")), "it has a member 'data/../../evil'"),
        (members(MANIFEST, ("/etc/evil", b"x")), "it has a member '/etc/evil'"),
        (members(MANIFEST, ("data/one", b"x"), ("data/one", b"y")), "cannot restore into .*: File exists"),
        (members(MANIFEST, ("data/one", b"x" * 9_999))[:-20], "or not all of one"),
        (
            members(("manifest.json", b'{"format": 1, "arena": "9", "store": "0002"}'), ("store/spies", b'["id"]\n')),
            "is no backup of the arena",
        ),
        (
            members(("manifest.json", b'{"format": 1, "arena": "9", "store": "0002"}'), ("store/leagues", b'["id"]\n[1, 2]\n')),
            "is no backup of the arena",
        ),
    ],
)
def test_what_is_no_backup_is_refused_and_leaves_nothing(content: bytes, says: str, tmp_path: Path) -> None:
    (tmp_path / "backup").write_bytes(content)
    (tmp_path / "new").mkdir()

    with pytest.raises(InputError, match=says):
        restore(tmp_path / "backup", tmp_path / "new", "")

    assert list((tmp_path / "new").iterdir()) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["backup", "new"]


def test_a_backup_that_cannot_be_finished_leaves_no_half_of_itself(data: Path, tmp_path: Path) -> None:
    (data / "arena.db").write_text("junk")

    with pytest.raises(InputError, match="not a database"):
        back_up(tmp_path / "backup", data, "")

    assert not (tmp_path / "backup").exists()


def test_the_manifest_tells_what_made_it(data: Path, tmp_path: Path) -> None:
    back_up(tmp_path / "backup", data, "")

    with tarfile.open(tmp_path / "backup") as tar:
        first = tar.next()
        assert first is not None
        content = tar.extractfile(first)
        assert content is not None
        assert json.loads(content.read()).keys() == {"format", "arena", "store"}
