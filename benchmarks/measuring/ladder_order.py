"""How true the order of a ladder is, after few matches, to that of a full round robin of the same entries.

The round robin is played, by our own fighters in the local venue. Ladders then begin anew many times, each match with the result
of one that was played by the same two on the same sides, drawn at random. Three choose who meets whom, and rate, as they do
in earnest: a pit's ladder; a season; and for comparison chance, with all results fitted at the end, as a season does.

There are two fields: our scripts as they are `shipped`, of which five are within 50 Elo; and a `course`: some of them, and each
again with shares of its orders lost, so that there is something of every strength.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kendalltau, spearmanr

from arena.game.keys import secret_from_seed
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Team, Termination
from arena.local.venue import play
from arena.pit.ladder import LadderMatch, Waiting
from arena.policy import BatchFactory, BatchPolicy, MatchResult, Orders
from policies import registry
from tournaments.fixture import plan_fixture
from tournaments.ladder.ladder import RatedLadder
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ratings.normal import fit_counts
from tournaments.season.choosing import Player, choose_pairs

N_MATCHES = (30, 60)
"""Of each entry, on average."""
N_TIMES = 20
"""That each ladder begins anew."""
N_PAIRS = 4
"""Of each fixture of a round robin."""
SCRIPTS = ("role_team", "turtle", "scout_rush", "rush", "spiral", "random")
LOST = (0.0, 0.5, 0.8, 0.95)
"""Shares of their orders that the entries of a course lose."""
_N_WAITING = 10
_N_AT_ONCE = 4
"""Pairs of a season that are chosen at a time."""
_POINTS = np.array([1.0, 0.5, 0.0])
_WINNERS = (Team.BLUE, None, Team.RED)
_STAY = 0
Progress = Callable[[str], None]
Floats = NDArray[np.float64]


def measure_order(
    progress: Progress,
    *,
    shipped: Sequence[str] = registry.SCRIPTS,
    scripts: Sequence[str] = SCRIPTS,
    lost: Sequence[float] = LOST,
    n_pairs: int = N_PAIRS,
    n_times: int = N_TIMES,
) -> dict[str, Any]:
    """Play two round robins, and compare with the order of each those of ladders and seasons after few matches."""
    fields = {
        "shipped": {script: (script, 0.0) for script in shipped},
        "course": {f"{script}-{share:.0%}": (script, share) for share in lost for script in scripts},
    }
    return {name: _compare(progress, name, _play_all(progress, entries, n_pairs), n_times) for name, entries in fields.items()}


class _Careless(BatchPolicy):
    """A fighter that loses a share of its orders on the way."""

    def __init__(self, spec: str, share: float, ruleset: Ruleset, team: Team, n_seats: int) -> None:
        super().__init__(ruleset, team, n_seats)
        self._fighter, self._share = registry.load(spec)(ruleset, team, n_seats), share
        self._rng = np.random.default_rng(0)

    def start(self, seats: NDArray[np.intp]) -> None:
        self._fighter.start(seats)

    def act(self, observations: Observations, orders: Orders) -> None:
        self._fighter.act(observations, orders)
        if self._share:
            orders[self._rng.random(orders.shape) < self._share] = _STAY


@dataclass(frozen=True)
class _Field:
    """A round robin's results: how often blue `i` beat, drew with and lost to red `j`, shape (entries, entries, 3)."""

    counts: Floats

    @property
    def points(self) -> Floats:
        """Return the mean points of each entry, over its opponents."""
        won = (self.counts @ _POINTS).sum(axis=1) + (self.counts @ (1 - _POINTS)).sum(axis=0)
        found: Floats = won / (self.counts.sum(axis=(1, 2)) + self.counts.sum(axis=(0, 2)))
        return found

    def draw(self, blue: int, red: int, rng: np.random.Generator) -> int:
        """Return a result of the two on these sides: 0 for blue, 1 for a draw, 2 for red."""
        return int(rng.choice(3, p=self.counts[blue, red] / self.counts[blue, red].sum()))


def _play_all(progress: Progress, entries: Mapping[str, tuple[str, float]], n_pairs: int) -> _Field:
    names = sorted(entries)
    places = {name: place for place, name in enumerate(entries)}
    counts = np.zeros((len(names), len(names), 3))
    fixtures = list(combinations(names, 2))

    def make(name: str) -> BatchFactory:
        return partial(_Careless, *entries[name])

    for number, (one, other) in enumerate(fixtures):
        if number % 50 == 0:
            progress(f"fixture {number} of {len(fixtures)} of a round robin of {len(names)}")
        for record in play(
            load_rules("paper"), plan_fixture("bench", one, other, n_pairs, secret_from_seed(0)), make, n_workers=1
        ):
            counts[places[record.plan.blue], places[record.plan.red], _WINNERS.index(record.result.winner)] += 1
    return _Field(counts)


