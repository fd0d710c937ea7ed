"""The final of a season: a league of all its entries, each as it plays now, on fresh maps under a secret of its own."""

from dataclasses import replace

from tournaments.league.league import League
from tournaments.league.season import FINAL_SUFFIX
from tournaments.season.roster import Roster


def make_final(season: League, roster: Roster) -> League:
    """Return the final as a league; it is run, stopped and reported as every other.

    Raises
    ------
    ValueError
        The terms of the season have none.
    """
    if season.season is None or season.season.final_pairs == 0:
        raise ValueError(f"{season.name} has no final")
    fighters = {entry.entry: roster.fighters[label] for label, entry in roster.entries.items()}
    return replace(
        season,
        name=season.name + FINAL_SUFFIX,
        season=None,
        entries={entry: fighter.spec for entry, fighter in sorted(fighters.items())},
        commands={entry: command for entry, command in season.commands.items() if entry in fighters},
        trusted=season.trusted & fighters.keys(),
        n_pairs=season.season.final_pairs,
        seed=None,
        secret=None,
    )
