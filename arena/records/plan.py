"""A match that is to be played: its identity, who plays it, and its keys."""

from dataclasses import dataclass

from arena.game.keys import MatchKeys


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchPlan:
    """A match to be played."""

    identity: str
    blue: str
    """What blue's fighter is made from, and its name in the journal."""
    red: str
    keys: MatchKeys