def _compare(progress: Progress, name: str, field: _Field, n_times: int) -> dict[str, Any]:
    """Return how near each way of choosing comes to the order of the whole round robin."""
    ways: dict[str, Callable[[_Field, int, np.random.Generator], Floats]] = {
        "ladder": _run_ladder,
        "season": _run_season,
        "chance": _run_by_chance,
    }
    figures: dict[str, Any] = {"entries": len(field.counts), "matches_of_the_round_robin": int(field.counts.sum())}
    for n_matches in N_MATCHES:
        for way, rate in ways.items():
            progress(f"{name}: {way}, {n_matches} matches an entry, {n_times} times")
            found = [rate(field, n_matches, np.random.default_rng(seed)) for seed in range(n_times)]
            figures[f"{way}_{n_matches}"] = {
                "spearman": _summarise([spearmanr(ratings, field.points).statistic for ratings in found]),
                "kendall": _summarise([kendalltau(ratings, field.points).statistic for ratings in found]),
            }
    return figures


def _summarise(values: Sequence[float]) -> dict[str, float]:
    """Return the mean, and between what 95% of the repetitions are."""
    low, high = np.quantile(values, (0.025, 0.975))
    return {"mean": round(float(np.mean(values)), 3), "low": round(float(low), 3), "high": round(float(high), 3)}


class _FastStore(LadderStore):
    """Keeps no match."""

    def count_match(self, *_: object) -> bool:
        return True


def _run_ladder(field: _Field, n_matches: int, rng: np.random.Generator) -> Floats:
    """Return what a pit's ladder ranks entries by, where some of them wait whenever a match is to begin."""
    n = len(field.counts)
    keys = {number: bytes([number]) * 32 for number in range(n)}
    numbers = {key: number for number, key in keys.items()}
    with _FastStore("sqlite://") as store:
        ladder = RatedLadder(store, "bench", clock=lambda: 1e9)
        try:
            for _ in range(n * n_matches // 2):
                present = rng.choice(n, min(n, _N_WAITING), replace=False)
                waiting = [Waiting(entry=keys[int(number)], since_s=float(rng.random())) for number in present]
                blue, red = (numbers[one.entry] for one in ladder.choose(waiting, 60.0) or ())
                ladder.count(_end(keys, blue, red, _WINNERS[field.draw(blue, red, rng)]))
            ratings = {row["name"]: row["rating"] for row in ladder.standings()}
        finally:
            ladder.close()
    return np.array([ratings.get(f"n{number}", -np.inf) for number in range(n)])


def _end(keys: Mapping[int, bytes], blue: int, red: int, winner: Team | None) -> LadderMatch:
    return LadderMatch(
        identity="",
        names={Team.BLUE: f"n{blue}", Team.RED: f"n{red}"},
        entries={Team.BLUE: keys[blue], Team.RED: keys[red]},
        rules_hash="",
        result=MatchResult(ending=Termination.CAPTURE, winner=winner, score=0, ticks=0, reason=""),
    )


def _run_season(field: _Field, n_matches: int, rng: np.random.Generator) -> Floats:
    """Return the strengths of a season that chooses its pairs by what tells most."""
    n = len(field.counts)
    players = [Player(label=f"n{number}") for number in range(n)]
    counts, n_played, known = np.zeros_like(field.counts), np.zeros((n, n), dtype=np.int64), None
    while n_played.sum() < n * n_matches / 2:
        known = fit_counts(counts, start=known)
        for one, other in choose_pairs(players, known, n_played, _N_AT_ONCE, rng):
            _play_pair(field, counts, one, other, rng)
            n_played[[one, other], [other, one]] += 1
    return fit_counts(counts, start=known).strengths


def _run_by_chance(field: _Field, n_matches: int, rng: np.random.Generator) -> Floats:
    """Return the strengths after as many pairs of entries that were drawn at random, each entry as often."""
    counts = np.zeros_like(field.counts)
    for _ in range(n_matches // 2):
        order = rng.permutation(len(counts))
        for one, other in zip(order, np.roll(order, 1), strict=True):  # each is in two pairs: half of them are played
            if rng.random() < 0.5:
                _play_pair(field, counts, int(one), int(other), rng)
    return fit_counts(counts).strengths


def _play_pair(field: _Field, counts: Floats, one: int, other: int, rng: np.random.Generator) -> None:
    for blue, red in ((one, other), (other, one)):
        counts[blue, red, field.draw(blue, red, rng)] += 1
