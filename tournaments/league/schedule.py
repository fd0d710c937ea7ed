"""The matches of a league: everybody against everybody, or one against all, played pair by pair."""

from itertools import combinations

from arena.records.plan import MatchPlan
from tournaments.fixture import plan_fixture
from tournaments.league.league import League


def plan_league(league: League, secret: bytes) -> list[MatchPlan]:
    """Return every match of a league, the first pair of every fixture first, so that half a league is a balanced one.

    An identity depends on neither the order of the entries nor the number of pairs: a league's file may be sorted
    anew, and more pairs may be asked for.
    """
    fixtures = [
        plan_fixture(league.name, one, other, league.n_pairs, secret, are_maps_fresh=league.maps == "fresh")
        for one, other in fixtures_of(league)
    ]
    return [plan for pair in range(league.n_pairs) for fixture in fixtures for plan in fixture[2 * pair : 2 * pair + 2]]


def fixtures_of(league: League) -> list[tuple[str, str]]:
    """Return who meets whom, each two in the order of their names."""
    every = combinations(sorted(league.entries), 2)
    return [fixture for fixture in every if league.challenger is None or league.challenger in fixture]


def count_matches(n_entries: int, n_pairs: int, *, is_gauntlet: bool = False) -> int:
    """Return how many matches a league has."""
    n_fixtures = n_entries - 1 if is_gauntlet else n_entries * (n_entries - 1) // 2
    return 2 * n_fixtures * n_pairs
