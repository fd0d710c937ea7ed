"""A season without a pit: its matches end as the strengths of who plays say, by a generator of its own."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from outcomes import ended

from arena.game.types import Team, Termination
from arena.network.address import Address
from arena.records.plan import MatchPlan
from tournaments.league.file import parse_league
from tournaments.league.versions import entry_of
from tournaments.outcome import Outcome
from tournaments.season.runner import SeasonRunner
from tournaments.store.season_store import SeasonStore
from tournaments.venues.setting import Fighter

FILE = """
seed = 1
[entries]
rush = "rush"
patrol = "patrol"
random = "random"
[season]
"""
LEAGUE = parse_league(FILE, "course", Path())
SECRET = bytes(32)
N_CORES = 2
DEFINITION = {**LEAGUE.definition, "secret": "s"}


class PretendedVenue:
    """Ends matches in a random order, at most `most` in each call; `lose` forgets all that it was given, as if it were killed."""

    address: Address | None = None

    def __init__(self, elo: Mapping[str, float], seed: int = 0, most: int = 8) -> None:
        self.elo, self.most = dict(elo), most
        self.rng = np.random.default_rng(seed)
        self.plans: list[MatchPlan] = []
        self.given: list[str] = []
        self.named_gone: set[str] = set()
        self.withdrawn: set[str] = set()
        self.broken: set[str] = set()
        self.forfeiting: set[str] = set()
        self.waits_for: set[str] = set()
        """Whose matches do not begin unless they are withdrawn."""
        self.present: frozenset[str] = frozenset()
        self.failing: frozenset[str] = frozenset()
        self.known: set[str] = set()

    def add(self, entries: Mapping[str, Fighter], plans: Sequence[MatchPlan]) -> None:
        assert {label for plan in plans for label in (plan.blue, plan.red)} <= entries.keys()
        self.known |= entries.keys()
        self.plans += plans
        self.given += [plan.identity for plan in plans]

    def withdraw(self, names: Collection[str], reason: str) -> None:
        """Make what they have not begun void, as a pit does: what comes later of them is played."""
        self.named_gone |= set(names)
        self.withdrawn |= {plan.identity for plan in self.plans if not {plan.blue, plan.red}.isdisjoint(names)}

    def receive(self) -> list[Outcome]:
        self.rng.shuffle(self.plans)  # type: ignore[arg-type]  # NumPy shuffles lists in place
        can_end = (plan for plan in self.plans if plan.identity in self.withdrawn or not self.waits_for & {plan.blue, plan.red})
        free = list(can_end)[: self.most]
        self.plans = [plan for plan in self.plans if plan not in free]
        return [self._end(plan) for plan in free]

    def _end(self, plan: MatchPlan) -> Outcome:
        if self.broken & {plan.blue, plan.red} or plan.identity in self.withdrawn:
            self.withdrawn.discard(plan.identity)
            return ended(plan.identity, plan.blue, plan.red, None, ending=Termination.VOID)
        for name, winner in ((plan.blue, Team.RED), (plan.red, Team.BLUE)):
            if name in self.forfeiting:
                return ended(plan.identity, plan.blue, plan.red, winner, ending=Termination.FORFEIT)
        lead = self.elo[plan.blue] - self.elo[plan.red]
        blue = 1 / (1 + 10 ** (-lead / 400))
        drawn = 0.2 * min(blue, 1 - blue) * 2
        at = self.rng.random()
        winner = Team.BLUE if at < blue - drawn / 2 else None if at < blue + drawn / 2 else Team.RED
        return ended(plan.identity, plan.blue, plan.red, winner)


class PretendedSeason:
    """A season in a real store, with clocks that the test sets."""

    def __init__(self, url: str, folder: Path, elo: Mapping[str, float]) -> None:
        self.store = SeasonStore(url)
        self.folder = folder
        self.now_s = 1_000.0
        self.set_back_s = 0.0
        """By how much the clock on the wall was set back."""
        self.venue = PretendedVenue(elo)
        self.row = self.store.open_season("course", DEFINITION, self.now_s)
        self.runner = self.open()

    def open(self) -> SeasonRunner:
        """Open it, as after a kill: what the venue was in the middle of is gone."""
        self.venue.plans.clear()
        self.row = self.store.open_season("course", DEFINITION, self.now_s)
        self.runner = SeasonRunner(
            LEAGUE, self.store, self.row, SECRET, self.venue, folder=self.folder, journals=self.folder / "journals",
            clock=lambda: self.now_s - self.set_back_s, now=lambda: self.now_s, rng=np.random.default_rng(1), n_cores=N_CORES,
        )  # fmt: skip
        return self.runner

    def submit(self, entry: str, digest: str, elo: float, owner: str = "") -> str:
        """Have somebody submit code of a strength, which is accepted; return its label."""
        owner = owner or f"{entry}s key"
        given = self.store.submit(self.row, entry=entry, owner=owner, digest=digest, n_bytes=1, now_s=self.now_s)
        place = self.folder / "submissions" / digest
        place.mkdir(parents=True, exist_ok=True)
        (place / ".submission").write_text("bot\nbot.py\n")
        version = self.store.accept(self.row, given, spec=f"submissions/{digest}", says="", report=None, now_s=self.now_s)
        assert entry_of(version.label) == entry
        self.venue.elo[version.label] = elo
        return version.label
