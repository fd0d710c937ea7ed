"""Trust at first use: a pit is remembered, and another key under its name refused."""

import multiprocessing
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from arena.errors import InputError, KeyFileError, UnknownNameError
from arena.keyring.known_pits import check_pit, forget, known_pits
from arena.protocol.identity import Identity, to_text

PIT = "127.0.0.1:7447/pit"
OLD, NEW = (Identity(Ed25519PrivateKey.from_private_bytes(bytes([n]) * 32)).public for n in range(2))

WORKER = """
import os
os.environ["ARENA_CONFIG"] = folder
from arena.errors import KeyFileError
from arena.keyring.known_pits import check_pit, forget

found = []
for number in range(rounds):
    barrier.wait(30)
    try:
        found.append(check_pit(f"host:{number}/pit", public, None))
    except KeyFileError:
        found.append("refused")
    check_pit(f"{me}:{number}/pit", public, None)
    if number % 2:
        forget(f"{me}:{number}/pit")
queue.put((me, found))
"""


@pytest.fixture(autouse=True)
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ARENA_CONFIG", str(tmp_path / "config"))
    return tmp_path / "config" / "known_pits"


def refusal(where: str, public: bytes, expected: bytes | None = None) -> str:
    with pytest.raises(KeyFileError) as refused:
        check_pit(where, public, expected)
    assert refused.value.exit_code == 2
    return str(refused.value)


def test_a_pit_is_new_once(file: Path) -> None:
    assert check_pit(PIT, OLD, None) is True
    assert check_pit(PIT, OLD, None) is False
    assert check_pit(PIT, OLD, OLD) is False
    assert file.read_text() == f"{PIT} {to_text(OLD)}\n"
    assert (file.stat().st_mode & 0o777, file.parent.stat().st_mode & 0o777) == (0o600, 0o700)


def test_an_address_with_the_right_key_is_believed_and_nothing_remembered(file: Path) -> None:
    assert check_pit(PIT, OLD, OLD) is False
    assert not file.exists()

    check_pit(PIT, OLD, None)
    assert check_pit(PIT, NEW, NEW) is False
    assert known_pits() == {PIT: OLD}


def test_a_key_that_the_address_does_not_name_is_refused_and_not_remembered(file: Path) -> None:
    sentence = refusal(PIT, NEW, OLD)

    assert sentence.startswith(f"the pit at {PIT} has the key {to_text(NEW)}, the address says {to_text(OLD)}: ")
    assert not file.exists()


def test_a_changed_key_is_refused_until_the_old_one_is_forgotten(file: Path) -> None:
    check_pit(PIT, OLD, None)
    before = file.read_bytes()

    sentence = refusal(PIT, NEW)

    assert sentence.startswith(f"the key of the pit at {PIT} has changed from {to_text(OLD)} to {to_text(NEW)}: ")
    assert sentence.endswith(f"if the new key is right: arena keys forget {PIT}")
    assert file.read_bytes() == before
    forget(PIT)
    assert check_pit(PIT, NEW, None) is True


@pytest.mark.parametrize("other", ["127.0.0.1:7447/other", "127.0.0.1:7448/pit", "127.0.0.2:7447/pit", "[::1]:7447/pit"])
def test_every_pit_has_its_own_key(other: str) -> None:
    check_pit(PIT, OLD, None)

    assert check_pit(other, NEW, None) is True
    assert known_pits() == {PIT: OLD, other: NEW}


@pytest.mark.parametrize("before", [b"# mine\n\n", b"# caf\xe9\r\n", f"a:1/pit {to_text(NEW)}".encode()])
def test_what_else_stands_in_the_file_is_kept(file: Path, before: bytes) -> None:
    file.parent.mkdir()
    file.write_bytes(before)

    check_pit(PIT, OLD, None)
    assert file.read_bytes() == before.removesuffix(b"\n") + f"\n{PIT} {to_text(OLD)}\n".encode()
    forget(PIT)
    assert file.read_bytes() == before.removesuffix(b"\n") + b"\n"


def test_a_linked_file_stays_a_link(file: Path, tmp_path: Path) -> None:
    file.parent.mkdir()
    file.symlink_to(tmp_path / "elsewhere")

    check_pit(PIT, OLD, None)

    assert file.is_symlink()
    assert (tmp_path / "elsewhere").read_text() == f"{PIT} {to_text(OLD)}\n"


