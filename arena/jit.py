"""Compile a kernel with numba, and cache it under a key that notices every change.

numba's own cache looks at the file of the function alone, so a change in a jitted function of another
module would go unnoticed. Here the folder is named after a hash of all sources that a kernel may reach:
the rules of the game, and the kernels of the package that it stands in.
"""

import hashlib
import logging
import os
import tempfile
from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba
from numba import config
from platformdirs import user_cache_path

P = ParamSpec("P")
R = TypeVar("R")
logger = logging.getLogger(__name__)


@cache
def _cache_folder(package: str) -> str | None:
    """Return where the kernels of a package are cached, or None where nothing can be written.

    There numba would go on to its own places, whose keys notice too little.
    """
    digest = hashlib.sha256()
    for name in sorted({"arena", package}):
        spec = find_spec(name)
        for place in (spec.submodule_search_locations if spec else None) or ():
            for source in sorted(Path(place).rglob("*.py")):
                text = source.read_bytes()
                if source.parent.name == "game" or b"import jit" in text:
                    digest.update(source.name.encode() + b"\0" + text)
    root = cache_root()
    return str(root / digest.hexdigest()[:16]) if _can_write(root) else None


def cache_root() -> Path:
    """Return the folder of all kernels: NUMBA_CACHE_DIR, or in the user's cache."""
    return Path(os.environ.get("NUMBA_CACHE_DIR") or user_cache_path("arena") / "kernels")


@cache
def _can_write(root: Path) -> bool:
    try:
        root.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=root).close()
    except OSError as error:
        logger.warning("kernels are compiled anew at each start: cannot write to %s: %s", root, error.strerror)
        return False
    return True


def jit(*, inline: bool = False, keeps_gil: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Compile without the GIL, without Python objects and without numba's runtime: a kernel that allocates does not compile.

    Leaving the runtime out also spares the counting of references, which took most of a tick.

    Parameters
    ----------
    inline
        Make the function part of each caller, so that arguments that are constants there are constants here.
    keeps_gil
        For calls of microseconds: giving the interpreter up and taking it back would take longer.
    """

    def compile_(function: Callable[P, R]) -> Callable[P, R]:
        options: dict[str, Any] = {"nogil": not keeps_gil, "error_model": "numpy", "_nrt": False}
        if inline:
            return numba.njit(forceinline=True, **options)(function)  # type: ignore[no-any-return]
        folder = _cache_folder(function.__module__.partition(".")[0])
        if folder is None:
            return numba.njit(**options)(function)  # type: ignore[no-any-return]
        before, config.CACHE_DIR = config.CACHE_DIR, folder
        try:
            return numba.njit(cache=True, **options)(function)  # type: ignore[no-any-return]
        finally:
            config.CACHE_DIR = before

    return compile_


def compile_for(kernel: Callable[P, R], *arguments: Any) -> Callable[P, R]:
    """Return a kernel compiled for arguments of the types of these, and never ask for the type of any again.

    A kernel that is called as it is looks at the type of each array anew, which takes most of a call of microseconds.
    """
    dispatcher: Any = kernel  # of numba, which `jit` shows as the function that it compiles
    compiled: Callable[P, R] = dispatcher.compile(tuple(map(numba.typeof, arguments)))
    return compiled


def bind(kernel: Callable[..., R], *arguments: Any) -> Callable[[], R]:
    """Return a call of a kernel on these very arguments, compiled by now."""
    return partial(compile_for(kernel, *arguments), *arguments)
