"""Where compiled kernels are kept, and when they are loaded."""

import logging
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from arena import jit

Place = Callable[[object], None]
COUNT = """
import logging, sys
logging.basicConfig(format="%(message)s")
import numpy as np
from arena.game.kernel import draw_seeds
draw_seeds(np.zeros((1, 2), np.uint32), np.zeros(1, np.int32), np.zeros(1, np.uint64))
print("loaded" if draw_seeds.stats.cache_hits else "compiled")
"""
"""Runs a small kernel of the game, and says where it came from."""
UNSHARE = ("unshare", "--mount", "--map-root-user")


def add_one(number: int) -> int:
    return number + 1


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch) -> Iterator[Place]:
    """Put the cache elsewhere."""

    def put(folder: object) -> None:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
        forget()

    def forget() -> None:
        jit._cache_folder.cache_clear()
        jit._warn.cache_clear()

    yield put
    forget()


def count(cache: Path, *wall: str, script: str = COUNT) -> subprocess.CompletedProcess[str]:
    """Run the kernel in a process of its own, behind a wall if there is one."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    command = [*wall, sys.executable, "-c", script]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)


def read_only(folder: Path) -> list[str]:
    """Return what begins a command for which a folder cannot be written, not even by root."""
    bwrap = ["bwrap", "--bind", "/", "/", "--dev-bind", "/dev", "/dev", "--ro-bind", str(folder), str(folder)]
    script = 'mount --bind "$0" "$0" && mount -o remount,bind,ro "$0" && exec "$@"'
    unshare = [*UNSHARE, "sh", "-c", script, str(folder)]
    for wall in (bwrap, unshare):
        if shutil.which(wall[0]) and not subprocess.run([*wall, "true"], capture_output=True, check=False).returncode:
            return wall
    pytest.skip("neither bwrap nor unshare can mount a folder read-only here")


def test_a_kernel_is_kept_under_the_folder_that_was_named(place: Place, tmp_path: Path) -> None:
    place(tmp_path)

    compiled = jit.jit()(add_one)

    assert compiled(1) == 2
    assert len(list(tmp_path.rglob("*.kernel"))) == 1


def test_a_kept_kernel_is_loaded_and_another_type_compiled(place: Place, tmp_path: Path) -> None:
    place(tmp_path)
    jit.jit()(add_one)(1)

    again = jit.jit()(add_one)

    assert (again(1), again(1.5)) == (2, 2.5)
    assert [sum(again.stats.cache_hits.values()), sum(again.stats.cache_misses.values())] == [1, 1]  # type: ignore[attr-defined]


def test_what_is_loaded_imports_nothing_that_only_compiling_needs(tmp_path: Path) -> None:
    """In most processes of the arena, that took longer than all else at their start."""
    script = COUNT + 'print(*sorted({"numba.np.linalg", "scipy.linalg"} & set(sys.modules)))'

    told = [count(tmp_path, script=script).stdout.splitlines() for _ in range(2)]

    assert told[0][0] == "compiled"
    assert "numba.np.linalg" in told[0][1]
    assert told[1] == ["loaded", ""]


@pytest.mark.parametrize("kept", [b"", b"garbage", None], ids=["empty", "garbage", "cut"])
def test_a_file_that_is_not_whole_is_compiled_anew(place: Place, tmp_path: Path, kept: bytes | None) -> None:
    place(tmp_path)
    jit.jit()(add_one)(1)
    (file,) = tmp_path.rglob("*.kernel")
    whole = file.read_bytes()
    file.write_bytes(whole[:-100] if kept is None else kept)

    broken, repaired = jit.jit()(add_one), jit.jit()(add_one)

    assert (broken(1), repaired(1)) == (2, 2)
    assert broken.stats.cache_misses  # type: ignore[attr-defined]
    assert repaired.stats.cache_hits  # type: ignore[attr-defined]


def test_processes_that_compile_at_once_keep_every_type(tmp_path: Path) -> None:
    """With an index beside the files, the last who wrote it lost, or mixed up, what the others had compiled."""
    script = "import sys, numpy; from arena import jit; from arena.game.kernel import draw_seeds as kernel\n"
    script += "types = [numpy.zeros(1, kind) for kind in ('i1', 'i2', 'i4', 'i8')][::int(sys.argv[1])]\n"
    script += "sys.stdin.read()\n"
    script += "for ticks in types: kernel(numpy.zeros((1, 2), 'u4'), ticks, numpy.zeros(1, 'u8'))\n"
    script += "print(sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values()))"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}

    def start(order: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", script, str(order)]
        return subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    processes = [start(1), start(-1)]
    for process in processes:
        assert process.stdin is not None
        process.stdin.close()
    assert [process.wait(300) for process in processes] == [0, 0]
    for process in processes:
        assert process.stdout is not None
        process.stdout.close()

    after = start(1)

    assert after.communicate(timeout=300)[0] == "4 0\n"


def test_a_folder_that_cannot_be_written_means_no_cache_and_one_warning(
    place: Place, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    place(tmp_path / "file")

    with caplog.at_level(logging.WARNING):
        kernels = [jit.jit()(add_one) for _ in range(3)]
        assert [kernel(1) for kernel in kernels] == [2, 2, 2]

    assert [record.getMessage() for record in caplog.records] == [
        f"kernels are compiled anew at each start: cannot write to {tmp_path / 'file'}: Not a directory"
    ]


def test_a_folder_that_can_only_be_read_is_read(tmp_path: Path) -> None:
    wall = read_only(tmp_path)
    assert count(tmp_path).stdout == "compiled\n"

    again = count(tmp_path, *wall)

    assert (again.stdout, again.stderr) == ("loaded\n", "")


def test_what_a_folder_that_can_only_be_read_lacks_is_compiled_for_this_process(tmp_path: Path) -> None:
    lacking = count(tmp_path, *read_only(tmp_path))

    assert lacking.stdout == "compiled\n"
    assert lacking.stderr == f"kernels are compiled anew at each start: cannot write to {tmp_path}: Read-only file system\n"
    assert not list(tmp_path.iterdir())


def test_whether_kernels_are_there_is_told_without_compiling_any(place: Place, tmp_path: Path) -> None:
    place(tmp_path)
    there, missing = jit.jit()(add_one), jit.jit()(add_one)

    assert not jit.load_kernels(lambda: missing(1))
    assert not missing.stats.cache_misses  # type: ignore[attr-defined]
    assert there(np.int64(1)) == 2
    assert jit.load_kernels(lambda: missing(1))
