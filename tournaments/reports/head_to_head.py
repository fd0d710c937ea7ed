"""Two entries of a league against each other: the score with its interval, by side, by ending, and every match."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from arena.intervals import Z95
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.ratings.standings import Record
from tournaments.reports.tags import MEANINGS


def head_to_head(outcomes: Iterable[Outcome], one: str, other: str, tags: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return how one entry fared against another, as JSON holds it.

    Parameters
    ----------
    outcomes
        Of the whole league; those of others are left out.
    tags
        By the identity of a match.

    Returns
    -------
    dict
        `record` with wins, draws, losses, `score` and its 95% interval, `low` to `high`, over so many `pairs`; `by_side` and
        `by_ending` the like without an interval; `matches` in the order of their pairs. All is seen by `one`.
    """
    met = sorted((each for each in outcomes if {each.blue, each.red} == {one, other}), key=lambda each: each.identity)
    record, by_side, by_ending = Record(), {"blue": Record(), "red": Record()}, defaultdict[str, Record](Record)
    pairs: defaultdict[str, list[float]] = defaultdict(list)
    for outcome in met:
        points = outcome.points(one)
        for kept in (record, by_side["blue" if outcome.blue == one else "red"], by_ending[outcome.result.ending.name.lower()]):
            kept.add(points)
        pairs[LeagueMatchId.parse(outcome.identity).pair_id].append(points)
    scores = [sum(points) / len(points) for points in pairs.values()]
    low, high = score_interval(sum(scores) / len(scores) if scores else 0.0, len(scores))
    return {
        "entries": [one, other],
        "record": asdict(record) | {"score": record.score, "low": low, "high": high, "pairs": len(pairs)},
        "by_side": {side: asdict(kept) for side, kept in by_side.items()},
        "by_ending": {ending: asdict(kept) for ending, kept in sorted(by_ending.items())},
        "matches": [
            {
                "identity": outcome.identity,
                "blue": outcome.blue,
                "red": outcome.red,
                **outcome.result.to_dict(),
                "tags": [{"name": tag, "meaning": MEANINGS[tag]} for tag in tags.get(outcome.identity, ())],
            }
            for outcome in met
        ],
    }


def score_interval(mean: float, n_pairs: float) -> tuple[float, float]:
    """Return the 95% interval of the mean of pairs' scores: Wilson's, as if each pair were won or lost.

    A pair that is shared varies less than that, so the interval is rather too wide; and it is never a point, as one made of the
    spread of a few equal pairs would be.
    """
    if not n_pairs:
        return 0.0, 1.0
    z2 = Z95**2
    centre, margin = mean + z2 / (2 * n_pairs), Z95 * (mean * (1 - mean) / n_pairs + z2 / (4 * n_pairs * n_pairs)) ** 0.5
    return max((centre - margin) / (1 + z2 / n_pairs), 0.0), min((centre + margin) / (1 + z2 / n_pairs), 1.0)
