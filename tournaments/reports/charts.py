"""What is drawn in a report: ratings with their intervals, the cross table as a heat map, what a side is worth.

Places are in percent of a drawing's width, so that a browser fits it to whatever screen there is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor

from tournaments.ratings.standings import Record, SideBias, Standing, Standings
from tournaments.reports.version_curves import Step

N_SHADES = 11
"""Of the heat map: 0 lost everything, 5 is even, 10 won everything; an odd number, so that even has a shade of its own."""
_ROW_PX = 42
_CURVE_PX = 150
_MARGIN = 6.5
_LONGEST = 28
"""Letters of a name that stand beside its rating on a phone."""
_ELO_STEPS = (10, 20, 50, 100, 200, 500, 1_000, 2_000, 5_000)
_BIAS_REACHES = (0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A value with its interval."""

    label: str
    value: str
    says: str
    """All of it, as a sentence."""
    low: float
    middle: float
    high: float
    y: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """Marks over one axis."""

    marks: list[Mark]
    ticks: list[tuple[float, str]]
    height: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """What a row's entry made of a column's."""

    shade: int
    text: str
    """Its score, in percent."""
    says: str
    pair: tuple[str, str]
    """Both, sorted: the name of their fixture."""
    is_upper: bool
    """Whether it is the first of the two cells of its fixture."""


def rating_plot(rows: Sequence[Standing]) -> Plot:
    """Return the ratings with their 95% intervals, the best on top."""
    low = min((row.rating.elo_low for row in rows), default=0.0)
    high = max((row.rating.elo_high for row in rows), default=0.0)
    first, last, step = _elo_axis(low, high)
    marks = []
    for number, row in enumerate(rows):
        rating = row.rating
        marks.append(
            Mark(
                label=row.name if len(row.name) <= _LONGEST else row.name[: _LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}",
                value=f"{rating.elo:+.0f}",
                says=f"{row.name}: {format_rating(row)}",
                low=_place(rating.elo_low, first, last),
                middle=_place(rating.elo, first, last),
                high=_place(rating.elo_high, first, last),
                y=_ROW_PX * number,
            )
        )
    ticks = [(_place(elo, first, last), f"{elo:+d}" if elo else "0") for elo in range(first, last + 1, step)]
    return Plot(marks=marks, ticks=ticks, height=_ROW_PX * len(marks))


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A version on the curve of its entry; across in percent, down in pixels."""

    label: str
    says: str
    """All of it, as a sentence."""
    x: float
    y: float
    y_low: float
    """Of the lower end of its interval, so the larger number."""
    y_high: float
    is_current: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """The versions of an entry over one axis of Elo."""

    entry: str
    points: list[Point]
    ticks: list[tuple[float, str]]
    height: int = _CURVE_PX


def curve_plots(curves: Mapping[str, Sequence[Step]]) -> list[Curve]:
    """Return a curve for each entry, all on the same axis."""
    ratings = [step.row.rating for steps in curves.values() for step in steps]
    first, last, step_elo = _elo_axis(
        min((one.elo_low for one in ratings), default=0.0), max((one.elo_high for one in ratings), default=0.0)
    )

    def down(elo: float) -> float:
        return round(_CURVE_PX * (last - elo) / (last - first), 1)

    ticks = [(down(elo), f"{elo:+d}" if elo else "0") for elo in range(first, last + 1, step_elo)]
    return [
        Curve(
            entry=entry,
            points=[
                Point(
                    label=f"{step.number}",
                    says=f"{step.row.name}: {format_rating(step.row)}{', played now' if step.is_current else ''}",
                    x=round(12 + 80 * (place + 0.5) / len(steps), 2),
                    y=down(step.row.rating.elo),
                    y_low=down(step.row.rating.elo_low),
                    y_high=down(step.row.rating.elo_high),
                    is_current=step.is_current,
                )
                for place, step in enumerate(steps)
            ],
            ticks=ticks,
        )
        for entry, steps in curves.items()
    ]


def format_rating(row: Standing) -> str:
    """Return a rating with its interval and its rank, in words."""
    rating = row.rating
    interval = f"{rating.elo_low:+.0f} to {rating.elo_high:+.0f}"
    return f"{rating.elo:+.0f} Elo, 95% interval {interval}, rank {row.rank_range}"


def _elo_axis(low: float, high: float) -> tuple[int, int, int]:
    """Return where an axis begins and ends, and the step between its ticks."""
    step = next((step for step in _ELO_STEPS if (high - low) / step <= 6), _ELO_STEPS[-1])
    return step * floor(low / step), step * max(ceil(high / step), floor(low / step) + 1), step


def side_plot(side: SideBias) -> Plot:
    """Return blue's lead over red with its interval, on an axis with 0 in its middle."""
    widest = max(abs(side.bias_low), abs(side.bias_high))
    reach = next((reach for reach in _BIAS_REACHES if widest <= reach), 1.0)
    says = f"blue's lead: {side.bias:+.3f} points a match, 95% interval {side.bias_low:+.3f} to {side.bias_high:+.3f}"
    mark = Mark(
        label="blue's lead",
        value=f"{side.bias:+.3f}",
        says=says,
        low=_place(side.bias_low, -reach, reach),
        middle=_place(side.bias, -reach, reach),
        high=_place(side.bias_high, -reach, reach),
        y=0,
    )
    values = (-reach, -reach / 2, 0.0, reach / 2, reach)
    return Plot(
        marks=[mark], ticks=[(_place(value, -reach, reach), f"{value:+.3g}" if value else "0") for value in values], height=26
    )


def chance_map(standings: Standings) -> Mapping[str, list[tuple[int, str] | None]]:
    """Return for each entry how likely it is the stronger of it and each other, as a shade and in percent; None beside itself."""
    names = [row.name for row in standings.rows]
    return {one: [_chance(standings.superiority.get((one, other))) for other in names] for one in names}


def _chance(share: float | None) -> tuple[int, str] | None:
    return None if share is None else (round(share * (N_SHADES - 1)), f"{100 * share:.0f}")


def heat_map(standings: Standings) -> Mapping[str, list[Cell | None]]:
    """Return a row of cells for each entry; None where two did not meet."""
    names = [row.name for row in standings.rows]
    return {one: [_cell(standings, one, other) for other in names] for one in names}


def _cell(standings: Standings, one: str, other: str) -> Cell | None:
    record = standings.cross.get((one, other))
    if record is None or record.score is None:
        return None
    return Cell(
        shade=round(record.score * (N_SHADES - 1)),
        text=f"{100 * record.score:.0f}",
        says=f"{one} v {other}: {format_record(record)}",
        pair=(one, other) if one < other else (other, one),
        is_upper=one < other,
    )


def format_record(record: Record) -> str:
    """Return wins, draws and losses in words; what there was none of is left out."""
    counts = ((record.wins, "won"), (record.draws, "drawn"), (record.losses, "lost"))
    return ", ".join(f"{n} {how}" for n, how in counts if n)


def _place(value: float, first: float, last: float) -> float:
    return round(_MARGIN + (100 - 2 * _MARGIN) * (value - first) / (last - first), 2)
