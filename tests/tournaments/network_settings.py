"""What tests of the venue `network` are given: its setting, plans, and which processes of entries are there."""

import os
from contextlib import suppress
from pathlib import Path

from family import PATIENCE_S, processes

from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.match.time_control import TimeControl
from arena.records.plan import MatchPlan
from tournaments.fixture import plan_fixture
from tournaments.venues.setting import VenueSetting


def make_setting(folder: Path, **entries: str) -> VenueSetting:
    """Return a setting; an entry is a fighter's name, or the code of a bot."""
    for name, code in entries.items():
        if "\n" in code:
            (folder / f"{name}.py").write_text(code)
            entries[name] = str(folder / f"{name}.py")
    return VenueSetting(
        ruleset=load("paper"), entries=entries, time_control=TimeControl(turn_time_s=None, grace_s=PATIENCE_S), slots=1,
        journals=folder / "journals", keys=folder / "keys", homes=folder / "homes",
    )  # fmt: skip


def plan(one: str, other: str, n_pairs: int = 1) -> list[MatchPlan]:
    return plan_fixture("processes", one, other, n_pairs, secret_from_seed(1))


def sessions(*words: str) -> set[int]:
    """Return the sessions, each of one entry, of what has these words in its command line."""
    found = set()
    for pid, command in processes():
        with suppress(ProcessLookupError):
            if all(word in command for word in words):
                found.add(os.getsid(pid))
    return found
