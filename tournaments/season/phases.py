"""What a season that is played is at, by its terms and the clock. Pure."""

from tournaments.league.season import Phase, SeasonTerms


def find_phase(terms: SeasonTerms, now_s: float, *, n_waiting: int) -> Phase:
    """Return the phase of a season whose secret was not published yet.

    Parameters
    ----------
    n_waiting
        Submissions that came in time, and wait for their check: the final waits for them.
    """
    if not terms.is_open(now_s) and n_waiting == 0:
        return Phase.FINAL
    return Phase.FROZEN if terms.is_frozen(now_s) else Phase.OPEN
