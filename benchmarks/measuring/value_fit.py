"""Fit what a world is worth to planners: a logistic regression from the states of matches between scripts to how they ended.

`python -m benchmarks.measuring.value_fit` prints the weights, and how well they and those that ship foretell matches left out.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from arena.console import say
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.rules import can_enter
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from policies.belief.belief import make_belief
from policies.registry import load
from policies.search.value import N_FEATURES, WEIGHTS, write_features
from policies.search.ways import Ways, find_ways, make_ways
from policies.search.worlds import make_worlds

SCRIPTS = ("role_team", "turtle", "border_hunter", "squad", "scout_rush", "chameleon", "defend", "rush")
N_MATCHES = 24
"""Of each pair of scripts."""
EVERY = 4
"""Ticks from one state that is kept to the next."""
_LEFT_OUT = 5
"""One match in so many is not fitted to, but foretold."""
Floats = NDArray[np.float64]


def collect(ruleset: Ruleset, blue: str, red: str, n_matches: int, seed: int) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Return the features of states as blue has them, shape (n, features), what each match came to for blue, and which it was."""
    games, secret = BatchedGame(ruleset, n_matches), secret_from_seed(seed)
    names = [f"{blue}/{red}/{match}" for match in range(n_matches)]
    games.start(
        range(n_matches),
        [
            MatchKeys(map_key=derive_map_key(secret, "value", number), match_key=derive_match_key(secret, name))
            for number, name in enumerate(names)
        ],
    )
    fighters = {Team.BLUE: load(blue)(ruleset, Team.BLUE, n_matches), Team.RED: load(red)(ruleset, Team.RED, n_matches)}
    for fighter in fighters.values():
        fighter.start(np.arange(n_matches))
    orders = {team: np.zeros((n_matches, games.n_units[team]), np.int8) for team in Team}
    worlds = make_worlds(ruleset, n_matches)._replace(state=games.state)
    ways = [_ways_of(games, match) for match in range(n_matches)]
    features, matches, tick = [], [], 0
    while not games.is_over.all():
        for match in np.flatnonzero(~games.is_over) if tick % EVERY == EVERY // 2 else ():
            features.append(np.zeros(N_FEATURES))
            write_features(int(match), int(Team.BLUE), worlds, ways[match], games.tables, features[-1])
            matches.append(int(match))
        seen = games.observe()
        for team in Team:
            fighters[team].act(seen[team], orders[team])
        games.step(np.concatenate([orders[Team.BLUE], orders[Team.RED]], axis=1))
        tick += 1
    score = games.state.field[:, 3]
    points = np.where(score > 0, 1.0, np.where(score < 0, 0.0, 0.5))
    return np.array(features), points[matches], np.array(matches)


def _ways_of(games: BatchedGame, match: int) -> Ways:
    """Return the ways on the true ground of a match."""
    side = games.ruleset.side
    belief, ways = make_belief(games.ruleset, Team.BLUE, 1), make_ways(side**2)
    free = can_enter(games.state.ground[match, : side * side].reshape(side, side), 0)
    belief.walkable[0] = (free.astype(np.uint64) << np.arange(side, dtype=np.uint64)).sum(axis=1)
    find_ways(belief, side, games.tables, ways)
    return ways


def fit(features: Floats, points: Floats) -> Floats:
    """Return the weights under which what happened is likeliest."""
    return np.asarray(minimize(_surprise, np.zeros(features.shape[1]), (features, points), method="BFGS").x)


def _surprise(weights: Floats, features: Floats, points: Floats) -> float:
    """Return the mean cross-entropy of what happened, in nats; a draw is half a win."""
    odds = features @ weights
    return float(np.mean(np.logaddexp(0.0, odds) - points * odds))


def main() -> None:
    """Collect, fit and compare."""
    ruleset = load_rules("paper")
    parts = [collect(ruleset, blue, red, N_MATCHES, seed=7) for blue, red in product(SCRIPTS, SCRIPTS)]
    features, points, matches = (np.concatenate([part[k] for part in parts]) for k in range(3))
    is_left_out = matches % _LEFT_OUT == 0
    weights = fit(features[~is_left_out], points[~is_left_out])
    say(f"{len(features):,} states of {len(parts) * N_MATCHES:,} matches; weights {np.round(weights, 2).tolist()}")
    for name, one in {"fitted": weights, "shipped": WEIGHTS, "nothing": np.zeros(N_FEATURES)}.items():
        say(f"{name}: {_surprise(one, features[is_left_out], points[is_left_out]):.4f} nats a state, of matches left out")


if __name__ == "__main__":
    main()
