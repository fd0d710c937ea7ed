"""A league's report: one document, its leaderboard, and what there is to say of it. `formats` writes it.

The same results give the same document to the byte, however often the league was stopped on its way: what a clock measured, and
when the report was written, stands under the one key `wall`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from tournaments.league.schedule import count_matches
from tournaments.league.versions import successions
from tournaments.outcome import Outcome
from tournaments.ratings.methods import DEFAULT, check_versions, find_method
from tournaments.ratings.rate import N_DRAWS
from tournaments.ratings.shares import find_shares
from tournaments.ratings.sprt import PAIR_SCORES
from tournaments.ratings.standings import Standings, stand
from tournaments.reports.leaderboard import rounded, row_to_dict
from tournaments.reports.opponents import find_opponents, opponents_to_dict
from tournaments.reports.version_curves import Step, curve_lines, curves_to_dict, find_curves
from tournaments.running.duel import Duel, judge
from tournaments.store.store import StoredLeague

FORMAT = 1
"""Of the JSON document; rises whenever a key changes its meaning."""
LATENCY_NOTE = "p50 is the median over matches, p99 that of the worst; of a match, since its referee was last started"
"""What the columns of answer times are of."""
MOST_SHOWN = 5
"""Residuals, and cycles, that are shown; the document holds all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A league's standings, and what they were made from."""

    league: StoredLeague
    standings: Standings
    rating_method: str = DEFAULT
    outcomes: tuple[Outcome, ...]
    n_planned: int
    n_earlier: int = 0
    """Matches of earlier versions that are stored, and not in the standings."""
    has_all_versions: bool = False
    """Whether every version that has played is in the standings, under its label, or the current ones alone."""
    written_at: datetime
    duel: Duel | None = None
    """The test that the league plays, if it plays one; then only the matches of its pairs are reported."""
    findings: tuple[str, ...] = ()
    """Sentences on what a reader should beware of, beside those that `warnings` finds itself."""

    @property
    def curves(self) -> dict[str, tuple[Step, ...]]:
        """The versions of each entry that has several, where all are rated."""
        return find_curves(self.standings, self.league.definition["entries"]) if self.has_all_versions else {}

    @property
    def is_complete(self) -> bool:
        """Whether every match was played, or enough of them to decide a test."""
        return (self.duel is not None and self.duel.is_decided) or self.standings.n_matches >= self.n_planned


def make_report(
    league: StoredLeague,
    outcomes: Iterable[Outcome],
    *,
    n_draws: int = N_DRAWS,
    findings: Iterable[str] = (),
    rating_method: str = DEFAULT,
    has_all_versions: bool = False,
    shares: Iterable[str] = (),
) -> Report:
    """Return the report of a league: of the current versions of its entries, or of every one that has played."""
    outcomes = tuple(outcomes)
    current = tuple(league.current(outcomes))
    test = None if has_all_versions else judge(league.definition, current)
    counted = outcomes if has_all_versions else current if test is None else test.outcomes
    n_earlier = len(outcomes) - len(current)
    names = list(league.definition["entries"])
    n_planned = count_matches(len(names), league.n_pairs, is_gauntlet="challenger" in league.definition)
    if has_all_versions:
        names = sorted({*names, *(label for one in outcomes for label in (one.blue, one.red))})
        n_planned += n_earlier
    method, follows = find_method(rating_method), successions(names) if has_all_versions else []
    if follows:
        check_versions(method, rating_method)
    return Report(
        league=league,
        standings=stand(
            names,
            counted,
            are_maps_fresh=league.definition.get("maps") == "fresh",
            n_draws=n_draws,
            method=method,
            follows=follows,
            share_methods={name: find_shares(name) for name in shares},
        ),
        rating_method=rating_method,
        outcomes=counted,
        n_planned=n_planned,
        n_earlier=0 if has_all_versions else n_earlier,
        has_all_versions=has_all_versions,
        written_at=datetime.now(UTC),
        duel=test,
        findings=tuple(findings),
    )


