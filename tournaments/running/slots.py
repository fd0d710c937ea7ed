"""How many matches an entry can play at once, such that nobody is late by this machine's making."""

import os
from collections.abc import Mapping

from arena.match.time_control import TimeControl

MOST = 8
"""More make no league faster."""
SHARE = 0.5
"""Of a turn's time that thinking may take while all think at once: the rest is for the unexpected."""


def choose_slots(think_s: Mapping[str, float], time_control: TimeControl, n_cores: int | None = None) -> int:
    """Return how many seats an entry may hold at once.

    Parameters
    ----------
    think_s
        Seconds of a processor that a turn of each entry takes, as the preflight measured them.
    n_cores
        Processors; as many as this process may use without it.
    """
    if time_control.turn_time_s is None:
        return MOST
    n_cores = n_cores or len(os.sched_getaffinity(0))
    together_s = sum(think_s.values())
    if together_s * MOST <= SHARE * time_control.turn_time_s * n_cores:
        return MOST
    return max(int(SHARE * time_control.turn_time_s * n_cores / together_s), 1)


def explain_slots(slots: int, think_s: Mapping[str, float]) -> str:
    """Return in a sentence why there are so many; empty if there is nothing to say."""
    if slots == MOST or not think_s:
        return ""
    slowest = max(think_s, key=lambda name: think_s[name])
    seats = "one match" if slots == 1 else f"{slots} matches"
    return (
        f"each entry plays {seats} at once, since {slowest} thinks for {think_s[slowest]:.3g} s a turn; `slots` can say otherwise"
    )
