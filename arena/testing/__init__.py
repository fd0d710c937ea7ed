"""The test kit of a bot's author: matches on drawn boards stepped by hand, and how long a bot thinks at most.

The names below are handed on when they are first used. `Observation.from_board` is part of the kit; whatever plays against a
fighter by its name is in `tournaments.testing`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from arena.testing.speed import assert_never_slower_than as assert_never_slower_than
    from arena.testing.stepped_match import DrawnMatch as DrawnMatch
    from arena.testing.stepped_match import SteppedMatch as SteppedMatch

_HOMES = {
    "DrawnMatch": "arena.testing.stepped_match",
    "SteppedMatch": "arena.testing.stepped_match",
    "assert_never_slower_than": "arena.testing.speed",
}


def __getattr__(name: str) -> Any:
    if name == "play_pairs":
        raise ImportError("play_pairs knows fighters by their names, so it is in tournaments.testing, and a fixture of pytest")
    if name not in _HOMES:
        raise AttributeError(f"module 'arena.testing' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
