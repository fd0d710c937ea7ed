"""The versions of an entry beside each other: how its rating went from code to code."""

from collections import defaultdict
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tournaments.league.versions import entry_of, number_of
from tournaments.ratings.standings import Standing, Standings
from tournaments.reports.leaderboard import rounded


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One version of an entry."""

    number: int
    """From 1."""
    row: Standing
    """As it stands among all versions of all entries."""
    is_current: bool
    """Whether the league plays it now."""
    better: float | None = None
    """How likely it is stronger than the version before it; None of the first, and where a method of ratings does not say."""


def find_curves(standings: Standings, current: Container[str]) -> dict[str, tuple[Step, ...]]:
    """Return the versions of each entry that has several in the standings, in their order.

    Parameters
    ----------
    current
        Labels of the versions that the league plays now.
    """
    of_entry: defaultdict[str, list[Standing]] = defaultdict(list)
    for row in sorted(standings.rows, key=lambda row: number_of(row.name)):
        of_entry[entry_of(row.name)].append(row)
    return {
        entry: tuple(
            Step(
                number=number_of(row.name),
                row=row,
                is_current=row.name in current,
                better=standings.superiority.get((row.name, rows[place - 1].name)) if place else None,
            )
            for place, row in enumerate(rows)
        )
        for entry, rows in sorted(of_entry.items())
        if len(rows) > 1
    }


def curves_to_dict(curves: Mapping[str, Sequence[Step]]) -> dict[str, Any]:
    """Return the versions of each entry as JSON holds them."""
    return {
        entry: [
            {
                "version": step.number,
                "label": step.row.name,
                "current": step.is_current,
                "elo": rounded(step.row.rating.elo, 1),
                "elo_low": rounded(step.row.rating.elo_low, 1),
                "elo_high": rounded(step.row.rating.elo_high, 1),
                "matches": step.row.record.n_matches,
                "better_than_before": rounded(step.better, 4),
            }
            for step in steps
        ]
        for entry, steps in curves.items()
    }


def curve_lines(curves: Mapping[str, Sequence[Step]]) -> list[str]:
    """Return how each entry went from version to version, a line each."""
    return [f"versions of {entry}: {', '.join(map(_says, steps))}" for entry, steps in curves.items()]


def _says(step: Step) -> str:
    facts = [*(["current"] if step.is_current else []), *([] if step.better is None else [f"{step.better:.0%} better"])]
    return f"{step.number} {step.row.rating.elo:+.0f}" + (f" ({', '.join(facts)})" if facts else "")
