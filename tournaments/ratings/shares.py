"""Shares beside ratings: whom to send where A beats B, B beats C, and C beats A, so that no single number tells who is best.

Each method gives every entry a share of 1, from the cross table alone; what beats nobody of those that count has none.

maximal-lotteries
    The mixture of entries that no entry beats on average (Kreweras, 1965; Fishburn, 1984), by points.
nash
    The same by log odds, as in Nash averaging (Balduzzi and others, 2018, "Re-evaluating evaluation").
alpha-rank
    How often a walk that moves on to whoever wins is at each entry (Omidshafiei and others, 2019, with infinite alpha).

The first two do not change when an entry is entered twice, or a weak one is added that others win much against. Of several such
mixtures it is the one of largest entropy, so entries that fare alike have alike shares. Two that never met count as even.

The mixtures are linear programs, which scipy solves. OpenSpiel has all three methods, and was left out: two of them need cvxpy,
and together they are 250 MB.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog, minimize

from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.plug_ins import find_plug_in
from tournaments.ratings.bootstrap import UNSEEN
from tournaments.ratings.davidson import Floats
from tournaments.ratings.rate import LEVEL

GROUP = "arena.shares"
"""An entry point of it is a `ShareMethod`."""
_SEED = 20_032
_N_DRAWS = 200
_SCALES = (1e6, 1e5, 1e4, 1e3)
"""How large the shares of one point are at most; where payoffs are of many sizes, the solver gives up on the larger ones."""
_DRIFT = 0.01
"""How likely a walk's move to a beaten entry is, beside one to an entry that wins."""


class ShareMethod(Protocol):
    """Makes shares of a cross table."""

    def __call__(self, points: Floats, matches: Floats) -> Floats:
        """Return the share of each entry, shape (entries,), none below 0, 1 in all.

        Parameters
        ----------
        points
            Of each row against each column, a draw being half a point, shape (entries, entries).
        matches
            How many each two played, the same shape; 0 where they did not meet.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """An entry's share with its 95% interval."""

    share: float
    low: float
    high: float


def maximal_lottery(points: Floats, matches: Floats) -> Floats:
    """Return the mixture that no entry beats by points; a `ShareMethod`."""
    return unbeaten_mixture((points - points.T) / np.maximum(matches, 1))


def nash(points: Floats, matches: Floats) -> Floats:
    """Return the mixture that no entry beats by log odds, half a point being added on either side; a `ShareMethod`."""
    return unbeaten_mixture(np.log((points + 0.5) / (points.T + 0.5)))


def alpha_rank(points: Floats, matches: Floats) -> Floats:
    """Return the stationary distribution of a walk to entries that win; a `ShareMethod`."""
    n = len(points)
    lead = (points - points.T).round(9)
    moves = np.where(lead.T > 0, 1 - _DRIFT, np.where(lead.T < 0, _DRIFT, 0.5)) / max(n - 1, 1)
    np.fill_diagonal(moves, 0)
    flow = moves.T - np.diag(moves.sum(axis=1))
    flow[-1] = 1  # that the shares are 1 in all takes the place of one balance, which follows from the others
    shares: Floats = np.linalg.solve(flow, np.eye(n)[-1])
    return np.maximum(shares, 0)


def unbeaten_mixture(payoff: Floats) -> Floats:
    """Return the symmetric equilibrium of largest entropy, shape (entries,).

    Parameters
    ----------
    payoff
        Of each row against each column, shape (entries, entries), antisymmetric.
    """
    n = len(payoff)
    # A point inside of all equilibria: as many shares above 0, and as many entries that lose to it, as any equilibrium has
    # (Freund, Roundy and Todd, 1985).
    eye, zero = np.eye(n), np.zeros((n, n))
    for scale in _SCALES:
        found = linprog(
            c=[0] * n + [-1] * 2 * n,
            A_ub=np.block([[-eye, eye, zero], [payoff, zero, eye]]),
            b_ub=np.zeros(2 * n),
            bounds=[(0, scale)] * n + [(0, 1)] * 2 * n,
        )
        if found.success:
            break
    inside = found.x
    is_used, is_losing = inside[n : 2 * n] > 0.5, inside[2 * n :] > 0.5
    start: Floats = np.where(is_used, inside[:n], 0) / inside[:n][is_used].sum()
    ways = null_space(np.vstack([np.ones(n), np.eye(n)[~is_used], payoff[~is_losing]]))
    if not ways.shape[1]:
        return start
    used = ways[is_used]

    def disorder(z: Floats) -> tuple[float, Floats]:
        shares = np.maximum(start[is_used] + used @ z, 1e-12)
        return float(shares @ np.log(shares)), used.T @ (1 + np.log(shares))

    bounds = [
        {"type": "ineq", "fun": lambda z: start[is_used] + used @ z, "jac": lambda _: used},
        {"type": "ineq", "fun": lambda z: -payoff[is_losing] @ (start + ways @ z), "jac": lambda _: -payoff[is_losing] @ ways},
    ]
    best = minimize(disorder, np.zeros(ways.shape[1]), jac=True, method="SLSQP", constraints=bounds, options={"ftol": 1e-10})
    shares: Floats = np.maximum(start + ways @ best.x, 0)
    shares /= shares.sum()
    return shares


_OWN: dict[str, ShareMethod] = {"maximal-lotteries": maximal_lottery, "nash": nash, "alpha-rank": alpha_rank}


def find_shares(name: str) -> ShareMethod:
    """Return a method of shares; `InputError` if there is none of that name."""
    return find_plug_in(GROUP, "method of shares", _OWN, name)


def share(
    names: Sequence[str], outcomes: Sequence[Outcome], method: ShareMethod, *, n_draws: int = _N_DRAWS
) -> Mapping[str, Share]:
    """Return the share of each entry, with intervals from pairs drawn anew as those of ratings are; the same every time."""
    index = {name: number for number, name in enumerate(sorted(names))}
    n = len(index)
    pairs: defaultdict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        pairs[LeagueMatchId.parse(outcome.identity).pair_id].append(outcome)
    kinds: defaultdict[tuple[int, int, float, int], int] = defaultdict(int)
    for met in pairs.values():
        one, other = sorted((met[0].blue, met[0].red))
        kinds[index[one], index[other], sum(each.points(one) for each in met), len(met)] += 1
    i, j, points, matches, times = np.array([(*kind, seen) for kind, seen in sorted(kinds.items())]).reshape(-1, 5).T
    cells = i.astype(int), j.astype(int)

    def tables(weights: Floats) -> tuple[Floats, Floats]:
        scored, played = np.zeros((n, n)), np.zeros((n, n))
        np.add.at(scored, cells, weights * points)
        np.add.at(scored, cells[::-1], weights * (matches - points))
        np.add.at(played, cells, weights * matches)
        return scored, played + played.T

    best = method(*tables(times))
    rng = np.random.default_rng(_SEED)
    drawn = np.array([method(*_with_unseen(*tables(rng.standard_gamma(times)), rng)) for _ in range(n_draws)])
    low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
    return {
        name: Share(share=float(best[at]), low=float(min(low[at], best[at])), high=float(max(high[at], best[at])))
        for name, at in index.items()
    }


def _with_unseen(points: Floats, matches: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Add what was not seen to a drawn table, as the bootstrap of ratings does: each fixture may go the other way, too."""
    more = rng.standard_gamma(UNSEEN, size=points.shape)
    np.fill_diagonal(more, 0)
    return points + more, matches + more + more.T
