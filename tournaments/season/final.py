"""The final of a season: a league of all its entries, each as it plays now, on fresh maps under a secret of its own."""

import logging
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace

from tournaments.league.league import League
from tournaments.league.season import FINAL_SUFFIX
from tournaments.league.versions import entry_of
from tournaments.outcome import Outcome
from tournaments.running.scheduler import Folders, Scheduler
from tournaments.running.slots import MOST as MOST_SLOTS
from tournaments.season.roster import Roster
from tournaments.store.store import Store
from tournaments.venues.setting import EntryLostError, Venue

ABSENCE_S = 120.0
"""How long the final waits for those who join by themselves, once all others have played."""
logger = logging.getLogger(__name__)


def play_final(
    season: League, roster: Roster, store: Store, folders: Folders, play: Venue, *,
    is_stopped: Callable[[], bool], on_invitation: Callable[[Mapping[str, str]], None] | None = None,
) -> Iterator[Outcome]:  # fmt: skip
    """Play what is left of the final, yield each match once it is stored, and publish its secret, unless it is stopped.

    Whoever does not come, or cannot live, is left out: else one entry could keep the season from ever ending.
    """
    before = store.find(season.name + FINAL_SUFFIX)
    if before is not None and before.secret is not None:
        return  # a kill came between it and the end of the season
    lost: set[str] = set()
    while season.season is not None and season.season.final_pairs and len(roster.entries) - len(lost) > 1:
        try:
            with Scheduler(make_final(season, roster, lost), store, folders) as scheduler:
                for outcome in scheduler.run(
                    lambda setting, plans: play(replace(setting, absence_s=ABSENCE_S), plans),
                    on_invitation,
                    slots=season.slots or MOST_SLOTS,
                ):
                    yield outcome
                    if is_stopped():
                        return
                store.close(scheduler.row, scheduler.secret)
                return
        except EntryLostError as error:
            logger.warning("the final of season %s goes on without %s: %s", season.name, error.name, error)
            lost.add(entry_of(error.name))


def make_final(season: League, roster: Roster, lost: Collection[str] = ()) -> League:
    """Return the final as a league without the entries that are `lost`; it is run, stopped and reported as every other.

    Raises
    ------
    ValueError
        The terms of the season have none.
    """
    if season.season is None or season.season.final_pairs == 0:
        raise ValueError(f"{season.name} has no final")
    fighters = {entry.entry: roster.fighters[label] for label, entry in roster.entries.items() if entry.entry not in lost}
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
