"""What a season is at, by its terms and the clock: open, frozen, at its final, or over. Pure."""

from enum import Enum

from tournaments.league.season import SeasonTerms


class Phase(Enum):
    """Each follows from the one before it."""

    OPEN = "open"
    """Submissions are taken and played, and everyone sees the table."""
    FROZEN = "frozen"
    """The same, but the public table stands still."""
    FINAL = "final"
    """No submission is taken any more, and a league of all entries is played on fresh maps."""
    OVER = "over"
    """The final is played, or there is none, and the secrets are known."""


def find_phase(terms: SeasonTerms, now_s: float, *, n_waiting: int, is_closed: bool) -> Phase:
    """Return the phase of a season.

    Parameters
    ----------
    n_waiting
        Submissions that came in time, and wait for their check: the final waits for them.
    is_closed
        Whether the season's secret was published.
    """
    if is_closed:
        return Phase.OVER
    if not terms.is_open(now_s) and n_waiting == 0:
        return Phase.FINAL
    return Phase.FROZEN if terms.is_frozen(now_s) else Phase.OPEN
