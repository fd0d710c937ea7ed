"""What an entry gains on which maps: its points beyond what the ratings expect, where there is more of something and elsewhere.

The maps are those of the journals that may be seen. Their features are what differs from map to map under one ruleset.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from arena.errors import JournalError
from arena.game.types import FLAGS, Code, Team
from arena.intervals import Z95
from arena.records.journal import Header, read_journal
from arena.records.journal_folder import JournalFolder
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.ratings.davidson import Floats
from tournaments.ratings.residuals import LEVEL, expected_points, holm
from tournaments.reports.leaderboard import rounded
from tournaments.reports.replays import find_visible, read_kept
from tournaments.reports.report import Report

FEATURES = {
    "obstacles": "obstacles, in percent of the cells",
    "way": "steps on the ground from flag to flag",
}
_MOST_MAPS = 1_000
"""Of a league, in a fixed choice: one takes about 1 ms."""
_LEAST_MAPS = 10
"""Of an entry, on either side of the middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapGain:
    """What a feature of maps is worth to an entry."""

    entry: str
    feature: str
    n_maps: int
    middle: float
    """The median of the feature over the league's maps: those with more of it are compared with the rest."""
    gain: float
    """Points per match beyond the expected on maps with more of it, less the same on the rest."""
    low: float
    """Lower end of its 95% interval."""
    high: float
    is_significant: bool
    """After Holm's correction over all entries and features."""

    @property
    def interval(self) -> str:
        """The gain with its interval, in words."""
        return f"{self.gain:+.3f} ({self.low:+.3f} to {self.high:+.3f})"


def find_map_gains(report: Report, journals: JournalFolder) -> tuple[MapGain, ...]:
    """Return what features of maps are worth to the entries, by entry; nothing where too few maps may be seen.

    Parameters
    ----------
    journals
        Those of the league; what is not there, or cannot be read, is left out.
    """
    maps = _played_maps(report, journals)
    standings = report.standings
    if len(maps) < 2 * _LEAST_MAPS or standings.draw_rate is None:
        return ()
    elo = {row.name: row.rating.elo for row in standings.rows}
    expected = expected_points(elo, standings.side.elo, standings.draw_rate)
    seen: defaultdict[str, list[tuple[int, float]]] = defaultdict(list)  # of each entry: the map, points beyond the expected
    for number, (_, outcomes) in enumerate(maps):
        for entry in (outcomes[0].blue, outcomes[0].red):
            seen[entry].append((number, float(np.mean([_beyond(one, entry, expected) for one in outcomes]))))
    values = _features([header for header, _ in maps])
    gains = [_gain(entry, feature, values[feature], seen[entry]) for entry in sorted(seen) for feature in FEATURES]
    found = [gain for gain in gains if gain is not None]
    corrected = holm([p for _, p in found])
    return tuple(replace(gain, is_significant=p <= LEVEL) for (gain, _), p in zip(found, corrected, strict=True))


def _gain(entry: str, feature: str, values: Floats, seen: Sequence[tuple[int, float]]) -> tuple[MapGain, float] | None:
    """Return what a feature is worth to an entry, and the p-value of its being worth nothing; None where too little was seen."""
    middle = float(np.median(values))
    numbers, beyond = np.array([number for number, _ in seen]), np.array([points for _, points in seen])
    has_more = values[numbers] > middle
    more, rest = beyond[has_more], beyond[~has_more]
    if min(len(more), len(rest)) < _LEAST_MAPS:
        return None
    gain = float(more.mean() - rest.mean())
    error = float((more.var(ddof=1) / len(more) + rest.var(ddof=1) / len(rest)) ** 0.5)
    low, high = gain - Z95 * error, gain + Z95 * error
    p = float(2 * norm.sf(abs(gain) / error)) if error else 1.0
    found = MapGain(
        entry=entry, feature=feature, n_maps=len(seen), middle=middle, gain=gain, low=low, high=high, is_significant=False
    )
    return found, p


def _played_maps(report: Report, journals: JournalFolder) -> list[tuple[Header, list[Outcome]]]:
    """Return the headers of maps that may be seen, each with what was played on it."""
    are_fresh = report.league.definition.get("maps") == "fresh"
    visible = find_visible((one.identity for one in report.outcomes), report.league.n_pairs, report.is_complete)
    played: defaultdict[str, list[Outcome]] = defaultdict(list)
    for outcome in report.outcomes:
        if outcome.identity in visible:
            played[outcome.identity if are_fresh else LeagueMatchId.parse(outcome.identity).pair_id].append(outcome)
    groups = [outcomes for _, outcomes in sorted(played.items())]
    maps = []
    if len(groups) >= 2 * _LEAST_MAPS:
        for outcomes in groups[:: -(-len(groups) // _MOST_MAPS)]:
            with suppress(JournalError):
                maps.append((read_journal(read_kept(journals, outcomes[0].identity)).header, outcomes))
    return maps


def _features(headers: Sequence[Header]) -> dict[str, Floats]:
    """Return each feature of the maps, shape (maps,)."""
    from arena.game.engine import BatchedGame

    games = BatchedGame(headers[0].ruleset, len(headers))
    games.start(range(len(headers)), [header.keys for header in headers])
    boards = np.array([games.truth(number) for number in range(len(headers))])
    return {"obstacles": 100 * (boards == Code.OBSTACLE).mean(axis=(1, 2)), "way": _ways(boards)}


def _ways(boards: NDArray[np.int8]) -> Floats:
    """Return how many steps it is from flag to flag around the obstacles, shape (maps,); 0 where there is no way."""
    is_free, is_goal = boards != Code.OBSTACLE, boards == FLAGS[Team.RED]
    reached = boards == FLAGS[Team.BLUE]
    ways = np.zeros(len(boards))
    for step in range(1, boards[0].size):
        wider = reached.copy()
        wider[:, 1:] |= reached[:, :-1]
        wider[:, :-1] |= reached[:, 1:]
        wider[:, :, 1:] |= reached[:, :, :-1]
        wider[:, :, :-1] |= reached[:, :, 1:]
        wider &= is_free
        if (wider == reached).all():
            break
        ways[(wider & ~reached & is_goal).any(axis=(1, 2))] = step
        reached = wider
    return ways


def _beyond(outcome: Outcome, entry: str, expected: Mapping[tuple[str, str], float]) -> float:
    """Return what an entry scored in a match, less what its rating expects."""
    blue = expected[outcome.blue, outcome.red]
    return outcome.points(entry) - (blue if entry == outcome.blue else 1 - blue)


def map_gains_to_dict(gains: Sequence[MapGain]) -> dict[str, Any]:
    """Return the gains of each entry as JSON holds them."""
    found: defaultdict[str, dict[str, Any]] = defaultdict(dict)
    for gain in gains:
        found[gain.entry][gain.feature] = {
            "more_than": rounded(gain.middle, 2),
            "maps": gain.n_maps,
            "gain": rounded(gain.gain, 4),
            "low": rounded(gain.low, 4),
            "high": rounded(gain.high, 4),
            "significant": gain.is_significant,
        }
    return {"features": FEATURES, "gains": dict(found)}
