"""Made-up leagues, whose truth is known."""

from collections.abc import Sequence
from math import log

import numpy as np
from outcomes import met

from arena.game.types import Team
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.ratings.davidson import ELO, chances

WINNERS = (Team.BLUE, None, Team.RED)
SEATS = {team: SeatOutcome() for team in Team}
NU = 2 / 9
"""Equals draw a tenth of their matches."""


def play(
    elos: Sequence[float], n_pairs: int, rng: np.random.Generator, *, side_elo: float = 0.0, luck: float = 0.0
) -> list[Outcome]:
    """Return a league that follows the model; entries are called by their place.

    With `luck`, each map is worth so many units to either entry, whatever its side: the matches of a pair go alike.
    """
    shares = chances(np.array([*elos, side_elo, ELO * log(NU)]) / ELO)
    outcomes = []
    for one in range(len(elos)):
        for other in range(one + 1, len(elos)):
            if luck:
                outcomes += alike(one, other, (elos[one] - elos[other]) / ELO, luck * rng.choice((-1, 1), size=n_pairs), rng)
                continue
            for blue, red in ((one, other), (other, one)):
                for pair, result in enumerate(rng.choice(3, size=n_pairs, p=shares[blue, red])):
                    outcomes.append(met(f"{one:02}", f"{other:02}", pair, f"{blue:02}", WINNERS[result], seats=SEATS))
    return outcomes


def alike(one: int, other: int, d: float, luck: np.ndarray, rng: np.random.Generator) -> list[Outcome]:
    """Return the pairs of a fixture, on maps that favour one of its entries."""
    outcomes = []
    for pair, lead in enumerate(luck):
        for blue, sign in ((one, 1), (other, -1)):
            half = sign * (d + lead) / 2
            odds = np.array([np.exp(half), NU, np.exp(-half)])
            result = rng.choice(3, p=odds / odds.sum())
            outcomes.append(met(f"{one:02}", f"{other:02}", pair, f"{blue:02}", WINNERS[result], seats=SEATS))
    return outcomes
