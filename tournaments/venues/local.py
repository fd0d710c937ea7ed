"""The venue `local`: all matches in this process and its workers, without a clock."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from arena.errors import ArenaError
from arena.game.types import Team
from arena.local.venue import MatchRecord
from arena.local.venue import play as play_matches
from arena.records.plan import MatchPlan
from policies.registry import is_file_or_program, load_entry
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.venues.recovery import check_journal, find_ended
from tournaments.venues.setting import VenueSetting


def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play in this process and its workers."""
    load = partial(load_entry, dict(setting.entries))
    return play_rest(setting, plans, lambda left: play_matches(setting.ruleset, left, load, journals=setting.journals))


def play_rest(
    setting: VenueSetting, plans: Sequence[MatchPlan], play: Callable[[list[MatchPlan]], Iterator[MatchRecord]]
) -> Iterator[Outcome]:
    """Yield the matches whose journals are whole, and play the others.

    Raises
    ------
    ArenaError
        The journal of a match in which a stranger's file played does not hold. Such a file shares its memory with the board, and
        can write there; what it wrote is no result. (It can also give orders for its enemy, which nobody sees: only the venue
        `network` keeps it away from the board.)
    """
    strangers = {name: spec for name, spec in setting.entries.items() if is_file_or_program(spec)}
    left = {plan.identity: plan for plan in plans}
    for outcome in find_ended(setting.journals, setting.ruleset, plans):
        del left[outcome.identity]
        yield outcome
    for record in play(list(left.values())):
        files = [strangers[name] for name in (record.plan.blue, record.plan.red) if name in strangers]
        if files:
            _check(setting, record, files)
        unreadable = zip(Team, record.n_unreadable, strict=True)
        seats = {team: SeatOutcome(faults={"unreadable": n} if n else {}) for team, n in unreadable}
        yield Outcome.of(record.plan, record.result, seats)


def _check(setting: VenueSetting, record: MatchRecord, files: Sequence[str]) -> None:
    try:
        check_journal(setting.journals, setting.ruleset, record.plan, record.result)
    except ArenaError as error:
        who = " or ".join(dict.fromkeys(files))
        raise ArenaError(
            f"match {record.plan.identity} is not stored, and the league stops: {error}. The board was changed by {who}; take "
            'it out of the league, or play with venue = "network"'
        ) from error
