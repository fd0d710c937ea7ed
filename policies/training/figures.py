"""The paper's Figures 4 to 6 from the metrics of runs: score over episodes, the mean of the seeds and the band they lie in."""

import io
import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from arena.errors import InputError
from arena.extras import needs
from policies.networks.checkpoint import write_whole
from policies.training.convergence import Verdict, judge
from policies.training.folder import METRICS, SETTINGS, RunFolder, read_metrics
from policies.training.methods import read_config
from policies.training.reinforce_settings import ReinforceSettings

FIGURES = {
    "figure4": ("Figure 4: full sight, no enemies", ("exp1",)),
    "figure5": ("Figure 5: full sight, enemies", ("exp2",)),
    "figure6": ("Figure 6: enemies in fog, without and with UAVs", ("exp3", "exp4")),
}
"""File, title and rulesets of each figure. The paper's Table 4 has lost its cells, and its Figure 6 does not say whether UAVs are
in it, so both are shown."""
_NEWEST = 2_000
"""Episodes at the end of a run over which its last score is the mean."""
_SMOOTH = 500
"""Episodes of the running mean that a curve shows."""
_N_POINTS = 150
_LABEL_LETTERS, _LINE_INCHES = 90, 0.2
"""Of a line below a chart, the most letters, and its height."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """The metrics of one run."""

    rules: str
    seed: int
    reading: str
    """Settings that are not the paper's."""
    episodes: NDArray[np.float64]
    """Shape (rounds,): matches played up to each."""
    score: NDArray[np.float64]
    """Shape (rounds,): mean final score of blue in each."""
    captures: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """A line with the band that its runs lie in; all arrays are of one length."""

    label: str
    x: NDArray[np.float64]
    low: NDArray[np.float64]
    middle: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """How the seeds of one stage and one reading ended."""

    rules: str
    reading: str
    seeds: int
    episodes: int
    """Of the shortest run."""
    first_score: float
    """Over the first `_SMOOTH` episodes."""
    best_score: float
    """The most that the mean curve reaches."""
    last_score: float
    """Over the newest `_NEWEST`."""
    last_low: float
    """The lowest of the seeds."""
    last_high: float
    captures: float
    """Over the newest `_NEWEST`."""
    slope: float | None
    """Of the mean of the seeds over its newest half, in points per 10,000 episodes; see `policies.training.convergence`."""
    slope_low: float | None
    """Lower end of its 95% interval."""
    slope_high: float | None
    verdict: str
    """What the slope says: converged, rises, falls or cannot be told."""
    converged: int
    """Seeds that have converged, each by itself."""


def read_traces(folders: Sequence[Path]) -> list[Trace]:
    """Return the metrics of runs of the paper's method; a folder is a run's, or holds runs.

    Raises
    ------
    InputError
        A folder holds none, or a run's metrics cannot be read.
    """
    traces = []
    for folder in folders:
        found = sorted(file.parent for file in folder.glob(f"**/{SETTINGS}"))
        mine = [trace for run in found for trace in _read_run(run)]
        if not mine:
            raise InputError(f"{folder} holds no run of the method reinforce that has metrics")
        traces += mine
    return traces


def _read_run(path: Path) -> Iterator[Trace]:
    settings = read_config(RunFolder(path).read_settings()).settings
    if not isinstance(settings, ReinforceSettings) or not (path / METRICS).exists():
        return
    _, rows = read_metrics(path / METRICS)
    try:
        columns = {name: np.array([float(row[name]) for row in rows]) for name in ("episodes", "score", "captures")}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"cannot read {path / METRICS}: a row lacks episodes, score or captures") from error
    if rows:
        yield Trace(rules=settings.rules, seed=settings.seed, reading=_reading(settings), **columns)


def _reading(settings: ReinforceSettings) -> str:
    """Return what departs from the paper, in words."""
    usual = ReinforceSettings()
    names = [field.name for field in fields(settings) if field.name not in ("seed", "rules")]
    changed = [f"{name}={getattr(settings, name)}" for name in names if getattr(settings, name) != getattr(usual, name)]
    return ", ".join(changed) or "as in the paper"


def group(traces: Sequence[Trace]) -> dict[tuple[str, str], list[Trace]]:
    """Return the runs of each stage and reading, seed by seed.

    Raises
    ------
    InputError
        Two runs of one stage, reading and seed: their spread would be no spread over seeds.
    """
    groups: dict[tuple[str, str], list[Trace]] = defaultdict(list)
    for trace in sorted(traces, key=lambda one: (one.rules, one.reading, one.seed)):
        mine = groups[trace.rules, trace.reading]
        if mine and mine[-1].seed == trace.seed:
            raise InputError(f"two runs of {trace.rules} ({trace.reading}) have seed {trace.seed}; show one of them")
        mine.append(trace)
    return groups


