"""The venue `local`: all matches in this process and its workers, without a clock."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from arena.game.types import Team
from arena.local.venue import MatchRecord
from arena.local.venue import play as play_matches
from arena.records.plan import MatchPlan
from policies.registry import load_entry
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.venues.recovery import find_ended
from tournaments.venues.setting import VenueSetting


def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play in this process and its workers."""
    load = partial(load_entry, dict(setting.entries))
    return play_rest(setting, plans, lambda left: play_matches(setting.ruleset, left, load, journals=setting.journals))


def play_rest(
    setting: VenueSetting, plans: Sequence[MatchPlan], play: Callable[[list[MatchPlan]], Iterator[MatchRecord]]
) -> Iterator[Outcome]:
    """Yield the matches whose journals are whole, and play the others."""
    left = {plan.identity: plan for plan in plans}
    for outcome in find_ended(setting.journals, setting.ruleset, plans):
        del left[outcome.identity]
        yield outcome
    for record in play(list(left.values())):
        unreadable = zip(Team, record.n_unreadable, strict=True)
        seats = {team: SeatOutcome(faults={"unreadable": n} if n else {}) for team, n in unreadable}
        yield Outcome.of(record.plan, record.result, seats)
