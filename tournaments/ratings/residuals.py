"""Where one number per entry does not tell the league: fixtures that the ratings do not expect, and circles that no ratings can.

A residual is a fixture's score less what the model expects of it, in standard errors. The fit follows each fixture a little, so
the error of the difference is smaller than that of the score. With points `s`, their expectation `E` and variance `V` under the
model, `D = dE / dparameters` and `H` the negative Hessian of the log posterior,

    z = (s - E) / sqrt(dispersion * (V - D' H^-1 D))

(standardised Pearson residuals; McCullagh and Nelder, 1989, section 12.5). The dispersion is the variance of the pairs within
their fixtures over the model's: the two matches of a pair share a map, and need not be as independent as the model takes them.

A circle is `a` beats `b` beats `c` beats `a`, each over their fixture, each beyond chance. That a fixture is beyond chance is
tested without a model: if both are equal, a pair that went 1.5 to 0.5 could as well have gone 0.5 to 1.5, and all such reversals
are counted exactly (Fisher's randomisation test). Holm's correction (1979) over all fixtures keeps the chance that any fixture
between equals is held for a victory, and so that any circle is made up, below 5%.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import log

import numpy as np
from scipy.stats import binom, norm

from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.ratings.bootstrap import game_of
from tournaments.ratings.davidson import ELO, Floats, chances, posterior
from tournaments.ratings.rate import Ratings

LEVEL = 0.05
_POINTS = np.array([1, 0.5, 0])
"""Blue's, where blue won, drew and lost."""
_LEAST_SPARED = 0.01
"""Share of a fixture's variance that the fit must leave: of two entries it follows the only fixture, and there is no residual."""
_LEAST_PAIRS = 20
"""Pairs, less fixtures, that it takes to estimate a dispersion; with fewer it is 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Residual:
    """A fixture beside what the ratings expect of it."""

    one: str
    other: str
    """The names in their order."""
    n_matches: int
    score: float
    """Points per match of `one`."""
    expected: float
    z: float
    """Standard errors between the two; 0 where the fit follows the fixture, whatever it was."""
    is_significant: bool
    """After Holm's correction over all fixtures."""

    @property
    def sentence(self) -> str:
        """What a report says of it."""
        how = "more" if self.z > 0 else "less"
        return (
            f"{self.one} scored {self.score:.3f} against {self.other}, {how} than the {self.expected:.3f} of their ratings "
            f"({self.z:+.1f} standard errors)"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """Three entries, each of which beats the next."""

    entries: tuple[str, str, str]
    """The first name in their order is the first."""
    scores: tuple[float, float, float]
    """Points per match of each against the next."""
    p: float
    """Of the least certain of the three, after Holm's correction."""

    @property
    def sentence(self) -> str:
        """What a report says of it."""
        a, b, c = self.entries
        x, y, z = self.scores
        return f"{a} beats {b} ({x:.3f}), {b} beats {c} ({y:.3f}) and {c} beats {a} ({z:.3f}): no rating shows that"


def find_residuals(ratings: Ratings, outcomes: Iterable[Outcome]) -> tuple[Residual, ...]:
    """Return every fixture that was played, the most surprising first; none by a method that expects no scores.

    Parameters
    ----------
    ratings
        Of these outcomes.
    """
    if ratings.draw_rate is None:
        return ()
    names = sorted(ratings.entries)
    index = {name: number for number, name in enumerate(names)}
    best = _parameters([ratings.entries[name].elo for name in names], ratings.side_elo, ratings.draw_rate)
    outcomes = list(outcomes)
    counts = np.zeros((len(names), len(names), 3))
    for outcome in outcomes:
        counts[game_of(outcome, index)] += 1
    shares = chances(best)
    inverse = np.linalg.inv(posterior(best[None], counts[None], np.zeros((1, len(best))))[2][0])
    dispersion = _dispersion(_pairs(outcomes), index, shares)
    found = []
    for i, j in combinations(range(len(names)), 2):
        n_matches = int(counts[i, j].sum() + counts[j, i].sum())
        if not n_matches:
            continue
        points = counts[i, j] @ _POINTS + counts[j, i] @ (1 - _POINTS)
        expected, variance, slope = _expected(i, j, counts, shares)
        spared = variance - slope @ inverse @ slope
        z = (points - expected) / (dispersion * spared) ** 0.5 if spared > _LEAST_SPARED * variance else 0.0
        found.append((i, j, n_matches, points, expected, float(z)))
    adjusted = holm([float(2 * norm.sf(abs(row[-1]))) for row in found])
    residuals = [
        Residual(
            one=names[i],
            other=names[j],
            n_matches=n_matches,
            score=float(points / n_matches),
            expected=float(expected / n_matches),
            z=z,
            is_significant=p <= LEVEL,
        )
        for (i, j, n_matches, points, expected, z), p in zip(found, adjusted, strict=True)
    ]
    return tuple(sorted(residuals, key=lambda residual: (-abs(residual.z), residual.one, residual.other)))


def _parameters(elos: Sequence[float], side_elo: float, draw_rate: float) -> Floats:
    """Return the model's parameters from what is reported of them, as `davidson` has them."""
    return np.array([*(elo / ELO for elo in elos), side_elo / ELO, log(2 * draw_rate / (1 - draw_rate))])


def expected_points(elo: Mapping[str, float], side_elo: float, draw_rate: float) -> dict[tuple[str, str], float]:
    """Return what ratings expect of each match, by who is blue and who is red: blue's points."""
    points = chances(_parameters(list(elo.values()), side_elo, draw_rate)) @ _POINTS
    return {(blue, red): float(points[i, j]) for i, blue in enumerate(elo) for j, red in enumerate(elo) if i != j}


def _expected(i: int, j: int, counts: Floats, shares: Floats) -> tuple[float, float, Floats]:
    """Return the points of `i` that the model expects against `j`, their variance, and the points' slope in the parameters."""
    slope = np.zeros(len(shares) + 2)
    points = variance = 0.0
    for blue, red, sign in ((i, j, 1), (j, i, -1)):
        n = counts[blue, red].sum()
        win, draw, loss = shares[blue, red]
        lead = win - loss
        curve = n * (1 - draw - lead**2) / 4  # the variance of the points, and their slope in d too
        points += n * (1 + sign * lead) / 2
        variance += curve
        slope[i] += curve
        slope[j] -= curve
        slope[-2] += sign * curve
        slope[-1] -= sign * n * lead * draw / 2
    return float(points), float(variance), slope


def _pairs(outcomes: Iterable[Outcome]) -> dict[tuple[str, str], list[float]]:
    """Return, by fixture, what the first of both scored in each complete pair."""
    pairs: defaultdict[tuple[str, str, str], list[float]] = defaultdict(list)
    for outcome in outcomes:
        one, other = sorted((outcome.blue, outcome.red))
        pairs[one, other, LeagueMatchId.parse(outcome.identity).pair_id].append(outcome.points(one))
    fixtures: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for (one, other, _), scores in sorted(pairs.items()):  # the last bits of sums depend on it
        if len(scores) == 2:
            fixtures[one, other].append(sum(scores))
    return dict(fixtures)


def _dispersion(fixtures: dict[tuple[str, str], list[float]], index: dict[str, int], shares: Floats) -> float:
    """Return the variance of pairs within their fixtures as a multiple of the model's."""
    seen = modelled = 0.0
    n_free = 0
    for (one, other), scores in fixtures.items():
        i, j = index[one], index[other]
        of_a_pair = sum(shares[cell] @ _POINTS**2 - (shares[cell] @ _POINTS) ** 2 for cell in ((i, j), (j, i)))
        seen += float(np.var(scores)) * len(scores)
        modelled += float(of_a_pair) * (len(scores) - 1)
        n_free += len(scores) - 1
    return seen / modelled if n_free >= _LEAST_PAIRS and seen else 1.0


def find_cycles(outcomes: Iterable[Outcome]) -> tuple[Cycle, ...]:
    """Return the circles of three that are beyond chance, the most certain first."""
    fixtures = _pairs(outcomes)
    adjusted = holm([_reversal_p(scores) for scores in fixtures.values()])
    beats: dict[tuple[str, str], tuple[float, float]] = {}
    for ((one, other), scores), p in zip(fixtures.items(), adjusted, strict=True):
        if p <= LEVEL:
            score = float(np.mean(scores)) / 2
            beats[(one, other) if score > 0.5 else (other, one)] = (max(score, 1 - score), p)
    cycles = []
    for a, b in beats:
        for c in {name for pair in beats for name in pair}:
            if a < min(b, c) and (b, c) in beats and (c, a) in beats:
                links = [beats[link] for link in ((a, b), (b, c), (c, a))]
                x, y, z = (score for score, _ in links)
                cycles.append(Cycle(entries=(a, b, c), scores=(x, y, z), p=max(p for _, p in links)))
    return tuple(sorted(cycles, key=lambda cycle: (cycle.p, cycle.entries)))


def _reversal_p(scores: Iterable[float]) -> float:
    """Return how often pairs between equals lie as far from even as these: the sum of leads of which each could be reversed."""
    leads = np.array([round(2 * score - 2) for score in scores])  # -2 .. 2
    n_clear, n_narrow = int((abs(leads) == 2).sum()), int((abs(leads) == 1).sum())
    far = abs(int(leads.sum()))
    if not far:
        return 1.0
    clear = np.arange(n_clear + 1)
    lead = 2 * (2 * clear - n_clear)
    least_narrow = np.ceil((far - lead + n_narrow) / 2)  # of those ahead, to get that far
    return float(min(1.0, 2 * (binom.pmf(clear, n_clear, 0.5) * binom.sf(least_narrow - 1, n_narrow, 0.5)).sum()))


def holm(ps: Sequence[float]) -> list[float]:
    """Return p-values corrected for how many there are (Holm, 1979)."""
    corrected = [0.0] * len(ps)
    highest = 0.0
    for place, which in enumerate(sorted(range(len(ps)), key=lambda number: ps[number])):
        highest = max(highest, min(1.0, (len(ps) - place) * ps[which]))
        corrected[which] = highest
    return corrected
