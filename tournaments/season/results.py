"""What a season has played, in memory: counts by who met whom, and which pair of a fixture is the next."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from arena.game.types import Team, Termination
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome
from tournaments.ratings.davidson import Floats
from tournaments.ratings.standings import Record
from tournaments.season.choosing import Ints

MOST_EARLIER = 100
"""Earlier versions that are rated beside the current ones: those that have met them most often."""


class Results:
    """The results of a season; what is stored is counted once, as the store holds it.

    Parameters
    ----------
    counts
        How often blue won, drew and lost, by the labels of blue and red.
    identities
        Of all matches.
    forfeits
        How many matches each label has forfeited.
    """

    def __init__(
        self,
        counts: Mapping[tuple[str, str], tuple[int, int, int]],
        identities: Iterable[str],
        forfeits: Mapping[str, int],
    ) -> None:
        self._counts: defaultdict[str, dict[str, list[int]]] = defaultdict(dict)
        """By blue and red: won, drawn and lost by blue."""
        self._records: defaultdict[str, Record] = defaultdict(Record)
        self.forfeits = Counter(forfeits)
        self._met: defaultdict[str, set[str]] = defaultdict(set)
        self._next: dict[tuple[str, str], int] = {}
        self._halves: set[str] = set()
        """Pairs of which one match is known."""
        self.n_matches = 0
        for (blue, red), row in counts.items():
            self._counts[blue][red] = list(row)
            self._count(blue, red, *row)
        for identity in identities:
            self._note(identity)

    def add(self, outcome: Outcome) -> None:
        """Count a match that was stored."""
        blue, red, winner = outcome.blue, outcome.red, outcome.result.winner
        row = self._counts[blue].setdefault(red, [0, 0, 0])
        column = 1 if winner is None else 0 if winner is Team.BLUE else 2
        row[column] += 1
        self._count(blue, red, *(int(number == column) for number in range(3)))
        if outcome.result.ending is Termination.FORFEIT and winner is not None:
            self.forfeits[blue if winner is Team.RED else red] += 1
        self._note(outcome.identity)

    def _count(self, blue: str, red: str, won: int, drawn: int, lost: int) -> None:
        self.n_matches += won + drawn + lost
        for label, other, wins, losses in ((blue, red, won, lost), (red, blue, lost, won)):
            self._met[label].add(other)
            record = self._records[label]
            record.wins, record.draws, record.losses = record.wins + wins, record.draws + drawn, record.losses + losses

    def _note(self, identity: str) -> None:
        match = LeagueMatchId.parse(identity)
        self.skip_pair(match.one, match.other, match.pair)
        self._halves ^= {match.pair_id}

    @property
    def halves(self) -> frozenset[str]:
        """The pairs of which one match of two is known."""
        return frozenset(self._halves)

    def take_pair(self, one: str, other: str) -> int:
        """Return the number of the pair of a fixture that nobody has begun yet, and never again."""
        number = self._next.get((one, other), 0)
        self._next[one, other] = number + 1
        return number

    def skip_pair(self, one: str, other: str, number: int) -> None:
        """Take note that a pair was begun."""
        self._next[one, other] = max(self._next.get((one, other), 0), number + 1)

    def find_rated(self, current: Sequence[str]) -> list[str]:
        """Return the current labels, and behind them those of earlier versions that say something of their strength."""
        known = set(current)
        n_met: dict[str, int] = {}
        for label in current:
            for other in self._met[label]:
                if other not in known:
                    n_met[other] = n_met.get(other, 0) + self.n_between(label, other)
        earlier = sorted(n_met, key=lambda label: (-n_met[label], label))
        return [*current, *earlier[:MOST_EARLIER]]

    def n_between(self, one: str, other: str) -> int:
        """Return how many matches two have played."""
        return sum(self._counts[one].get(other, ())) + sum(self._counts[other].get(one, ()))

    def table(self, labels: Sequence[str]) -> Floats:
        """Return how often blue `i` beat, drew with and lost to red `j`, shape (labels, labels, 3)."""
        index = {label: number for number, label in enumerate(labels)}
        table = np.zeros((len(labels), len(labels), 3))
        for label, number in index.items():
            for other, row in self._counts[label].items():
                if other in index:
                    table[number, index[other]] = row
        return table

    def record(self, label: str) -> Record:
        """Return how often a label won, drew and lost."""
        return self._records[label]


def n_pairs_of(table: Floats) -> Ints:
    """Return how many pairs any two have played, from `Results.table`; half a pair counts."""
    n = table.sum(axis=2)
    found: Ints = ((n + n.T + 1) // 2).astype(np.int64)
    return found
