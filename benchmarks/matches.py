"""Many matches in one pit: whether the last costs the referee as much as the first, and what it remembers of each.

With ARENA_TEST_SIZE=full, as many as a pit plays in days.
"""

import multiprocessing
import os
import resource
import tempfile
import time
from collections.abc import Callable
from itertools import count, pairwise
from pathlib import Path
from typing import Any

from arena.errors import ArenaError
from arena.game.engine import warm
from arena.game.keys import MatchKeys
from arena.game.ruleset import load
from arena.match.time_control import TimeControl
from arena.network.address import free_port
from arena.network.session import open_router
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.seating import OpenSeating
from arena.protocol.identity import Identity
from arena.records.plan import MatchPlan
from benchmarks.network import play

N_MATCHES = 20_000 if os.environ.get("ARENA_TEST_SIZE") == "full" else 1_500
PARTS = 5
"""Of the matches: the first, in which all is still cold, is not compared."""
SLOTS = 8
"""Of the one client, which plays against itself."""
_SILENCE_S = 30.0


def run(progress: Callable[[str], None]) -> dict[str, Any]:
    """Matches one after another in one pit: what one costs the referee, and the memory that is left of it."""
    ruleset = load("paper").with_({"side": 10, "tick_limit": 2})
    warm(ruleset)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    spawn = multiprocessing.get_context("spawn")
    numbers = count()

    def make_plan(blue: str, red: str) -> MatchPlan:
        number = next(numbers)
        keys = MatchKeys(map_key=number.to_bytes(32, "big"), match_key=number.to_bytes(32, "little"))
        return MatchPlan(identity=f"bench/{number}", blue=blue, red=red, keys=keys)

    n_ended, parts = 0, list[tuple[float, float]]()
    last_s = time.monotonic()

    def note(_: object) -> None:
        nonlocal n_ended, last_s
        n_ended, last_s = n_ended + 1, time.monotonic()
        if n_ended % (N_MATCHES // PARTS) == 0:
            parts.append((time.process_time(), _resident_mb()))
            progress(f"{n_ended} matches, {parts[-1][1]:.0f} MB")

    with tempfile.TemporaryDirectory() as folder, open_router(endpoint, "bench") as session:
        seating, context = OpenSeating(make_plan, N_MATCHES), PitContext(pit="bench", identity=Identity.make())
        referee = Referee(session, context, ruleset, seating, TimeControl(turn_time_s=60.0), Path(folder), on_end=note)
        client = spawn.Process(target=play, args=(endpoint, SLOTS), daemon=True)
        client.start()
        try:
            referee.run(lambda: n_ended >= N_MATCHES or time.monotonic() - last_s > _SILENCE_S)
        finally:
            client.kill()
            client.join()
            referee.close()
    if n_ended < N_MATCHES:
        raise ArenaError(f"after {n_ended} matches none ended for {_SILENCE_S:.0f} s")
    n_each = N_MATCHES / PARTS
    costs_ms = [(after - before) / n_each * 1e3 for (before, _), (after, _) in pairwise(parts)]
    return {
        "matches": N_MATCHES,
        "referee_ms_a_match": {f"part_{number}": round(cost, 3) for number, cost in enumerate(costs_ms, start=2)},
        "last_over_first": round(costs_ms[-1] / costs_ms[0], 3),
        "memory_grown_mb": round(parts[-1][1] - parts[0][1], 1),
    }


def _resident_mb() -> float:
    """Return the memory that this process has now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
