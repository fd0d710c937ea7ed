"""Compiling before anybody waits: once for all processes, and not without a word."""

import os
import subprocess
import sys
from pathlib import Path

SCRIPT = """
from arena.compiling import compile_kernels, game_kernels
from arena.game.kernel import draw_boards
from arena.game.ruleset import load

if __name__ == "__main__":
    compile_kernels([kernel for kernel in game_kernels(load("paper")) if kernel.name == "boards"])
    print("compiled" if draw_boards.stats.cache_misses else "loaded")
"""
QUICK = {"NUMBA_OPT": "1", "NUMBA_LOOP_VECTORIZE": "0"}  # that it compiles is looked at, and not how quick the kernels are


def begin(cache: Path) -> subprocess.Popen[str]:
    environment = os.environ | QUICK | {"NUMBA_CACHE_DIR": str(cache)}
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, "-c", SCRIPT], env=environment, stdout=pipe, stderr=pipe, text=True)


def test_two_first_starts_at_once_compile_once(tmp_path: Path) -> None:
    both = [begin(tmp_path), begin(tmp_path)]

    said = [process.communicate(timeout=300) for process in both]

    assert sorted(out for out, _ in said) == ["compiled\n", "loaded\n"]
    assert "compiling the rules and the fighters, once: 1 kernel, about 7 s\n" in [error for _, error in said]
    assert begin(tmp_path).communicate(timeout=300) == ("loaded\n", "")


def test_where_nothing_can_be_kept_kernels_are_compiled_for_this_process(tmp_path: Path) -> None:
    (tmp_path / "file").touch()

    out, error = begin(tmp_path / "file").communicate(timeout=300)

    assert out == "compiled\n"
    assert "1 kernel, about 7 s" in error
    assert f"cannot write to {tmp_path / 'file'}" in error


def test_several_kernels_are_compiled_by_workers_and_loaded_here(tmp_path: Path) -> None:
    script = SCRIPT.replace('kernel.name == "boards"', 'kernel.name in ("boards", "views")')
    environment = os.environ | QUICK | {"NUMBA_CACHE_DIR": str(tmp_path)}

    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, timeout=300, check=False
    )

    assert done.returncode == 0, done.stderr
    assert "2 kernels" in done.stderr
    assert done.stdout == ("loaded\n" if len(os.sched_getaffinity(0)) > 1 else "compiled\n")
