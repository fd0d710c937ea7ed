"""Compiling before anybody waits: once for all processes, and not without a word."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

KERNELS = """
import time
from arena.jit import jit

@jit()
def add_one(number: int) -> int:
    return number + 1

@jit()
def double(number: int) -> int:
    return 2 * number

def prepare_one() -> None:
    add_one(1)
    time.sleep(1)  # as if it took long to compile, so that another process comes meanwhile

def prepare_other() -> None:
    double(1)
"""
SCRIPT = """
import sys
from arena.compiling import Kernel, compile_kernels
from kernels import add_one, prepare_one, prepare_other

if __name__ == "__main__":
    some = {"one": prepare_one, "other": prepare_other}
    compile_kernels([Kernel(name=name, run=some[name], seconds=7) for name in sys.argv[1:]])
    print("compiled" if add_one.stats.cache_misses else "loaded")
"""


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    """A folder for compiled kernels; beside it lies a module with two that compile in no time."""
    (tmp_path / "kernels.py").write_text(KERNELS)
    return tmp_path / "cache"


def begin(cache: Path, *kernels: str) -> subprocess.Popen[str]:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(cache.parent)}
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, "-c", SCRIPT, *kernels], env=environment, stdout=pipe, stderr=pipe, text=True)


def test_two_first_starts_at_once_compile_once(cache: Path) -> None:
    both = [begin(cache, "one"), begin(cache, "one")]

    said = [process.communicate(timeout=300) for process in both]

    assert sorted(out for out, _ in said) == ["compiled\n", "loaded\n"]
    assert "compiling the rules and the fighters, once: 1 kernel, about 7 s\n" in [error for _, error in said]
    assert begin(cache, "one").communicate(timeout=300) == ("loaded\n", "")


def test_where_nothing_can_be_kept_kernels_are_compiled_for_this_process(cache: Path) -> None:
    cache.touch()

    out, error = begin(cache, "one").communicate(timeout=300)

    assert out == "compiled\n"
    assert "1 kernel, about 7 s" in error
    assert f"cannot write to {cache}" in error


def test_several_kernels_are_compiled_by_workers_and_loaded_here(cache: Path) -> None:
    out, error = begin(cache, "one", "other").communicate(timeout=300)

    assert "2 kernels" in error
    assert out == ("loaded\n" if len(os.sched_getaffinity(0)) > 1 else "compiled\n")
