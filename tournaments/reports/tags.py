"""Tags: what is remarkable about a match, in a word.

upset
    Won by the entry that the league rates lower, by `UPSET_ELO` or more.
longest
    No match of the league that a capture or an elimination decided lasted more ticks.
comeback
    The winner was behind by `COMEBACK_SCORE` or more at some tick.
no contact
    No two enemy units ever fought.

The first two follow from a league's results, the others from a match's journal, which may be read when it may be seen.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from arena.game.state import StateField
from arena.game.types import Team, Termination
from arena.policy import MatchResult
from arena.records.journal import Journal
from arena.records.replay import replay
from tournaments.outcome import Outcome

UPSET_ELO = 100
COMEBACK_SCORE = 20
"""Two units."""
MEANINGS = {
    "upset": f"won by the entry that is rated lower, by {UPSET_ELO} Elo or more",
    "longest": "no match of the league that a capture or an elimination decided lasted more ticks",
    "comeback": f"the winner was behind by {COMEBACK_SCORE} points or more",
    "no contact": "no two enemy units ever fought",
}
_DECIDED = (Termination.CAPTURE, Termination.ELIMINATION)


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What tags need to know of how a match went."""

    lowest: int
    """Blue's lowest score."""
    highest: int
    has_contact: bool


def read_course(journal: Journal) -> Course:
    """Play a match again; `BrokenChainError` if its journal does not hold."""
    scores, has_contact = [], False
    for games in replay(journal):
        scores.append(int(games.state.field[0, StateField.SCORE]))
        has_contact = has_contact or bool(games.events.fought[0].any())
    return Course(lowest=min(scores), highest=max(scores), has_contact=has_contact)


def tag_results(outcomes: Iterable[Outcome], elo: Mapping[str, float]) -> dict[str, list[str]]:
    """Return the tags of a league's matches that follow from its results, by the identity of each match that has any.

    Parameters
    ----------
    elo
        Every entry's rating.
    """
    outcomes = list(outcomes)
    longest = max((one.result.ticks for one in outcomes if one.result.ending in _DECIDED), default=None)
    tags: dict[str, list[str]] = {}
    for one in outcomes:
        loser = one.red if one.winner == one.blue else one.blue
        if one.winner is not None and elo[loser] - elo[one.winner] >= UPSET_ELO:
            tags.setdefault(one.identity, []).append("upset")
        if one.result.ending in _DECIDED and one.result.ticks == longest:
            tags.setdefault(one.identity, []).append("longest")
    return tags


def tag_course(result: MatchResult, course: Course) -> list[str]:
    """Return the tags of a match that follow from how it went."""
    behind = {Team.BLUE: -course.lowest, Team.RED: course.highest, None: 0}[result.winner]
    return [
        *(["comeback"] if behind >= COMEBACK_SCORE else []),
        *([] if course.has_contact else ["no contact"]),
    ]
