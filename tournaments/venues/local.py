"""The venue `local`: all matches in this process and its workers, without a clock; strangers behind walls beside them."""

import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from arena.errors import ArenaError
from arena.game.types import Team
from arena.local.venue import MatchRecord
from arena.local.venue import play as play_matches
from arena.match.time_control import TimeControl
from arena.policy import Faults
from arena.records.journal_folder import JournalFolder
from arena.records.plan import MatchPlan
from arena.sandbox.process import Sandbox
from policies.registry import is_file_or_program
from policies.workers.load import TURN_S, load_walled
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.venues.recovery import check_journal, find_ended
from tournaments.venues.setting import VenueSetting

_SEATS_PER_WORKER, _CORES_PER_WORKER = 8, 2
"""Where fighters play behind walls: they think side by side, in processes of their own."""


def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play in this process and its workers.

    A fighter behind a wall has processes of its own beside them. No clock runs; one that takes longer for a turn than the
    league's clock would ever let it is ended, and its units stay until the match is over.

    Raises
    ------
    InputError
        A fighter cannot be loaded, or no wall can be built on this machine.
    """
    load = partial(load_walled, dict(setting.entries), walled(setting), patience_s(setting.time_control), _SEATS_PER_WORKER)
    n_workers = None
    if walled(setting):
        n_workers = -(-len(os.sched_getaffinity(0)) // _CORES_PER_WORKER)
    return play_rest(
        setting,
        plans,
        lambda left: play_matches(setting.ruleset, left, load, journals=setting.journals, n_workers=n_workers),
    )


def walled(setting: VenueSetting) -> dict[str, Sandbox]:
    """Return the sandboxes of those entries that play behind walls."""
    return {name: sandbox for name, sandbox in setting.sandboxes.items() if sandbox.has_wall and name in setting.entries}


def patience_s(time_control: TimeControl | None) -> float | None:
    """Return how long a fighter behind a wall may take for a turn where no clock runs; None waits for ever."""
    if time_control is None or time_control.turn_time_s is None:
        return None
    return max(time_control.turn_time_s + time_control.bank_s, TURN_S)


def play_rest(
    setting: VenueSetting, plans: Sequence[MatchPlan], play: Callable[[list[MatchPlan]], Iterator[MatchRecord]]
) -> Iterator[Outcome]:
    """Yield the matches whose journals are whole, and play the others.

    Raises
    ------
    ArenaError
        The journal of a match in which a trusted file played does not hold. Such a file shares its memory with the board, and
        can write there; what it wrote is no result. (It can also give orders for its enemy, which nobody sees: only a wall
        keeps it away from the board.)
    """
    apart = walled(setting)
    trusted = {name: spec for name, spec in setting.entries.items() if is_file_or_program(spec) and name not in apart}
    left = {plan.identity: plan for plan in plans}
    for outcome in find_ended(setting.journals, setting.ruleset, plans):
        del left[outcome.identity]
        yield outcome
    kept = JournalFolder(setting.journals)
    for record in play(list(left.values())):
        files = [trusted[name] for name in (record.plan.blue, record.plan.red) if name in trusted]
        if files:
            _check(kept, setting, record, files)
        faults = zip(Team, record.n_unreadable, record.faults, strict=True)
        yield Outcome.of(record.plan, record.result, {team: _of_seat(n, counted) for team, n, counted in faults})


def _of_seat(n_unreadable: int, faults: Faults) -> SeatOutcome:
    return SeatOutcome(faults={**({"unreadable": n_unreadable} if n_unreadable else {}), **faults.counted})


def _check(kept: JournalFolder, setting: VenueSetting, record: MatchRecord, files: Sequence[str]) -> None:
    try:
        check_journal(kept, setting.ruleset, record.plan, record.result)
    except ArenaError as error:
        who = " or ".join(dict.fromkeys(files))
        raise ArenaError(
            f"match {record.plan.identity} is not stored, and the league stops: {error}. The board was changed by {who}; take "
            'it out of the league, or out of "trusted", so that it plays behind a wall'
        ) from error
