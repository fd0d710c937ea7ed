"""The paper's four stages: each starts from the one before, and from no other."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from arena.errors import InputError, UnknownNameError
from arena.game.ruleset import load as load_rules
from policies.networks.checkpoint import Manifest, load_checkpoint, save_checkpoint
from policies.networks.features import FEATURES_VERSION
from policies.networks.models import PaperTeam
from policies.training.curriculum import PROGRESS, check_start, has_ended, stages_of, start_of
from policies.training.folder import LAST, SETTINGS, STATE, RunFolder

Run = Callable[..., subprocess.CompletedProcess[str]]
Train = Callable[..., None]
QUICK = ("--set", "window=7", "--set", "batch=20", "--set", "update_every=2", "--set", "opponent=random")


def leave(run: Path, rules: str, progress: float) -> Path:
    """Leave what a run leaves behind."""
    ruleset = load_rules(rules)
    run.mkdir(parents=True)
    manifest = Manifest(
        network="paper", shape={"window": 7, "agents": 1, "planes": 1}, features=FEATURES_VERSION, ruleset=rules,
        ruleset_hash=ruleset.hash,
        training={PROGRESS: progress},
    )  # fmt: skip
    save_checkpoint(run / LAST, PaperTeam(7).state_dict(), manifest)
    return run / LAST


def test_a_stage_starts_from_the_one_before_once_that_has_ended(tmp_path: Path) -> None:
    assert start_of("paper", "exp1", tmp_path) == ""
    with pytest.raises(InputError, match="exp2 starts from stage exp1, which has not begun"):
        start_of("paper", "exp2", tmp_path)

    file = leave(tmp_path / "exp1", "exp1", 0.9)
    with pytest.raises(InputError, match="has not ended"):
        start_of("paper", "exp2", tmp_path)

    file.unlink()
    file.parent.rmdir()
    file = leave(tmp_path / "exp1", "exp1", 1.0)
    assert has_ended(tmp_path / "exp1")
    assert start_of("paper", "exp2", tmp_path) == str(file)


@pytest.mark.parametrize(("rules", "start", "is_right"), [
    ("exp2", "exp1", True), ("exp2", "exp2", True), ("exp4", "exp3", True), ("exp1", "exp2", False), ("exp3", "exp1", False),
    ("exp4", "gym-cap", False), ("paper", "paper", True), ("gym-cap", "exp1", False),
])  # fmt: skip
def test_a_checkpoint_of_a_stage_out_of_order_is_refused(tmp_path: Path, rules: str, start: str, is_right: bool) -> None:
    file = leave(tmp_path / "run", start, 1.0)
    manifest = load_checkpoint(file).manifest
    if is_right:
        check_start(file, manifest, load_rules(rules))
        return
    with pytest.raises(InputError, match=start) as refusal:
        check_start(file, manifest, load_rules(rules))
    assert "\n" not in str(refusal.value)


def test_stages_and_curricula_that_are_not_there_are_named() -> None:
    assert stages_of("paper") == ("exp1", "exp2", "exp3", "exp4")
    assert stages_of("paper", "exp3") == ("exp3",)
    with pytest.raises(UnknownNameError, match="exp3"):
        stages_of("paper", "exp33")
    with pytest.raises(UnknownNameError, match="paper"):
        stages_of("papers")


def test_the_command_trains_all_four_stages_and_goes_on(train: Train, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "runs"
    train("--method", "reinforce", "--curriculum", "paper", "--episodes", 2, "--out", out, *QUICK)
    assert capsys.readouterr().out.count("trained:") == 4
    for before, rules in (("", "exp1"), ("exp1", "exp2"), ("exp2", "exp3"), ("exp3", "exp4")):
        manifest = load_checkpoint(out / rules / LAST).manifest
        assert manifest.ruleset == rules
        assert manifest.training["start"] == (str(out / before / LAST) if before else "")

    again = ("--method", "reinforce", "--curriculum", "paper", "--resume", "--out", out)
    for name in (STATE, LAST):
        (out / "exp4" / name).unlink()
    with RunFolder(out / "exp4").hold(), pytest.raises(SystemExit):
        train(*again)
    assert capsys.readouterr().err.startswith("arena: another process is training in ")
    (out / "exp4" / SETTINGS).unlink()
    train(*again)
    assert capsys.readouterr().out.count("trained:") == 1
    assert load_checkpoint(out / "exp4" / LAST).manifest.training["settings"]["batch"] == 20


REFUSED = [
    (("--method", "reinforce", "--curriculum", "paper", "--stage", "exp3"), "exp3 starts from stage exp2"),
    (("--curriculum", "paper"), "--curriculum is for the method reinforce"),
    (("--method", "reinforce", "--stage", "exp1"), "--stage"),
    (("--method", "reinforce", "--device", "cuda"), "no GPU"),
    (("--method", "reinforce", "--start", "clone:rush"), "clone"),
    (("--device", "cuda:7"), "must be cpu or cuda"),
    (("--episodes", "5"), "--episodes is for the method reinforce"),
]


@pytest.mark.parametrize(("arguments", "reason"), REFUSED)
def test_what_cannot_be_is_refused_with_one_sentence(
    train: Train, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], reason: str
) -> None:
    if "no GPU" in reason and torch.cuda.is_available():
        pytest.skip("there is a GPU here")
    with pytest.raises(SystemExit) as ended:
        train(*arguments, "--out", tmp_path / "run")
    said = capsys.readouterr().err

    assert ended.value.code == 2
    assert reason in said
    assert said.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_a_process_that_refuses_says_nothing_but_that_sentence(arena: Run, tmp_path: Path) -> None:
    arguments, reason = REFUSED[0]
    done = arena("train", *arguments, "--out", tmp_path / "run")

    assert done.returncode == 2
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()
