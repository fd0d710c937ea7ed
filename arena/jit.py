"""Compile a kernel with numba, and cache it under a key that notices every change.

numba's own cache looks at the file of the function alone, so a change in a jitted function of another
module would go unnoticed. Here the folder is named after a hash of all sources that a kernel may reach:
the rules of the game, and the kernels of the package that it stands in.
"""

import hashlib
import logging
import os
import pickle
import sys
import uuid
from collections.abc import Callable
from contextlib import suppress
from contextvars import ContextVar
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba
from numba import config
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from platformdirs import user_cache_path

P = ParamSpec("P")
R = TypeVar("R")
logger = logging.getLogger(__name__)
_DIGEST_BYTES = 32
_only_loads: ContextVar[bool] = ContextVar("only_loads", default=False)


class NotCompiledError(LookupError):
    """A kernel is not in the cache, and was not to be compiled."""


class KernelCache(NullCache):  # type: ignore[misc]  # numba's, which has no types
    """The cache of one function: a file for each combination of types, found by its name, written whole and never changed.

    numba's own keeps an index beside the files, which processes that compile at the same time mix up. It does not read where it
    cannot write, and fails on a file that was cut. Here such a file is one that is missing, and a folder that cannot be written
    is still read.
    """

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._function, self._folder = function, folder
        cells = function.__closure__
        closure = b"" if cells is None else dumps(tuple(cell.cell_contents for cell in cells))
        source = Path(function.__code__.co_filename).read_bytes()
        content = (hashlib.sha256(part).hexdigest() for part in (source, function.__code__.co_code, closure))
        line = function.__code__.co_firstlineno
        self._key = (*content, line, sys.implementation.cache_tag, numba.__version__, config.OPT, config.LOOP_VECTORIZE)

    @property
    def cache_path(self) -> str:
        """The folder, as numba's statistics show it."""
        return str(self._folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what the function was compiled to for a signature, or None if it is not there, whole.

        Numba's own cache refreshes the context first, which imports all that numba can compile, SciPy with it, and takes longer
        than all kernels of a match. Nothing that is loaded needs it; compiling does it by itself.

        Raises
        ------
        NotCompiledError
            It is not there, within `load_kernels`.
        """
        try:
            data = self._file(sig, target_context.codegen()).read_bytes()
        except OSError:
            data = b""
        digest, data = data[:_DIGEST_BYTES], data[_DIGEST_BYTES:]
        if hashlib.sha256(data).digest() == digest:
            return CompileResult._rebuild(target_context, *pickle.loads(data))
        if _only_loads.get():
            raise NotCompiledError(self._function.__qualname__)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what the function was compiled to, if the folder lets it."""
        if data.lifted or data.library.has_dynamic_globals:
            return  # it holds addresses of this process
        file, content = self._file(sig, data.codegen), dumps(data._reduce())
        beside = file.with_name(f".{uuid.uuid4().hex}")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            beside.write_bytes(hashlib.sha256(content).digest() + content)
            beside.replace(file)
        except OSError as error:
            with suppress(OSError):
                beside.unlink()
            _warn(self._folder.parent, error.strerror)

    def _file(self, sig: Any, codegen: Any) -> Path:
        key = hashlib.sha256(repr((sig, codegen.magic_tuple(), self._key)).encode()).hexdigest()
        return self._folder / f"{self._function.__qualname__.replace('<locals>.', '')}-{key[:32]}.kernel"


@cache
def _warn(root: Path, why: str) -> None:
    logger.warning("kernels are compiled anew at each start: cannot write to %s: %s", root, why)


@cache
def _cache_folder(package: str) -> Path:
    """Return where the kernels of a package are cached."""
    digest = hashlib.sha256()
    for name in sorted({"arena", package}):
        spec = find_spec(name)
        for place in (spec.submodule_search_locations if spec else None) or ():
            for source in sorted(Path(place).rglob("*.py")):
                text = source.read_bytes()
                if source.parent.name == "game" or source.name == "jit.py" or b"import jit" in text:
                    digest.update(source.name.encode() + b"\0" + text)
    return cache_root() / digest.hexdigest()[:16]


def cache_root() -> Path:
    """Return the folder of all kernels: NUMBA_CACHE_DIR, or in the user's cache."""
    return Path(os.environ.get("NUMBA_CACHE_DIR") or user_cache_path("arena") / "kernels")


def load_kernels(run: Callable[[], object]) -> bool:
    """Run what needs kernels, and return whether all were compiled before; nothing is compiled for it."""
    token = _only_loads.set(True)
    try:
        run()
    except NotCompiledError:
        return False
    finally:
        _only_loads.reset(token)
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
        dispatcher = numba.njit(**options)(function)
        if not config.DISABLE_JIT:
            dispatcher._cache = KernelCache(function, _cache_folder(function.__module__.partition(".")[0]))
        return dispatcher  # type: ignore[no-any-return]

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
