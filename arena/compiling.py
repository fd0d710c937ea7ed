"""Compile kernels before anybody waits for them, once for all processes of a machine's user, on all cores, and say so."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial

from filelock import FileLock, Timeout

from arena.console import compiling_bar
from arena.game.engine import prepare_boards, prepare_steps, prepare_turns, prepare_views
from arena.game.ruleset import Ruleset, load
from arena.jit import cache_root, load_kernels
from arena.local.workers import work

_PATIENCE_S = 300.0
"""How long another process is waited for that compiles; it ends, or dies, in less."""
Announce = Callable[[int, float], AbstractContextManager[Callable[[], None]]]
"""Says at once that so many kernels are compiled in about so many seconds; what it yields counts one further."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernel:
    """A kernel with all that it calls, as a function that needs it compiled."""

    name: str
    run: Callable[[], object]
    """Is sent to other processes."""
    seconds: float
    """About what it takes to compile, with what it calls and no kernel of an earlier stage calls."""
    stage: int = 0
    """Kernels of a stage are compiled at once, those of the next after them: what both call is there by then."""


def game_kernels(ruleset: Ruleset) -> list[Kernel]:
    """Return the kernels that a match needs, whoever plays it."""
    return [
        Kernel(name="steps", run=partial(prepare_steps, ruleset), seconds=11),
        Kernel(name="views", run=partial(prepare_views, ruleset), seconds=7),
        Kernel(name="boards", run=partial(prepare_boards, ruleset), seconds=7),
        Kernel(name="turns", run=partial(prepare_turns, ruleset), seconds=2, stage=1),
    ]


def find_missing(kernels: Sequence[Kernel]) -> list[Kernel]:
    """Return the kernels that are not in the cache; the others are loaded."""
    return [kernel for kernel in kernels if not load_kernels(kernel.run)]


def compile_kernels(kernels: Sequence[Kernel], announce: Announce = compiling_bar) -> None:
    """Load kernels, and compile those that are missing; only then is anything said.

    Where the cache cannot be written, they are compiled in this process and for it alone. While another process compiles, this
    one waits for what it leaves in the cache.
    """
    missing = find_missing(kernels)
    if not missing:
        return
    n_workers = len(os.sched_getaffinity(0))
    with announce(len(missing), _expected_s(missing, n_workers)) as advance, _alone() as may_write:
        if may_write:
            left = find_missing(missing)  # after another process, perhaps none
            for _ in range(len(missing) - len(left)):
                advance()
            for stage in _stages(left):
                if min(n_workers, len(stage)) > 1:
                    for _ in work([partial(_compile, kernel.run) for kernel in stage], min(n_workers, len(stage))):
                        advance()
                else:
                    for kernel in stage:
                        kernel.run()
                        advance()
            for kernel in left:
                kernel.run()
        else:
            for kernel in missing:
                kernel.run()
                advance()


def compile_rules() -> None:
    """Compile what a match needs to be played again, under any rules, and say so; nothing is done if it is there."""
    compile_kernels(game_kernels(load("paper")))


def _compile(run: Callable[[], object]) -> None:
    """Compile a kernel in another process, which sends nothing back."""
    run()


def _stages(kernels: Sequence[Kernel]) -> list[list[Kernel]]:
    """Return kernels by their stages, those that take longest first."""
    numbers = sorted({kernel.stage for kernel in kernels})
    return [sorted((one for one in kernels if one.stage == n), key=lambda one: -one.seconds) for n in numbers]


def _expected_s(kernels: Sequence[Kernel], n_workers: int) -> float:
    stages = _stages(kernels)
    return sum(max(stage[0].seconds, sum(kernel.seconds for kernel in stage) / n_workers) for stage in stages)


@contextmanager
def _alone() -> Iterator[bool]:
    """Be the only process that compiles into the cache; whether it can be written."""
    root = cache_root()
    lock = FileLock(root / "compiling.lock")
    try:
        root.mkdir(parents=True, exist_ok=True)
        lock.acquire(timeout=_PATIENCE_S)
    except Timeout:
        pass  # each file is whole whoever writes it: only time is lost
    except OSError:
        yield False
        return
    try:
        yield True
    finally:
        lock.release()
