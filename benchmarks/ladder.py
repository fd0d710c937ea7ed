"""The ladder under strain: an open pit, and entries that are real processes, killed and started at random; and its order."""

import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, cycle
from pathlib import Path
from statistics import fmean
from threading import Event, Thread
from typing import Any

from arena.errors import ArenaError, JournalError
from arena.game.keys import new_secret, secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Termination
from arena.local.venue import play
from arena.match.time_control import TimeControl
from arena.network.address import Address, free_port
from arena.pit.effects import MatchEnded
from arena.pit.ladder import Ladder, LadderMatch, Waiting
from arena.pit.pit import Pit, PitSettings
from arena.pit.register import Register
from arena.protocol.identity import Identity
from arena.records.journal_folder import load_journal
from arena.records.replay import BrokenChainError
from arena.records.verification import check_seals
from benchmarks.measuring.ladder_order import measure_order
from benchmarks.measuring.load_generator import LoadGenerator
from policies.precompile import precompile
from policies.registry import load
from tournaments.fixture import plan_fixture, tally
from tournaments.ladder.ladder import open_ladder
from tournaments.ladder.ladder_store import LadderStore

POLICIES = ("random", "patrol", "roomba", "fighter", "rush")
N_ENTRIES = 20
KILL_EVERY_S = 3.0
"""Mean time between two kills."""
MOST_AWAY_S = 15.0
"""A killed entry comes back after a time between nothing and this: within its grace, or after it has forfeited."""
_GRACE_S = 5.0
_COME_S = 180.0
"""How long the first match may keep us waiting."""
_N_PAIRS = 50
_SETTLED = 0.3
"""Share of the time after which memory is measured first: by then everyone has come, and caches are full."""
_APART = 0.05
"""Fighters whose scores differ by less are of one strength."""
Progress = Callable[[str], None]


def run(progress: Progress, minutes: float = 2.0) -> dict[str, Any]:
    """A ladder of 20 entries that are killed and started at random; and the order of ladders and seasons after 30 matches."""
    return {**measure(progress, duration_s=60 * minutes), "order": measure_order(progress)}


def measure(
    progress: Progress, *, duration_s: float, n_entries: int = N_ENTRIES, kill_every_s: float = KILL_EVERY_S
) -> dict[str, Any]:
    """Run a ladder for a while, and look at what came of it."""
    ruleset, pit = load_rules("paper"), Identity.make()
    address = Address(endpoint=f"tcp/127.0.0.1:{free_port()}", pit="bench", fingerprint=pit.fingerprint)
    entries = {f"{policy}-{number}": policy for number, policy in zip(range(n_entries), cycle(POLICIES), strict=False)}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        db, journals = str(folder / "arena.db"), folder / "journals"
        settings = PitSettings(
            address=address,
            identity=pit,
            spectator_key=new_secret(),
            register=Register(),
            ruleset=ruleset,
            secret=new_secret(),
            time_control=TimeControl(grace_s=_GRACE_S),
            journals=journals,
        )
        generator = LoadGenerator(address, folder, entries, kill_every_s=kill_every_s, most_away_s=MOST_AWAY_S)
        with open_ladder(db, address.pit, ruleset.hash) as ladder:
            figures = _serve(progress, settings, _Watched(ladder), generator, duration_s)
            mu = {row["name"]: row["mu"] for row in ladder.standings()}
        progress(f"the journals of {figures['matches']} matches, played again")
        with LadderStore(db, make=False) as store:
            figures["matches_counted"] = len(store.counted(address.pit))
        figures["journals_that_fail"] = sum(not _holds(path) for path in journals.glob("*.journal"))
    progress("the strength of each fighter, in the local venue")
    figures["order_agrees"] = _agree(mu, entries, _measure_strengths(ruleset))
    its = {policy: [mu[entry] for entry in entries if entries[entry] == policy and entry in mu] for policy in POLICIES}
    figures["mean_mu"] = {policy: round(fmean(found), 1) for policy, found in its.items() if found}
    return figures


