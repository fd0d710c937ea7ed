"""Colour favours nobody: a fighter that plays itself wins as often in blue as in red."""

from collections import Counter
from collections.abc import Callable

import pytest

from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from arena.local.venue import play_batch
from arena.records.plan import MatchPlan
from policies import registry
from policies.search.planner import LEAST_BUDGET, PlannerFast

Z = 4.0
"""Quantile of the interval: a fair game leaves it once in 16,000 tries, and an edge of three matches in a hundred always does."""


def plan_mirror_matches(fighter: str, n_matches: int) -> list[MatchPlan]:
    """Plan matches of a fighter against itself, each on its own map."""
    secret = secret_from_seed(20)
    return [
        MatchPlan(
            identity=f"mirror/{fighter}/{match}",
            blue=fighter,
            red=fighter,
            keys=MatchKeys(
                map_key=derive_map_key(secret, fighter, match), match_key=derive_match_key(secret, f"{fighter}/{match}")
            ),
        )
        for match in range(n_matches)
    ]


class QuickPlanner(PlannerFast):
    """Thinks as little as it can: enough to go wrong in one colour."""

    budget = LEAST_BUDGET
    n_worlds = 16


@pytest.mark.parametrize(
    ("fighter", "n_matches"), [*((name, (400, 20_000)) for name in registry.SCRIPTS), ("planner", (24, 600))]
)
def test_neither_colour_wins_more(
    fighter: str, n_matches: tuple[int, int], size: Callable[[int, int], int], record_property: Callable[..., None]
) -> None:
    plans = plan_mirror_matches(fighter, size(*n_matches))
    make = QuickPlanner if fighter == "planner" else registry.load(fighter)

    wins = Counter(record.result.winner for record in play_batch(load_rules("paper"), plans, make, make))

    n_decided = wins[Team.BLUE] + wins[Team.RED]
    surplus = wins[Team.BLUE] - wins[Team.RED]
    record_property("blue, red, draws", (wins[Team.BLUE], wins[Team.RED], wins[None]))
    record_property("z", round(surplus / max(n_decided, 1) ** 0.5, 2))
    assert surplus**2 <= Z**2 * n_decided
