"""What is kept of gauntlets, and what tells a change from luck."""

import doctest
import json
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import tournaments.authoring.gauntlet_runs as module
from arena.errors import InputError
from tournaments.authoring.gauntlet_runs import MOST_RUNS, Runs, compare, sign_flip_p_value

WON, LOST = [2.0] * 10, [0.0] * 10


def runs(folder: Path, *setting: str) -> Runs:
    return Runs(folder, "my/bot", *setting)


def play(of: Runs, fingerprint: str = "one", **pairs: list[float]) -> Path:
    run = of.begin()
    of.keep(run, fingerprint, pairs)
    return run


def test_the_last_finished_run_is_found_again(tmp_path: Path) -> None:
    mine = runs(tmp_path, "path", "rules")
    assert mine.last() is None
    play(mine, rush=[1.0, 2.0])
    play(mine, rush=[1.5, 2.0])
    mine.begin()  # stopped before its end

    found = mine.last()
    assert found is not None
    assert (found[0], found[1]["pairs"]) == ("run-0002", {"rush": [1.5, 2.0]})
    assert runs(tmp_path, "path", "other rules").last() is None
    assert runs(tmp_path, "pathr", "ules").last() is None


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 2}', '{"format": 1, "pairs": {"rush": ["x"]}}', "\x00"])
def test_a_result_that_was_spoilt_is_passed_over(tmp_path: Path, text: str) -> None:
    mine = runs(tmp_path)
    play(mine, rush=[1.0])
    (play(mine, rush=[2.0]) / "result.json").write_text(text)

    found = mine.last()
    assert found is not None
    assert found[0] == "run-0001"


def test_only_the_last_runs_are_kept_and_no_number_comes_twice(tmp_path: Path) -> None:
    mine = runs(tmp_path)
    made = [play(mine, rush=[1.0]) for _ in range(MOST_RUNS + 3)]

    assert sorted(mine.folder.iterdir()) == made[3:]
    assert made[-1].name == f"run-{MOST_RUNS + 3:04}"


def test_what_is_not_a_run_is_left_alone(tmp_path: Path) -> None:
    mine = runs(tmp_path)
    play(mine, rush=[1.0])
    (mine.folder / "run-notes").mkdir()
    for _ in range(MOST_RUNS + 1):
        mine.begin()

    assert (mine.folder / "run-notes").is_dir()


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "gauntlets").write_text("")
    with pytest.raises(InputError, match="cannot keep gauntlets in "):
        runs(tmp_path).begin()


def test_what_is_better_worse_and_noise_is_told_apart() -> None:
    noisy = [1.0, 2.0, 0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 1.0, 2.0]
    then = {"fingerprint": "one", "pairs": {"rush": LOST, "squad": WON, "patrol": noisy, "gone": WON}}
    found = compare("run-0001", then, "two", {"rush": WON, "squad": LOST, "patrol": [*noisy[1:], 0.0], "new": WON})

    assert found is not None
    assert {name: change.verdict for name, change in found.opponents.items()} == {
        "rush": "better", "squad": "worse", "patrol": "same"
    }  # fmt: skip
    assert (found.opponents["rush"].score_before, found.opponents["rush"].score) == (0, 1)
    assert (found.overall.verdict, found.overall.n_pairs, found.is_same_file) == ("same", 30, False)


def test_the_pairs_that_both_runs_have_are_compared() -> None:
    found = compare("run-0001", {"fingerprint": "one", "pairs": {"rush": [0.0, 1.0]}}, "one", {"rush": [0.0, 1.0, 2.0, 2.0]})

    assert found is not None
    assert (found.opponents["rush"].n_pairs, found.opponents["rush"].score, found.is_same_file) == (2, 0.25, True)
    assert compare("run-0001", {"pairs": {"rush": WON}}, "one", {"patrol": WON}) is None


def test_of_many_opponents_each_is_held_to_a_higher_standard() -> None:
    """Six wins more of six are a chance of 1 in 32: enough against one opponent, not against one of ten."""
    then, now = [0.0] * 6, [1.0] * 6
    alone = compare("r", {"pairs": {"a": then}}, "f", {"a": now})
    among = compare("r", {"pairs": dict.fromkeys("abcdefghij", then)}, "f", dict.fromkeys("bcdefghij", then) | {"a": now})

    assert alone is not None
    assert among is not None
    assert alone.opponents["a"].p_value == among.opponents["a"].p_value == 0.03125
    assert (alone.opponents["a"].verdict, among.opponents["a"].verdict) == ("better", "same")


@given(st.lists(st.sampled_from([-2, -1.5, -1, -0.5, 0, 0.5, 1, 1.5, 2]), max_size=8))
def test_the_sign_flip_p_value_is_that_of_all_signs(differences: list[float]) -> None:
    all_signs = product((-1, 1), repeat=len(differences))
    sums = [abs(sum(sign * one for sign, one in zip(signs, differences, strict=True))) for signs in all_signs]

    assert sign_flip_p_value(differences) == pytest.approx(sum(one >= abs(sum(differences)) for one in sums) / len(sums))


def test_a_kept_result_is_json_that_a_person_can_read(tmp_path: Path) -> None:
    kept = json.loads((play(runs(tmp_path), "mybot.py 1a2b", rush=[1.0, 0.5]) / "result.json").read_text())

    assert kept == {"format": 1, "fingerprint": "mybot.py 1a2b", "pairs": {"rush": [1.0, 0.5]}}


def test_the_examples_in_the_docstrings_hold() -> None:
    done = doctest.testmod(module)

    assert (done.failed, done.attempted > 0) == (0, True)
