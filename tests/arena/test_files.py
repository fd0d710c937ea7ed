"""Files that a stranger may have made."""

import os
import socket
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.files import check_file, read_file, read_text

Run = Callable[..., subprocess.CompletedProcess[str]]


def pipe(path: Path) -> None:
    os.mkfifo(path)


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(30 << 30)


def dangling(path: Path) -> None:
    path.symlink_to(path.parent / "nowhere")


BAD = {
    pipe: "it is a pipe, not a file",
    endless: "it is a device, not a file",
    sparse: "it is larger than ",
    dangling: "No such file or directory",
}


@pytest.mark.parametrize(("make", "sentence"), BAD.items())
@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("x.journal", "replay verify"),
        ("x.journal", "replay show"),
        ("x.journal", "replay export --png"),
        ("x.transcript", "replay show"),
        ("rules.toml", "rules"),
        ("league.toml", "tournament run"),
        ("bot.py", "play rush"),
        ("net.safetensors", "play rush"),
        ("board.txt", "play rush rush --board"),
    ],
)
def test_a_file_that_is_none_is_one_sentence(
    here: Run, tmp_path: Path, name: str, command: str, make: Callable[[Path], None], sentence: str
) -> None:
    make(tmp_path / name)

    done = here(*command.split(), tmp_path / name)

    assert done.returncode == (1 if command == "replay verify" else 2)
    said = " ".join((done.stdout + done.stderr).split())
    assert sentence in said
    assert str(tmp_path / name) in said
    assert "Traceback" not in said


def test_a_file_within_its_bounds_is_read(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"1234\r\n")

    assert read_file(path, 6) == b"1234\r\n"
    assert read_text(path) == "1234\n"
    assert check_file(path, 6) == 6
    for use in (read_file, check_file):
        with pytest.raises(OSError, match="it is larger than 5 bytes"):
            use(path, 5)


def test_a_file_that_says_it_is_empty_is_read_up_to_its_bound() -> None:
    assert Path("/proc/self/status").stat().st_size == 0
    assert read_file(Path("/proc/self/status")).startswith(b"Name:")
    with pytest.raises(OSError, match="it is larger than 10 bytes"):
        read_file(Path("/proc/self/status"), 10)


def test_a_socket_is_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        with pytest.raises(OSError, match="it is a socket, not a file"):
            check_file(tmp_path / "socket", 5)
