"""The paper's Table 4: four experiments, each of which starts from the policy that the one before ended with.

DIR/exp1 .. DIR/exp4 are the runs' folders, each as `policies.training.folder` says.
"""

from pathlib import Path

from arena.errors import InputError, UnknownNameError
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from policies.networks.checkpoint import Manifest, read_manifest
from policies.training.folder import LAST

CURRICULA = {"paper": ("exp1", "exp2", "exp3", "exp4")}
PROGRESS = "progress"
"""Under this name a checkpoint's manifest says how much of its run was done."""


def stages_of(curriculum: str, only: str = "") -> tuple[str, ...]:
    """Return the stages to train, in their order; only one if it is named.

    Raises
    ------
    UnknownNameError
        There is no such curriculum, or no such stage in it.
    """
    if curriculum not in CURRICULA:
        raise UnknownNameError("curriculum", curriculum, CURRICULA)
    stages = CURRICULA[curriculum]
    if only and only not in stages:
        raise UnknownNameError("stage", only, stages)
    return (only,) if only else stages


def start_of(curriculum: str, stage: str, folder: Path) -> str:
    """Return the checkpoint that a stage starts from; nothing for the first.

    Raises
    ------
    InputError
        The stage before has not ended, or has not begun.
    """
    before = _before(CURRICULA[curriculum], stage)
    if not before:
        return ""
    file = folder / before / LAST
    if not has_ended(folder / before):
        how = "has not ended" if file.exists() else "has not begun"
        raise InputError(f"stage {stage} starts from stage {before}, which {how} in {folder}; train that first")
    return str(file)


def has_ended(run: Path) -> bool:
    """Whether the run in a folder has used up its budget."""
    return (run / LAST).exists() and read_manifest(run / LAST).training.get(PROGRESS, 0.0) >= 1


def check_start(path: Path, manifest: Manifest, ruleset: Ruleset) -> None:
    """Let a run start from a checkpoint of its own ruleset, or of the stage before.

    Raises
    ------
    InputError
        It is of another.
    """
    for stages in CURRICULA.values():
        before = _before(stages, ruleset.name)
        if manifest.ruleset_hash == ruleset.hash or (before and manifest.ruleset_hash == load_rules(before).hash):
            return
        if ruleset.name in stages and manifest.ruleset in stages:
            wanted = f"one of {before}" if before else "nothing"
            raise InputError(f"stage {ruleset.name} starts from {wanted}; {path} is of stage {manifest.ruleset}")
    raise InputError(
        f"cannot start from {path}: it was trained on ruleset {manifest.ruleset}, not on {ruleset.name} as it is today"
    )


def _before(stages: tuple[str, ...], stage: str) -> str:
    return stages[stages.index(stage) - 1] if stage in stages[1:] else ""