class _Watched:
    """A ladder, and how long those waited whom it let meet."""

    def __init__(self, ladder: Ladder) -> None:
        self._ladder = ladder
        self.waits_s: list[float] = []

    def identities(self) -> Collection[str]:
        return self._ladder.identities()

    def choose(self, waiting: Sequence[Waiting], now_s: float) -> tuple[Waiting, Waiting] | None:
        chosen = self._ladder.choose(waiting, now_s)
        self.waits_s += [max(now_s - one.since_s, 0.0) for one in chosen or ()]
        return chosen

    def count(self, match: LadderMatch) -> None:
        self._ladder.count(match)

    def standings(self) -> list[dict[str, Any]]:
        return self._ladder.standings()


def _serve(
    progress: Progress, settings: PitSettings, ladder: _Watched, generator: LoadGenerator, duration_s: float
) -> dict[str, Any]:
    """Keep the pit open for a while, and return what was counted."""
    pit = Pit(replace(settings, ladder=ladder))
    endings: Counter[Termination] = Counter()
    n_matches: list[int] = []
    memory: list[float] = []
    has_begun, is_over = Event(), Event()

    def keep_time() -> None:
        if not has_begun.wait(_COME_S):
            pit.stop()
            return
        begin_s = time.monotonic()
        for step in range(1, 11):
            if is_over.wait(max(begin_s + duration_s * step / 10 - time.monotonic(), 0)):
                return
            progress(f"{step * duration_s / 10:.0f} of {duration_s:.0f} s, {endings.total()} matches, {generator.n_kills} kills")
            n_matches.append(endings.total())
            if step / 10 >= _SETTLED:
                memory.append(_peak_mb())
        generator.stop_kills()
        pit.stop()

    clock = Thread(target=keep_time, name="clock")

    def on_end(ended: MatchEnded) -> None:
        endings.update([ended.result.ending])
        if not has_begun.is_set():  # the time runs from here: to start so many processes takes long
            has_begun.set()
            generator.start_kills()

    progress("kernels")
    for policy in set(generator.entries.values()):
        precompile(load(policy))  # here, and not in twenty processes at once
    progress(f"{len(generator.entries)} entries come")
    clock.start()
    with generator:
        try:
            pit.run(lambda _: generator.start(), on_end)
        finally:
            is_over.set()
            has_begun.set()
            clock.join()
    if not memory:
        raise ArenaError(f"no match of the ladder ended within {_COME_S:.0f} s")
    waits_s = sorted(ladder.waits_s)
    return {
        "seconds": round(duration_s, 1),
        "entries": len(generator.entries),
        "matches": endings.total(),
        "matches_per_s": round(n_matches[-1] / duration_s, 2),
        "kills": generator.n_kills,
        "restarts": generator.n_restarts,
        "forfeits": endings[Termination.FORFEIT],
        "voids": endings[Termination.VOID],
        "wait_p50_s": round(waits_s[len(waits_s) // 2], 2),
        "wait_p99_s": round(waits_s[int(len(waits_s) * 0.99)], 2),
        "wait_most_s": round(waits_s[-1], 2),
        "peak_memory_mb": round(memory[-1]),
        "peak_memory_growth_mb": round(memory[-1] - memory[0], 1),
    }


def _peak_mb() -> float:
    """Return the most memory that this process, which is the pit's, ever had."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)


def _holds(path: Path) -> bool:
    """Whether a journal plays again to the same states, and whoever signed it did; one of a match that was cut off is whole."""
    try:
        checked = check_seals(load_journal(path))
    except (JournalError, BrokenChainError):
        return False
    return checked is not None and checked.is_sound


def _measure_strengths(ruleset: Ruleset) -> dict[str, float]:
    """Return each fighter's mean score against the others, without a network."""
    scores: dict[str, list[float]] = {policy: [] for policy in POLICIES}
    for one, other in combinations(POLICIES, 2):
        plans = plan_fixture("bench", one, other, _N_PAIRS, secret_from_seed(0))
        score = tally(one, other, play(ruleset, plans, load, n_workers=1)).score
        scores[one].append(score)
        scores[other].append(1 - score)
    return {policy: fmean(found) for policy, found in scores.items()}


def _agree(mu: Mapping[str, float], entries: Mapping[str, str], strengths: Mapping[str, float]) -> float:
    """Return the share of pairs of entries, of fighters of different strength, that the ladder has in their order."""
    pairs = [
        (mu[one] - mu[other]) * gap > 0
        for one, other in combinations(mu, 2)
        if abs(gap := strengths[entries[one]] - strengths[entries[other]]) >= _APART
    ]
    return round(fmean(pairs), 3) if pairs else 1.0
