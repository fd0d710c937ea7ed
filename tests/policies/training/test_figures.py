"""Figures from metrics: means over seeds and their spread, and charts that are well-formed."""

import csv
import json
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from arena.errors import InputError
from policies.training.budget import Budget
from policies.training.figures import Trace, curve, group, read_traces, summarise, write_figures
from policies.training.folder import METRICS, RunFolder
from policies.training.reinforce_settings import ReinforceSettings

SVG = "{http://www.w3.org/2000/svg}"


def leave_run(path: Path, rules: str, seed: int, score: list[float], **changes: object) -> Path:
    """Leave the folder of a run of 10 episodes a round."""
    folder = RunFolder(path)
    settings = replace(ReinforceSettings(rules=rules, seed=seed), **changes)
    folder.create({"method": "reinforce", "start": "", "budget": asdict(Budget()), "settings": asdict(settings)})
    with (path / METRICS).open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["step", "episodes", "score", "captures"])
        writer.writerows([number + 1, 10 * (number + 1), value, 0.5] for number, value in enumerate(score))
    return path


def trace(score: list[float], seed: int = 1) -> Trace:
    values = np.array(score)
    episodes = 10.0 * np.arange(1, len(score) + 1)
    return Trace(rules="exp1", seed=seed, reading="as in the paper", episodes=episodes, score=values, captures=values / 100)


def test_a_curve_is_the_mean_of_the_seeds_in_the_band_of_the_least_and_the_most() -> None:
    line = curve("", [trace([0.0] * 600), trace([30.0] * 600, 2), trace([60.0] * 500, 3)])

    assert line.x[-1] == 5_000  # as far as the shortest goes
    np.testing.assert_allclose(line.low, 0)
    np.testing.assert_allclose(line.middle, 30)
    np.testing.assert_allclose(line.high, 60)


def test_a_point_of_a_curve_is_the_mean_of_the_episodes_before_it() -> None:
    line = curve("", [trace([float(number >= 100) for number in range(200)])])

    at = dict(zip(line.x.tolist(), line.middle.tolist(), strict=True))
    assert at[1_000] == 0
    assert at[1_200] == pytest.approx(0.4)  # 200 of the newest 500 episodes
    assert at[2_000] == 1


def test_a_summary_tells_begin_best_and_end(tmp_path: Path) -> None:
    found = summarise([trace([0.0] * 50 + [80.0] * 100 + [40.0] * 400), trace([0.0] * 50 + [80.0] * 100 + [44.0] * 400, 2)])

    assert (found.seeds, found.episodes, found.converged) == (2, 5_500, 2)
    assert (found.first_score, found.best_score, found.last_score) == (0, 80, 42)
    assert (found.last_low, found.last_high) == (40, 44)
    assert (found.slope, found.slope_low, found.slope_high, found.verdict) == (0, 0, 0, "converged")


def test_a_summary_tells_seeds_that_converge_from_those_that_do_not() -> None:
    found = summarise([trace([20.0] * 500), trace([0.1 * number for number in range(500)], 2)])

    assert (found.verdict, found.converged) == ("rises", 1)
    assert found.slope == pytest.approx(50)  # the mean of 0 and 0.1 a round of 10


def test_every_figure_is_drawn_from_the_runs_of_its_stages(tmp_path: Path) -> None:
    for rules in ("exp1", "exp3", "exp4"):
        for seed in (1, 2, 3):
            leave_run(tmp_path / "runs" / f"{rules}-{seed}", rules, seed, [seed * 10.0] * 100)
    leave_run(tmp_path / "runs" / "stream", "exp1", 1, [70.0] * 100, reward="stream")

    summaries = write_figures(read_traces([tmp_path / "runs"]), tmp_path / "out")

    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["figure4.svg", "figure6.svg", "figures.json"]
    tree = ElementTree.parse(tmp_path / "out" / "figure4.svg")
    texts = [one.text for one in tree.iter(f"{SVG}text")]
    assert "exp1, as in the paper, 3 seeds" in texts
    assert "exp1, reward=stream, 1 seed" in texts
    assert "exp3, as in the paper, 3 seeds" not in texts
    summary = json.loads((tmp_path / "out" / "figures.json").read_text())
    assert {(one["slope"], one["slope_low"], one["slope_high"], one["verdict"]) for one in summary} == {(0, 0, 0, "converged")}
    assert [(one["rules"], one["last_low"], one["last_high"]) for one in summary if one["seeds"] == 3] == [
        (rules, 10.0, 30.0) for rules in ("exp1", "exp3", "exp4")
    ]
    assert len(summaries) == 4


def test_a_reading_with_many_switches_leaves_the_chart_its_room(tmp_path: Path) -> None:
    switches = {"batch": 20000, "warmup": 20, "reward": "differences", "stall": -30.0, "discount_steps": False, "window": 21}
    leave_run(tmp_path / "long", "exp1", 1, [0.0] * 200, **switches, standardise="trajectory", codes="signed", edge="obstacle")
    leave_run(tmp_path / "short", "exp1", 1, [0.0] * 200)
    write_figures(read_traces([tmp_path]), tmp_path / "out")
    drawn = ElementTree.parse(tmp_path / "out" / "figure4.svg")
    axes = drawn.find(f".//{SVG}g[@id='patch_2']/{SVG}path")
    assert axes is not None
    across = [float(point.split()[0]) for point in axes.get("d", "").removeprefix("M").rstrip("z ").split("L")]

    assert max(across) - min(across) > 0.7 * float(drawn.getroot().get("viewBox", "").split()[2])


def test_higher_scores_stand_higher(tmp_path: Path) -> None:
    leave_run(tmp_path / "run", "exp1", 1, [-100.0] * 100 + [100.0] * 200)
    write_figures(read_traces([tmp_path]), tmp_path / "out")
    drawn = ElementTree.parse(tmp_path / "out" / "figure4.svg").find(f".//{SVG}g[@id='curve0']/{SVG}path")
    assert drawn is not None
    points = [tuple(map(float, point.split())) for point in drawn.get("d", "").removeprefix("M").split("L")]

    assert points[0][0] < points[-1][0]
    assert points[0][1] > points[-1][1]


def test_what_is_no_run_and_a_seed_that_comes_twice_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no run"):
        read_traces([tmp_path])
    with pytest.raises(InputError, match="seed 1"):
        group([trace([1.0]), trace([2.0])])
    leave_run(tmp_path / "run", "exp1", 1, [1.0])
    (tmp_path / "run" / METRICS).write_text("step,episodes\n1,10\n")
    with pytest.raises(InputError, match="cannot read"):
        read_traces([tmp_path])


def test_metrics_that_are_no_text_are_refused_in_a_sentence(tmp_path: Path) -> None:
    leave_run(tmp_path / "run", "exp1", 1, [1.0])
    (tmp_path / "run" / METRICS).write_bytes(b"step,episodes,score,captures\n1,10,\xff,0\n")

    with pytest.raises(InputError, match=r"^cannot read .*metrics\.csv: "):
        read_traces([tmp_path])


def test_without_matplotlib_the_command_is_named(tmp_path: Path) -> None:
    leave_run(tmp_path / "run", "exp1", 1, [0.0] * 100)
    command = ["arena", "train", "figures", str(tmp_path / "run"), "--out", str(tmp_path / "out")]
    code = f"import sys; sys.modules['matplotlib'] = None; from tournaments.cli import main; sys.argv = {command!r}; main()"

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.endswith("needs matplotlib, which is not installed here: pip install 'arena-pit[train]'\n")
