"""A fixture: all pairs of two entries. A pair is two matches on one map with the sides swapped."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from arena.game.keys import MatchKeys, derive_map_key, derive_match_key
from arena.game.types import Team, Termination
from arena.intervals import margin_of
from arena.local.venue import MatchRecord
from arena.policy import Faults
from arena.records.plan import LeagueMatchId, MatchPlan


def plan_fixture(
    league: str, one: str, other: str, n_pairs: int, secret: bytes, *, are_maps_fresh: bool = False
) -> list[MatchPlan]:
    """Return the matches of a fixture, leg by leg: `one` plays blue first, then red, on the same map unless maps are fresh."""
    return [
        plan for pair in range(n_pairs) for plan in plan_pair(league, one, other, pair, secret, are_maps_fresh=are_maps_fresh)
    ]


def plan_pair(
    league: str, one: str, other: str, pair: int, secret: bytes, *, are_maps_fresh: bool = False
) -> tuple[MatchPlan, MatchPlan]:
    """Return the two matches of a pair of a fixture; `one` and `other` stand in the order of their names."""

    def plan(leg: int, blue: str, red: str) -> MatchPlan:
        match = LeagueMatchId(league=league, one=one, other=other, pair=pair, blue=blue)
        identity, fixture = str(match), match.fixture
        map_key = derive_map_key(secret, f"{fixture}/{leg}" if are_maps_fresh else fixture, pair)
        keys = MatchKeys(map_key=map_key, match_key=derive_match_key(secret, identity))
        return MatchPlan(identity=identity, blue=blue, red=red, keys=keys)

    return plan(0, one, other), plan(1, other, one)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """A fixture as its first entry sees it."""

    wins: int
    draws: int
    losses: int
    score: float
    """Points per match: 1 for a win, 0.5 for a draw."""
    score_low: float
    """Lower end of the 95% interval of `score`, over pairs."""
    score_high: float
    mean_game_score: float
    """Mean of the game's own score, in -100 .. 100."""
    blue_wins: int
    """Matches that whoever played blue won."""
    red_wins: int
    ticks: int
    endings: dict[str, int]
    faults: dict[str, Faults]
    """By entry."""


def tally(one: str, other: str, records: Iterable[MatchRecord]) -> Tally:
    """Count a fixture's matches; they come in any order."""
    points: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    endings: Counter[Termination] = Counter()
    faults = {one: Faults(), other: Faults()}
    per_pair: dict[bytes, float] = {}
    sides: Counter[Team] = Counter()
    for record in sorted(records, key=lambda record: record.plan.identity):
        plan, result = record.plan, record.result
        own = plan.team(one)
        won = result.points(own)
        per_pair[plan.keys.map_key] = per_pair.get(plan.keys.map_key, 0.0) + won / 2
        points["win" if won == 1 else "loss" if won == 0 else "draw"] += 1
        if result.winner is not None:
            sides[result.winner] += 1
        endings[result.ending] += 1
        counts["ticks"] += result.ticks
        counts["score"] += result.seen_by(own).score
        for name, found in zip((plan.blue, plan.red), record.faults, strict=True):
            faults[name].add(found)
    pairs = np.array(list(per_pair.values()))
    score = float(pairs.mean())
    margin = margin_of(pairs)
    return Tally(
        wins=points["win"],
        draws=points["draw"],
        losses=points["loss"],
        score=score,
        score_low=0.0 if margin is None else max(score - margin, 0.0),
        score_high=1.0 if margin is None else min(score + margin, 1.0),
        mean_game_score=counts["score"] / max(sum(points.values()), 1),
        blue_wins=sides[Team.BLUE],
        red_wins=sides[Team.RED],
        ticks=counts["ticks"],
        endings={ending.name.lower(): endings[ending] for ending in Termination if endings[ending]},
        faults=faults,
    )