def to_document(report: Report) -> dict[str, Any]:
    """Return the report as what JSON can hold; numbers are rounded to what they can mean."""
    league, standings = report.league, report.standings
    return {
        "format": FORMAT,
        "league": {
            "name": league.name,
            "hash": league.hash,
            **league.definition,
            "secret": None if league.secret is None else league.secret.hex(),
            "secret_commitment": league.definition.get("secret"),
            "pairs": league.n_pairs,
        },
        "matches": {
            "played": standings.n_matches,
            "planned": report.n_planned,
            "complete": report.is_complete,
            **({"of_earlier_versions": report.n_earlier} if report.n_earlier else {}),
            "ticks": standings.n_ticks,
            "endings": dict(standings.endings),
        },
        **({} if report.rating_method == DEFAULT else {"rating_method": report.rating_method}),
        "standings": [row_to_dict(row) for row in standings.rows],
        **({"versions": curves_to_dict(report.curves)} if report.has_all_versions else {}),
        "cross": {
            row.name: {
                other.name: asdict(record) | {"score": rounded(record.score, 4)}
                for other in standings.rows
                if (record := standings.cross.get((row.name, other.name))) is not None
            }
            for row in standings.rows
        },
        "superiority": {
            row.name: {
                other.name: rounded(standings.superiority.get((row.name, other.name)), 4)
                for other in standings.rows
                if other.name != row.name
            }
            for row in standings.rows
        },
        "side": {name: rounded(value, 4) for name, value in asdict(standings.side).items()}
        | {"significant": standings.side.is_significant},
        "draw_rate": rounded(standings.draw_rate, 4),
        "residuals": [{name: rounded(value, 4) for name, value in asdict(residual).items()} for residual in standings.residuals],
        "opponents": opponents_to_dict(find_opponents(standings)),
        "cycles": [
            {"entries": list(cycle.entries), "scores": [rounded(score, 4) for score in cycle.scores], "p": rounded(cycle.p, 6)}
            for cycle in standings.cycles
        ],
        **({} if report.duel is None else {"sprt": report.duel.to_dict(league.n_pairs)}),
        "wall": {
            "written_at": report.written_at.isoformat(timespec="seconds"),
            "latency": {row.name: None if row.latency is None else asdict(row.latency) for row in standings.rows},
        },
    }


def warnings(report: Report) -> list[str]:
    """Return what a reader should beware of, a sentence each."""
    standings = report.standings
    side = standings.side
    favoured = "blue" if side.bias > 0 else "red"
    share = 100 * (1 + abs(side.bias)) / 2
    unfair = f"{favoured} is favoured: it takes {share:.1f}% of the points, and the 95% interval of its lead excludes 0"
    return [
        *([unfair] if side.is_significant else []),
        *_first([cycle.sentence for cycle in standings.cycles], "circles"),
        *_first([residual.sentence for residual in standings.residuals if residual.is_significant], "such fixtures"),
        *report.findings,
    ]


def _first(sentences: Sequence[str], what: str) -> list[str]:
    """Return the first of many sentences, and how many there are more."""
    n_more = len(sentences) - MOST_SHOWN
    return [*sentences[:MOST_SHOWN], *([f"{n_more} more {what} are in the JSON document"] if n_more > 0 else [])]


def verdict_lines(report: Report) -> list[str]:
    """Return what the test of a league says, a line each; nothing if it plays none."""
    test = report.duel
    if test is None:
        return []
    low, high = test.sprt.bounds
    counts = ", ".join(f"{n:,} of {score:g}" for n, score in zip(test.sprt.counts, PAIR_SCORES, strict=True))
    lines = [
        test.verdict(report.league.n_pairs),
        f"log likelihood ratio {test.sprt.llr:+.2f}: no at {low:+.2f}, yes at {high:+.2f} "
        f"(elo0 {test.sprt.elo0:g}, elo1 {test.sprt.elo1:g}, alpha {test.sprt.alpha:g}, beta {test.sprt.beta:g})",
        f"pairs by points of {test.challenger}: {counts}",
    ]
    if test.n_beyond:
        lines.append(f"{test.n_beyond:,} matches beyond the deciding pair are stored and do not count")
    return lines


def summary(report: Report) -> list[str]:
    """Return what stands under the leaderboard, a line each."""
    league, standings = report.league, report.standings
    side = standings.side
    endings = ", ".join(f"{n:,} by {name.replace('_', ' ')}" for name, n in standings.endings.items())
    played = f"{standings.n_matches:,} of {report.n_planned:,}" if not report.is_complete else f"{standings.n_matches:,}"
    lines = [f"league {league.name}: {played} matches{f' ({endings})' if endings else ''}; rules {league.definition['ruleset']}"]
    if standings.n_matches:
        verdict = "a side is favoured" if side.is_significant else "no side is shown to be favoured"
        lines.append(
            f"blue won {side.blue_wins:,}, red won {side.red_wins:,}; blue's points less red's {side.bias:+.3f} a match "
            f"({side.bias_low:+.3f} to {side.bias_high:+.3f}): {verdict}"
        )
        drawn = f"drawn {side.draws:,} ({side.draws / standings.n_matches:.1%})"
        rate = standings.draw_rate
        lines.append(drawn if rate is None else f"{drawn}; two of equal strength would draw {rate:.1%} of their matches")
    if report.n_earlier:
        lines.append(f"{report.n_earlier:,} matches of earlier versions are stored and not counted; --all-versions counts them")
    lines += curve_lines(report.curves)
    if report.rating_method != DEFAULT:
        lines.append(f"ratings by the method {report.rating_method}")
    if any(row.latency for row in standings.rows):
        lines.append(LATENCY_NOTE)
    lines += [f"test: {sentence}" for sentence in verdict_lines(report)]
    lines += [f"warning: {sentence}" for sentence in warnings(report)]
    if not report.is_complete:
        lines.append("the league is not over: arena tournament run goes on with it")
    if league.secret is not None:
        lines.append(f"the league is closed; all its maps and fights follow from the secret {league.secret.hex()}")
    return lines
