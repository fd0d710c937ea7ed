"""How an entry of a season stands, as its owner is told."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from arena.game.types import Team
from tournaments.league.versions import entry_of
from tournaments.outcome import Outcome
from tournaments.store.season_store import Submission


def tell_submission(one: Submission) -> dict[str, Any]:
    """Return a submission as its owner is told of it."""
    return {name: value for name, value in asdict(one).items() if name not in ("entry", "owner", "report")}


def tell_match(outcome: Outcome, entry: str) -> dict[str, Any]:
    """Return a match as the owner of one of its entries is told of it."""
    team = Team.BLUE if entry_of(outcome.blue) == entry else Team.RED
    own, other = (outcome.blue, outcome.red) if team is Team.BLUE else (outcome.red, outcome.blue)
    result = outcome.result
    return {
        "label": own, "opponent": other, "team": team.name.lower(), "points": result.points(team),
        "how": result.seen_by(team).describe(team),
    }  # fmt: skip


def summarise(facts: Mapping[str, Any]) -> str:
    """Return in a sentence how an entry stands."""
    entry, queue, number = facts["entry"], facts["queue"], facts["plays"]
    parts = [] if queue is None else [f"{entry} waits for its check, as number {queue} of the queue"]
    if number is not None and facts.get("is_suspended"):
        why = "its process ends, or its matches are void, again and again"
        parts.append(f"version {number} of {entry} is not played for now, since {why}; --log shows its log")
    elif number is not None:
        parts.append(f"version {number} of {entry} plays")
    return "; ".join(parts) or f"{entry} does not play"
