import json
from pathlib import Path

import pytest

from arena.errors import InputError
from benchmarks.measuring.strength import Strength, draw, read_strength


def _write(file: Path, **scores: tuple[float, float]) -> Path:
    rows = {name: {"score": mean, "score_low": mean - half, "score_high": mean + half} for name, (mean, half) in scores.items()}
    file.write_text(json.dumps({"fighter": "planner:40", "against": rows}))
    return file


def test_a_fighter_s_strength_is_the_mean_over_its_opponents_with_an_interval_that_narrows_with_them(tmp_path: Path) -> None:
    one = read_strength(_write(tmp_path / "one.json", rush=(0.8, 0.06)))
    both = read_strength(_write(tmp_path / "both.json", rush=(0.8, 0.06), patrol=(0.6, 0.08)))

    assert one == pytest.approx(("planner:40", 0.8, 0.74, 0.86))
    assert both == pytest.approx(("planner:40", 0.7, 0.65, 0.75))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"fighter": "rush", "against": {}}'])
def test_what_is_no_result_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "result.json").write_text(text)

    with pytest.raises(InputError, match=r"result\.json is not what `arena evaluate --json` prints"):
        read_strength(tmp_path / "result.json")


def test_the_same_strengths_give_the_same_figure() -> None:
    points = [(20.0, Strength("planner", 0.8, 0.7, 0.9)), (5.0, Strength("planner-fast", 0.75, 0.7, 0.8))]

    assert draw(points) == draw(list(reversed(points)))
    assert b"planner-fast" in draw(points)
