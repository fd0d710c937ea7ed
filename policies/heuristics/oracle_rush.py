"""A cheat: it plays as `scout_rush` does, but the local venue shows it the whole board.

So what it wins beyond `scout_rush` is what sight is worth. It is never rated, and no other venue seats it.
"""

from typing import ClassVar

from policies.heuristics.scout_rush import ScoutRush


class OracleRush(ScoutRush):
    """Sees everything."""

    is_cheat: ClassVar[bool] = True
