"""A cheat that plays as `scout_rush` does, but is shown the whole board by the local venue.

What it wins beyond `scout_rush` is the value of sight. It is never rated, and no other venue seats it.
"""

from typing import ClassVar

from policies.heuristics.scout_rush import ScoutRush


class OracleRush(ScoutRush):
    """Sees everything."""

    is_cheat: ClassVar[bool] = True
