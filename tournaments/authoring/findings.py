"""What a check of a bot has found, as data and in words."""

from dataclasses import asdict, dataclass
from typing import Any

from arena.console import quantity
from tournaments.authoring.turn_times import TurnTimes


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something that would go wrong in a league."""

    kind: str
    """`load`, `start`, `time`, `process`, `orders`, `chance`, `memory` or `output`."""
    sentence: str
    count: int = 1
    """How often it happened."""
    is_fatal: bool = False
    """Whether a league would refuse the bot for it, or forfeit its matches."""

    def describe(self) -> str:
        """Return it as a line."""
        often = f" ({self.count:,} times)" if self.count > 1 else ""
        return f"{'error' if self.is_fatal else 'warning'}: {self.sentence}{often}"


@dataclass(frozen=True, slots=True, kw_only=True)
class AllTurnTimes(TurnTimes):
    """How long all turns of a check took, as a client measures it."""

    n_turns: int
    worst_at: str
    """As in "tick 17 of match 3, red against rush"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What a check of a bot has found."""

    bot: str
    rules: str
    opponents: tuple[str, ...]
    no_wall: str | None
    """Why it was not checked behind a wall; None if it was."""
    size_bytes: int | None
    """Of its file, or of the files that its command line names; None where there is none, as for a fighter that ships."""
    load_s: float | None
    """Until its process was ready; None if it never was."""
    matches: tuple[str, ...] = ()
    """What was played, and how each ended, from the bot's side."""
    wins: int = 0
    draws: int = 0
    losses: int = 0
    times: AllTurnTimes | None = None
    memory_bytes: int | None = None
    """Of one process that played all matches, after the last; None where the system does not tell."""
    growth_bytes: int | None = None
    """By which that process grew a match."""
    findings: tuple[Finding, ...] = ()

    @property
    def is_accepted(self) -> bool:
        """Whether a league would take the bot, and forfeit none of its matches for it."""
        return not any(finding.is_fatal for finding in self.findings)

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON shows of it."""
        return {"ok": self.is_accepted, **asdict(self)}

    def describe(self) -> list[str]:
        """Return it as lines."""
        size = [] if self.size_bytes is None else [_size(self.size_bytes)]
        ready = [] if self.load_s is None else [f"ready after {self.load_s:.2f} s"]
        lines = [f"{self.bot}: {', '.join(size + ready) or 'never ready'}"]
        lines.append(
            "played behind a wall, under a pit's limits"
            if self.no_wall is None
            else f"played WITHOUT a wall, which a league would build, because {self.no_wall}"
        )
        if self.matches:
            n_matches = quantity(len(self.matches), "match", "matches")
            against = f"under {self.rules} against {', '.join(self.opponents)}"
            lines.append(f"{n_matches} {against}: {self.wins} won, {self.draws} drawn, {self.losses} lost")
        if self.times is not None:
            took = (
                f"{self.times.median_ms:.1f} ms (median), {self.times.p99_ms:.1f} ms (p99), {self.times.worst_ms:.1f} ms at worst"
            )
            lines.append(f"{self.times.n_turns:,} turns: {took}, {self.times.worst_at}")
        if self.memory_bytes is not None:
            growth = "" if self.growth_bytes is None else f", {self.growth_bytes / 1e6:+.2f} MB a match"
            lines.append(f"memory: {self.memory_bytes / 1e6:.0f} MB{growth}")
        lines += [finding.describe() for finding in sorted(self.findings, key=lambda finding: not finding.is_fatal)]
        lines.append("a league would take it" if self.is_accepted else "a league would refuse it, or forfeit its matches")
        return lines


def _size(n_bytes: int) -> str:
    return (
        f"{n_bytes:,} bytes" if n_bytes < 10_000 else f"{n_bytes / 1e3:,.0f} kB" if n_bytes < 1e7 else f"{n_bytes / 1e6:,.0f} MB"
    )
