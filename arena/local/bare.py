"""Plans, results and faults as they cross to another process: bare tuples, for dataclasses took longer to pickle than to play."""

from collections.abc import Sequence

from arena.game.keys import MatchKeys
from arena.policy import Faults, MatchResult
from arena.records.plan import MatchPlan

BarePlan = tuple[str, str, str, bytes, bytes]
BareResult = tuple[int, int, int, int]
"""As `arena.records.replay.make_result` takes it."""
_OfOne = tuple[int, int, str | None, dict[str, tuple[str, int]], dict[str, int]]
BareFaults = tuple[_OfOne, _OfOne] | None
"""Of both teams; mostly, nothing went wrong."""
NO_FAULTS = Faults(), Faults()
"""Of all matches in which nothing went wrong: to be read, never added to."""


def strip(plans: Sequence[MatchPlan]) -> list[BarePlan]:
    """Return plans as they cross."""
    return [(plan.identity, plan.blue, plan.red, plan.keys.map_key, plan.keys.match_key) for plan in plans]


def dress(plans: Sequence[BarePlan]) -> list[MatchPlan]:
    """Return plans that crossed."""
    return [MatchPlan(identity, blue, red, MatchKeys(map_key, match_key)) for identity, blue, red, map_key, match_key in plans]


def strip_result(result: MatchResult) -> BareResult:
    """Return a result as it crosses."""
    return int(result.ending), -1 if result.winner is None else int(result.winner), result.score, result.ticks


def strip_faults(faults: tuple[Faults, Faults]) -> BareFaults:
    """Return the faults of both teams as they cross."""
    return None if faults is NO_FAULTS or faults == NO_FAULTS else (_strip(faults[0]), _strip(faults[1]))


def dress_faults(bare: BareFaults) -> tuple[Faults, Faults]:
    """Return faults that crossed."""
    return NO_FAULTS if bare is None else (_dress(*bare[0]), _dress(*bare[1]))


def _strip(one: Faults) -> _OfOne:
    return one.raised, one.illegal, one.first_traceback, one.reasons, one.counted


def _dress(
    raised: int, illegal: int, first_traceback: str | None, reasons: dict[str, tuple[str, int]], counted: dict[str, int]
) -> Faults:
    return Faults(raised=raised, illegal=illegal, first_traceback=first_traceback, reasons=reasons, counted=counted)