def curve(label: str, runs: Sequence[Trace]) -> Curve:
    """Return the mean of the seeds and the band that they lie in, as far as all of them go."""
    last = min(float(run.episodes[-1]) for run in runs)
    x = np.linspace(0, last, _N_POINTS + 1)[1:]
    lines = np.array([[_mean_until(run, run.score, at, _SMOOTH) for at in x] for run in runs])
    return Curve(label=label, x=x, low=lines.min(0), middle=lines.mean(0), high=lines.max(0))


def summarise(runs: Sequence[Trace]) -> Summary:
    """Return how the seeds of one stage and reading ended."""
    last = [_mean_until(run, run.score, run.episodes[-1], _NEWEST) for run in runs]
    line, trend = curve("", runs), judge([(run.episodes, run.score) for run in runs])
    return Summary(
        rules=runs[0].rules, reading=runs[0].reading, seeds=len(runs), episodes=int(min(run.episodes[-1] for run in runs)),
        first_score=_rounded([_mean_until(run, run.score, _SMOOTH, _SMOOTH) for run in runs]),
        best_score=round(float(line.middle.max()), 2), last_score=_rounded(last), last_low=round(min(last), 2),
        last_high=round(max(last), 2),
        captures=_rounded([_mean_until(run, run.captures, run.episodes[-1], _NEWEST) for run in runs]),
        slope=trend.slope, slope_low=trend.low, slope_high=trend.high, verdict=trend.verdict,
        converged=sum(judge([(run.episodes, run.score)]).verdict is Verdict.CONVERGED for run in runs),
    )  # fmt: skip


def write_figures(traces: Sequence[Trace], out: Path) -> list[Summary]:
    """Draw every figure that there are runs for, and write their summaries as figures.json; return these.

    Raises
    ------
    ArenaError
        A file cannot be written.
    """
    groups = group(traces)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {out}: {error.strerror}") from error
    for name, (title, rulesets) in FIGURES.items():
        curves = [
            curve(f"{rules}, {reading}, {len(runs)} {'seed' if len(runs) == 1 else 'seeds'}", runs)
            for (rules, reading), runs in groups.items()
            if rules in rulesets
        ]
        if curves:
            write_whole(out / f"{name}.svg", draw(title, curves))
    summaries = [summarise(runs) for runs in groups.values()]
    rows = [{field.name: getattr(one, field.name) for field in fields(one)} for one in summaries]
    write_whole(out / "figures.json", json.dumps(rows, indent=2).encode() + b"\n")
    return summaries


def draw(title: str, curves: Sequence[Curve]) -> bytes:
    """Return a chart of curves as SVG; the same curves give the same bytes."""
    with needs("train", "arena train figures"):
        from matplotlib import rc_context, style
        from matplotlib.figure import Figure

    chart = io.BytesIO()
    with style.context("tableau-colorblind10"), rc_context({"svg.fonttype": "none", "svg.hashsalt": title}):
        labels = ["\n".join(wrap(line.label, _LABEL_LETTERS)) for line in curves]
        n_lines = sum(1 + label.count("\n") for label in labels)
        figure = Figure(figsize=(7.2, 4 + _LINE_INCHES * n_lines), layout="constrained")
        axes = figure.add_subplot(title=title, xlabel="episodes", ylabel="score of the team that learns", ylim=(-100, 100))
        for number, (line, label) in enumerate(zip(curves, labels, strict=True)):
            axes.fill_between(line.x, line.low, line.high, alpha=0.2)
            axes.plot(line.x, line.middle, label=label, gid=f"curve{number}")
        figure.legend(loc="outside lower left")  # below the axes: a reading with many switches takes some lines
        figure.savefig(chart, format="svg", metadata={"Date": None})
    return chart.getvalue()


def _mean_until(run: Trace, values: NDArray[np.float64], end: float, window: int) -> float:
    """Return the mean over the `window` episodes that end with `end`; of the round nearest to it where there are none."""
    rows = (run.episodes <= end) & (run.episodes > end - window)
    return float(values[rows].mean() if rows.any() else values[np.abs(run.episodes - end).argmin()])


def _rounded(values: Sequence[float]) -> float:
    return round(float(np.mean(values)), 2)