@pytest.mark.parametrize(
    "line",
    [
        b"nonsense",
        PIT.encode(),
        f"{PIT} {to_text(OLD)[:-1]}".encode(),
        f"{PIT} {to_text(OLD)} more".encode(),
        f"pit {to_text(OLD)}".encode(),
        f"caf\xe9/pit {to_text(OLD)}".encode("latin-1"),
        f"{PIT} {'é' * 43}".encode(),
    ],
)
@pytest.mark.parametrize("use", [lambda: check_pit(PIT, OLD, None), lambda: forget(PIT), known_pits])
def test_a_malformed_line_is_named_by_its_number_and_stays(file: Path, line: bytes, use: Callable[[], object]) -> None:
    file.parent.mkdir()
    file.write_bytes(before := f"# mine\na:1/pit {to_text(NEW)}\n".encode() + line + b"\n")

    with pytest.raises(KeyFileError, match=f"^line 3 of {file} is not HOST:PORT/PIT PUBLICKEY; mend or remove it$"):
        use()

    assert file.read_bytes() == before


def test_two_keys_for_one_pit_are_refused(file: Path) -> None:
    file.parent.mkdir()
    file.write_text(f"{PIT} {to_text(OLD)}\n{PIT} {to_text(OLD)}\n{PIT} {to_text(NEW)}\n")

    assert refusal(PIT, OLD) == f"line 3 of {file} gives {PIT} another key than a line before; remove one of them"


@pytest.mark.parametrize(
    "where", ["", "pit", "a b:1/pit", "#a:1/pit", "a:1/", "a:1/p/../x y", "a:1/pit\n", "a:1\x1b/pit", "a:1/p.t"]
)
def test_what_is_no_pit_is_refused_and_not_written(file: Path, where: str) -> None:
    with pytest.raises(InputError, match="is no pit; write HOST:PORT/PIT"):
        check_pit(where, OLD, None)

    assert not file.exists()


def test_an_unknown_pit_cannot_be_forgotten(file: Path) -> None:
    with pytest.raises(InputError, match="no pit is known, so 'a:1/pit' is none to forget"):
        forget("a:1/pit")
    assert not file.parent.exists()

    check_pit(PIT, OLD, None)
    with pytest.raises(UnknownNameError, match=f"did you mean '{PIT}'"):
        forget(PIT + "t")
    assert known_pits() == {PIT: OLD}


def test_a_file_that_is_a_folder_is_said(file: Path) -> None:
    file.mkdir(parents=True)

    assert refusal(PIT, OLD) == f"cannot read the known pits in {file}: Is a directory; mend that file"


def test_a_folder_that_is_a_file_is_said(file: Path) -> None:
    file.parent.write_text("kept")

    assert refusal(PIT, OLD).startswith(f"cannot read the known pits in {file}: Not a directory")
    assert file.parent.read_text() == "kept"


def test_a_full_disk_loses_nothing(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_pit("a:1/pit", NEW, None)
    before = file.read_bytes()

    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)

    assert refusal(PIT, OLD).startswith(f"cannot write the known pits in {file}: No space left on device")
    assert file.read_bytes() == before
    assert sorted(path.name for path in file.parent.iterdir()) == ["known_pits", "known_pits.lock"]


def test_of_two_processes_one_is_first_and_no_line_is_lost(tmp_path: Path, size: Callable[[int, int], int]) -> None:
    spawn, rounds = multiprocessing.get_context("spawn"), size(30, 300)
    barrier, queue = spawn.Barrier(2), spawn.Queue()
    keys = {"one": OLD, "two": NEW}
    workers = []
    for me, public in keys.items():
        folder = str(tmp_path / "config")
        names = {"barrier": barrier, "queue": queue, "folder": folder, "rounds": rounds, "me": me, "public": public}
        workers.append(spawn.Process(target=exec, args=(WORKER, names), daemon=True))
        workers[-1].start()

    found = dict(queue.get(timeout=60) for _ in workers)
    for worker in workers:
        worker.join(60)

    known = known_pits()
    for number in range(rounds):
        assert {found["one"][number], found["two"][number]} == {True, "refused"}
        first = "one" if found["one"][number] is True else "two"
        assert known.pop(f"host:{number}/pit") == keys[first]
    assert known == {f"{me}:{number}/pit": keys[me] for me in keys for number in range(0, rounds, 2)}
