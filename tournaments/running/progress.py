"""How far a league is, from its stored results."""

from typing import Any

from tournaments.league.entries import is_same_code
from tournaments.league.league import League
from tournaments.league.schedule import count_matches
from tournaments.running.duel import judge
from tournaments.store.store import Store, StoredLeague


def progress_of(store: Store, league: StoredLeague) -> dict[str, Any]:
    """Return how many matches of a league are stored, and whether it is over; of a test, `planned` is the most.

    A season plans nothing ahead, so of one it is None.
    """
    n_entries = len(league.definition["entries"])
    if league.is_season:
        n_played, is_closed = store.count(league), league.secret is not None
        return {"league": league.name, "entries": n_entries, "played": n_played, "planned": None, "complete": is_closed}
    n_planned = count_matches(n_entries, league.n_pairs, is_gauntlet="challenger" in league.definition)
    n_played = store.count_current(league)
    test = judge(league.definition, league.current(store.outcomes(league))) if "sprt" in league.definition else None
    return {
        "league": league.name,
        "entries": n_entries,
        "played": n_played,
        "planned": n_planned,
        "complete": n_played >= n_planned or (test is not None and test.is_decided),
    }


def is_over(store: Store, league: League) -> bool:
    """Return whether nothing is left to be played of what a league's file asks for, edits of its rules or clock aside."""
    row = store.find(league.name)
    if row is None or league.n_pairs > row.n_pairs:
        return False
    before, now = row.definition["entries"], league.definition["entries"]
    is_same = row.labels.keys() == now.keys() and all(is_same_code(before[row.labels[name]], now[name]) for name in now)
    return is_same and bool(progress_of(store, row)["complete"])
