"""Tell how much of a match its map decides, and how much chance: the same two fighters meet on each map again and again.

`python -m benchmarks.measuring.luck planner-fast role_team turtle` prints, for each opponent, how the first scores, on how many
sides of maps it always loses, and which share of the variance of a match's points lies between sides of maps.
"""

import sys
from collections.abc import Sequence
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from arena.console import say
from arena.game.keys import derive_map_key, secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from arena.local.venue import play
from arena.records.plan import MatchPlan
from policies.registry import load_entry
from tournaments.evaluation.evaluate import CANDIDATE
from tournaments.fixture import plan_pair

N_MAPS, N_REPLAYS = 20, 8
SEED = 7
Floats = NDArray[np.float64]


def play_again(ruleset: Ruleset, fighter: str, opponent: str, n_maps: int, n_replays: int) -> Floats:
    """Return the points of a fighter, shape (sides of maps, replays): only the chance of the fights differs between replays."""
    secret, plans = secret_from_seed(SEED), list[MatchPlan]()
    places: dict[str, tuple[int, int]] = {}
    for number, replay in product(range(n_maps), range(n_replays)):
        for plan in plan_pair("luck", CANDIDATE, opponent, number * n_replays + replay, secret):
            map_key = derive_map_key(secret, "luck", number)
            plans.append(plan._replace(keys=plan.keys._replace(map_key=map_key)))
            places[plan.identity] = len(Team) * number + plan.team(CANDIDATE), replay
    points = np.zeros((len(Team) * n_maps, n_replays))
    load = partial(load_entry, {CANDIDATE: fighter, opponent: opponent})
    for record in play(ruleset, plans, load):
        points[places[record.plan.identity]] = record.points(CANDIDATE)
    return points


def share_of_map(points: Floats) -> float:
    """Return which share of a match's variance lies between sides of maps: 1 if all replays end alike, 0 if chance decides."""
    within = float(points.var(axis=1, ddof=1).mean())
    between = max(float(points.mean(axis=1).var(ddof=1)) - within / points.shape[1], 0.0)
    return between / (between + within) if between + within > 0 else 0.0


def main(fighter: str, opponents: Sequence[str]) -> None:
    """Measure, and print a line for each opponent."""
    say(f"{fighter} on {N_MAPS} maps, {N_REPLAYS} times on each side of each")
    for opponent in opponents:
        points = play_again(load_rules("paper"), fighter, opponent, N_MAPS, N_REPLAYS)
        loses, wins = float((points.max(axis=1) == 0).mean()), float((points.min(axis=1) == 1).mean())
        say(
            f"{opponent}: scores {points.mean():.3f}; always loses on {loses:.2f} of the sides, always wins on {wins:.2f}; "
            f"the map decides {share_of_map(points):.2f} of the variance"
        )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
