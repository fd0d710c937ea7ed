"""A gladiator pit for algorithms: the pit itself, and the words that a bot is written in.

The names below are handed on when they are first used, so that `import arena` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from arena.game.observation import EnemyUnit as EnemyUnit
    from arena.game.observation import Observation as Observation
    from arena.game.observation import OwnUnit as OwnUnit
    from arena.game.types import Action as Action
    from arena.game.types import Code as Code
    from arena.game.types import Team as Team
    from arena.policy import MatchInfo as MatchInfo
    from arena.policy import MatchResult as MatchResult

_HOMES = {
    "Action": "arena.game.types",
    "Code": "arena.game.types",
    "Team": "arena.game.types",
    "EnemyUnit": "arena.game.observation",
    "Observation": "arena.game.observation",
    "OwnUnit": "arena.game.observation",
    "MatchInfo": "arena.policy",
    "MatchResult": "arena.policy",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'arena' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
