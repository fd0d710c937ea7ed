"""Key files: made whole, for their owner alone, and never written over."""

import multiprocessing
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ec import SECP256R1, generate_private_key
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
)

from arena.errors import KeyFileError
from arena.keyring import files
from arena.protocol.identity import verify

PKCS8 = (Encoding.PEM, PrivateFormat.PKCS8)
KEY = Ed25519PrivateKey.from_private_bytes(bytes(range(32)))
PEM = KEY.private_bytes(*PKCS8, NoEncryption())
LOCKED = KEY.private_bytes(*PKCS8, BestAvailableEncryption(b"word"))
OTHER = generate_private_key(SECP256R1()).private_bytes(*PKCS8, NoEncryption())
PUBLIC = KEY.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
IDENTITY = (files.load, files.load_or_make)
SECRET = (files.load_secret, files.load_or_make_secret)
READ = (*IDENTITY, *SECRET)
MADE = (files.make, files.load_or_make, files.load_or_make_secret)
Use = Callable[[Path], object]

WORKER = """
from pathlib import Path
from arena.keyring.files import load_or_make, load_or_make_secret

found = []
for number in range(rounds):
    barrier.wait(30)
    found.append(load_or_make(Path(folder, f"{number}.key")).public)
    found.append(load_or_make_secret(Path(folder, f"{number}.secret")))
queue.put(found)
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "some.key"


@pytest.fixture(params=[0o000, 0o022, 0o077, 0o777], ids=oct)
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


def write(path: Path, data: bytes, mode: int = 0o600) -> None:
    path.write_bytes(data)
    path.chmod(mode)


def refusal(use: Use, path: Path) -> str:
    with pytest.raises(KeyFileError) as refused:
        use(path)
    assert refused.value.exit_code == 2
    return str(refused.value)


def test_a_made_key_signs_like_the_one_that_is_read_back(path: Path) -> None:
    made = files.make(path)

    read = files.load(path)

    assert (read.public, read.fingerprint) == (made.public, made.fingerprint)
    verify(made.public, "test", b"data", read.sign("test", b"data"))


def test_a_key_is_made_once_and_then_read(path: Path) -> None:
    assert files.load_or_make(path).public == files.load_or_make(path).public == files.load(path).public


def test_a_secret_is_made_once_and_then_read(path: Path) -> None:
    secret = files.load_or_make_secret(path)

    assert len(secret) == 32
    assert files.load_or_make_secret(path) == files.load_secret(path) == secret
    assert len(path.read_text().splitlines()) == 1


def test_every_key_is_another(tmp_path: Path) -> None:
    assert files.make(tmp_path / "1").public != files.make(tmp_path / "2").public
    assert files.load_or_make_secret(tmp_path / "3") != files.load_or_make_secret(tmp_path / "4")


@pytest.mark.parametrize("use", MADE)
@pytest.mark.usefixtures("umask")
def test_files_and_folders_are_their_owners_alone_whatever_the_umask(tmp_path: Path, use: Use) -> None:
    path = tmp_path / "new" / "deep" / "some.key"

    use(path)

    modes = [one.stat().st_mode & 0o777 for one in (path, path.parent, path.parent.parent)]
    assert modes == [0o600, 0o700, 0o700]


@pytest.mark.parametrize("use", MADE)
def test_a_folder_that_is_there_keeps_its_mode_and_no_draft_stays(tmp_path: Path, use: Use) -> None:
    tmp_path.chmod(0o755)

    use(tmp_path / "some.key")

    assert tmp_path.stat().st_mode & 0o777 == 0o755
    assert [one.name for one in tmp_path.iterdir()] == ["some.key"]


def test_a_key_is_not_made_over_another(path: Path) -> None:
    files.make(path)
    before = path.read_bytes()

    assert refusal(files.make, path) == f"{path} is there already and stays as it is; to make another key, name another file"
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("use", IDENTITY)
@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "holds no private key, or not all of one"),
        (b"\xff\x00junk", "holds no private key, or not all of one"),
        *((PEM[:length], "holds no private key, or not all of one") for length in range(10, len(PEM) - 1, 20)),
        (PUBLIC, "holds no private key, or not all of one"),
        (OTHER, "holds a key of another kind; name one that is Ed25519"),
        (LOCKED, "is locked by a password"),
    ],
)
def test_a_file_without_a_whole_ed25519_key_is_refused_and_stays(path: Path, use: Use, data: bytes, sentence: str) -> None:
    write(path, data)

    assert f"{path} {sentence}" in refusal(use, path)
    assert path.read_bytes() == data


@pytest.mark.parametrize("use", SECRET)
@pytest.mark.parametrize("data", [b"", b"\xff\n", b"A" * 42, b"A" * 44 + b"\n", b"A" * 42 + b"B\n", b"A" * 43 + b"\nA\n", PEM])
def test_a_file_without_a_whole_secret_is_refused_untold_and_stays(path: Path, use: Use, data: bytes) -> None:
    write(path, data)

    sentence = f"{path} holds no secret of 43 letters, digits, - and _; name another file, or restore this one"
    assert refusal(use, path) == sentence
    assert path.read_bytes() == data


@pytest.mark.parametrize("use", READ)
@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o601])
def test_a_file_that_others_can_use_is_refused_and_stays(path: Path, use: Use, mode: int) -> None:
    write(path, PEM, mode)

    assert refusal(use, path) == f"{path} can be read by others; chmod 600 it"
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (PEM, mode)


@pytest.mark.parametrize("use", [files.load, files.load_secret])
def test_a_file_that_is_not_there_is_named(path: Path, use: Use) -> None:
    assert refusal(use, path) == f"there is no key file {path}; make one, or name one that is there"
    assert not path.exists()


@pytest.mark.parametrize("use", READ)
def test_a_link_into_nothing_is_not_filled(path: Path, use: Use) -> None:
    path.symlink_to("nowhere")

    assert refusal(use, path).startswith("there is no key file")
    assert not path.exists()


@pytest.mark.parametrize("use", READ)
def test_a_folder_is_no_key(tmp_path: Path, use: Use) -> None:
    assert refusal(use, tmp_path) == f"{tmp_path} is a folder; name a key file"


@pytest.mark.parametrize("use", READ)
def test_a_pipe_is_not_waited_for(path: Path, use: Use) -> None:
    os.mkfifo(path, 0o600)

    assert refusal(use, path) == f"{path} is no file; name a key file"


@pytest.mark.parametrize("use", READ)
@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (PermissionError(13, "Permission denied"), "you may not read the key file {}; ask its owner, or name one of your own"),
        (OSError(5, "Input/output error"), "cannot read the key file {}: Input/output error; name another, or restore this one"),
    ],
)
def test_what_cannot_be_read_is_said(
    monkeypatch: pytest.MonkeyPatch, path: Path, use: Use, error: OSError, sentence: str
) -> None:
    write(path, PEM)

    def fail(*_: object) -> int:
        raise error

    monkeypatch.setattr(os, "open", fail)  # whoever runs the tests may be root, who may read everything

    assert refusal(use, path) == sentence.format(path)
    assert path.read_bytes() == PEM


@pytest.mark.parametrize("use", MADE)
def test_a_full_disk_leaves_nothing(monkeypatch: pytest.MonkeyPatch, path: Path, use: Use) -> None:
    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)

    assert f"cannot make the key file {path}: No space left on device" in refusal(use, path)
    assert list(path.parent.iterdir()) == []


@pytest.mark.parametrize("use", MADE)
@pytest.mark.parametrize("below", ["some.key", "deep/some.key"])
def test_a_file_where_a_folder_should_be_is_said_and_stays(tmp_path: Path, use: Use, below: str) -> None:
    (tmp_path / "file").write_text("kept")

    sentence = refusal(use, tmp_path / "file" / below)

    assert sentence.endswith(f"{tmp_path / 'file'} is no folder; name another, or mend its folder")
    assert (tmp_path / "file").read_text() == "kept"


def test_processes_that_start_at_once_get_the_same_keys(tmp_path: Path, size: Callable[[int, int], int]) -> None:
    spawn, rounds, n_processes = multiprocessing.get_context("spawn"), size(30, 300), 3
    barrier, queue = spawn.Barrier(n_processes), spawn.Queue()
    names = {"barrier": barrier, "queue": queue, "folder": str(tmp_path / "new"), "rounds": rounds}
    workers = [spawn.Process(target=exec, args=(WORKER, names), daemon=True) for _ in range(n_processes)]
    for worker in workers:
        worker.start()

    found = [queue.get(timeout=60) for _ in workers]
    for worker in workers:
        worker.join(60)

    assert found[0] == found[1] == found[2]
    assert len(set(found[0])) == 2 * rounds
    assert len(list((tmp_path / "new").iterdir())) == 2 * rounds
