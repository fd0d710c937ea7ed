"""A cheat that plays as `planner` does, but is shown the whole board by the local venue.

What it wins beyond `planner` is what the fog costs. It is never rated, and no other venue seats it.
"""

from typing import ClassVar

from policies.search.planner import Planner


class OraclePlanner(Planner):
    """Sees everything."""

    name = "oracle_planner"
    is_cheat: ClassVar[bool] = True
