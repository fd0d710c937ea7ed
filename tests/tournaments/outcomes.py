"""Matches that nobody played, to try on them what is made of results."""

from dataclasses import replace
from typing import Any

from arena.game.types import Team, Termination
from arena.policy import MatchResult
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome, SeatOutcome


def ended(
    identity: str, blue: str, red: str, winner: Team | None = None, seats: dict[Team, SeatOutcome] | None = None, **result: Any
) -> Outcome:
    """Return a match that ended by capture, or otherwise as `result` says."""
    given = {"ending": Termination.CAPTURE, "winner": winner, "score": 0, "ticks": 10, **result}
    seats = dict.fromkeys(Team, SeatOutcome()) if seats is None else seats
    return Outcome(identity=identity, blue=blue, red=red, result=MatchResult(**given), seats=seats)


def met(one: str, other: str, pair: int, blue: str, winner: Team | None, *, league: str = "l", **more: Any) -> Outcome:
    """Return a match of a fixture, in which `blue` was blue and that side won."""
    match = LeagueMatchId(league=league, one=one, other=other, pair=pair, blue=blue)
    return ended(str(match), blue, other if blue == one else one, winner, **more)


def changed(outcome: Outcome, **result: Any) -> Outcome:
    """Return a match that ended otherwise."""
    return replace(outcome, result=replace(outcome.result, **result))
