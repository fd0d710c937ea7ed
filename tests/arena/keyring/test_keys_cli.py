"""`arena keys`: what it prints, and how it refuses."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from arena.errors import InputError
from arena.keyring.cli import complete_entry, complete_pit
from arena.keyring.files import load
from arena.keyring.known_pits import check_pit, known_pits
from arena.keyring.ring import config_folder, entry_key_path, list_entries
from tournaments.cli import main

Run = Callable[..., SimpleNamespace]
PIT, PUBLIC = "127.0.0.1:7447/pit", bytes(range(32))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ARENA_CONFIG", str(tmp_path / "config"))
    return tmp_path / "config" / "keys"


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run `arena keys ...`."""

    def run(*arguments: str) -> SimpleNamespace:
        monkeypatch.setattr(sys, "argv", ["arena", "keys", *arguments])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ending:
            main()
        said = capsys.readouterr()
        return SimpleNamespace(code=ending.value.code, out=said.out, err=said.err)

    return run


def test_a_new_key_is_shown_and_kept(run: Run, folder: Path) -> None:
    done = run("new", "alice")

    key = load(folder / "alice.key")
    assert (done.code, done.err) == (0, "")
    assert done.out == f"name: alice\npublic key: {key.fingerprint}\nfile: {folder / 'alice.key'}\n"
    assert run("show", "alice").out == done.out
    assert folder.stat().st_mode & 0o777 == 0o700


def test_show_without_a_name_shows_every_one(run: Run) -> None:
    texts = [run("new", name).out for name in ("alice", "bob")]

    assert run("show").out == "\n".join(texts)


def test_json_has_the_same_facts(run: Run, folder: Path) -> None:
    run("new", "alice")
    (folder / "bob.key").mkdir()

    alice, bob = json.loads(run("list", "--json").out)

    path = folder / "alice.key"
    assert alice == {"name": "alice", "public_key": load(path).fingerprint, "file": str(path), "wrong": None}
    assert (bob["name"], bob["public_key"], bob["file"]) == ("bob", None, str(folder / "bob.key"))
    assert bob["wrong"] == f"{folder / 'bob.key'} is a folder; name a key file"
    assert json.loads(run("show", "--json").out) == [alice, bob]
    assert json.loads(run("show", "alice", "--json").out) == alice


def test_list_says_what_is_wrong_with_a_key(run: Run, folder: Path) -> None:
    run("new", "alice")
    for name in ("bob.key", "my bot.key", ".carol.key.x.draft", "notes.txt"):
        (folder / name).write_text("junk")

    done = run("list")

    assert (done.code, done.err) == (0, "")
    assert load(folder / "alice.key").fingerprint in done.out
    assert f"{folder / 'bob.key'} can be read by others; chmod 600 it" in done.out
    assert "the entry's name is 'my bot'; it must be 1 to 64 letters, digits, - or _" in done.out
    assert not {"carol", "notes"} & set(done.out.replace(".", " ").split())


def test_a_file_whose_name_is_no_text_is_listed(run: Run, folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "caf\udce9.key").touch()

    assert "the entry's name is 'caf?'" in run("list").out


def test_without_keys_it_says_how_to_make_one(run: Run) -> None:
    done = run("list", "--json")

    assert (done.code, json.loads(done.out)) == (0, [])
    assert done.err == "no entry has a key yet; to make one: arena keys new NAME\n"


@pytest.mark.parametrize("name", ["../alice", "/tmp/alice", "a/b", "..", ".", "", "a.b", "a b", "a\n", "é", "a" * 65])
def test_a_name_that_reaches_outside_the_folder_is_refused(run: Run, folder: Path, name: str) -> None:
    done = run("new", name)

    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("arena: the entry's name is ")
    assert not folder.parent.exists()
    with pytest.raises(InputError):
        entry_key_path(name)


def test_refusals_are_one_sentence_and_exit_code_2(run: Run, folder: Path) -> None:
    said = {"none": run("show", "alice"), "no pit": run("forget", PIT)}
    run("new", "alice")
    check_pit(PIT, PUBLIC, None)
    before = (folder / "alice.key").read_bytes()
    said |= {"twice": run("new", "alice"), "alise": run("show", "alise"), "pitt": run("forget", PIT + "t")}
    (folder / "alice.key").chmod(0o644)
    said["open"] = run("show", "alice")

    assert {name: done.err for name, done in said.items()} == {
        "none": f"arena: there is no key file {folder / 'alice.key'}; make one, or name one that is there\n",
        "no pit": f"arena: no pit is known, so '{PIT}' is none to forget\n",
        "twice": f"arena: {folder / 'alice.key'} is there already and stays as it is; to make another key, name another file\n",
        "alise": "arena: unknown entry 'alise'; did you mean 'alice'?\n",
        "pitt": f"arena: unknown pit '{PIT}t'; did you mean '{PIT}'?\n",
        "open": f"arena: {folder / 'alice.key'} can be read by others; chmod 600 it\n",
    }
    assert {(done.code, done.out) for done in said.values()} == {(2, "")}
    assert (folder / "alice.key").read_bytes() == before


SOCKET = "/run/pit.sock/pit"


@pytest.mark.parametrize(
    ("word", "where"),
    [
        (PIT, PIT),
        (f"arena://{PIT}", PIT),
        (f"arena://{PIT}#{'A' * 43}", PIT),
        (f"arena+tls://{PIT}#{'A' * 43}", PIT),
        (f"arena+quic://{PIT}", PIT),
        (f"arena+unix://{SOCKET}", SOCKET),
    ],
)
def test_a_pit_is_forgotten_by_its_address_too(run: Run, word: str, where: str) -> None:
    check_pit(where, PUBLIC, None)

    done = run("forget", word)

    assert (done.code, done.out) == (0, f"forgot the pit at {where}; the key that it has next time is trusted\n")
    assert known_pits() == {}


def test_names_are_completed(run: Run, folder: Path) -> None:
    assert complete_entry("") == complete_pit("") == []
    run("new", "alice")
    run("new", "bob")
    check_pit(PIT, PUBLIC, None)

    assert (complete_entry("al"), complete_pit("127"), complete_pit("x")) == (["alice"], [PIT], [])
    (folder.parent / "known_pits").write_text("junk")
    assert complete_pit("127") == []


def test_a_folder_of_keys_that_is_a_file_is_said(run: Run, folder: Path) -> None:
    folder.parent.mkdir()
    folder.write_text("kept")

    done = run("list")

    assert (done.code, done.err) == (2, f"arena: cannot list the keys in {folder}: Not a directory; mend the folder\n")
    assert folder.read_text() == "kept"


def test_the_folder_is_the_users_own_unless_the_environment_says_another(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert config_folder() == tmp_path / "config"
    assert list_entries() == []

    monkeypatch.delenv("ARENA_CONFIG")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    assert config_folder().is_relative_to(tmp_path)
    assert config_folder().name == "arena"


def test_importing_the_commands_loads_nothing_heavy() -> None:
    code = "import sys, arena.keyring.cli; print('loaded', *{'numpy', 'cryptography', 'zenoh', 'numba'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)

    assert done.stdout.split() == ["loaded"]
