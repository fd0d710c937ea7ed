"""The network that training begins from, or plays: read from a checkpoint, if it fits."""

from pathlib import Path
from typing import TypeVar

from arena.errors import InputError
from arena.game.ruleset import Ruleset
from policies.networks.appraiser import Appraiser
from policies.networks.checkpoint import Checkpoint, load_checkpoint, shape_of
from policies.networks.models import TeamNetwork
from policies.registry import CHECKPOINT, shipped

Seated = TypeVar("Seated", bound=TeamNetwork | Appraiser)


def read_student(name: str, fresh: Seated) -> Seated:
    """Return the network of a checkpoint's file, or of a shipped fighter, that plays and goes on learning.

    Parameters
    ----------
    fresh
        One of the kind that is wanted.

    Raises
    ------
    InputError
        It is neither, or of another kind.
    """
    if not name.endswith(CHECKPOINT) and name not in shipped():
        raise InputError(f"the student is {name!r}; it must be a checkpoint's file, or one of {', '.join(shipped())}")
    path = shipped().get(name, Path(name))
    return _network_of(load_checkpoint(path), path, "learn by playing", fresh)


def read_start(path: Path, ruleset: Ruleset, fresh: Seated) -> Seated:
    """Return the network of a checkpoint, ready to learn.

    Raises
    ------
    InputError
        It is of another kind than a fresh one, or of another shape, or was trained on another ruleset.
    """
    checkpoint = load_checkpoint(path)
    network = _network_of(checkpoint, path, "start from", fresh)
    shape = network.shape
    if shape != fresh.shape:
        way_out = f"try --set channels={shape.channels} --set blocks={shape.blocks}"
        if (shape.channels, shape.blocks) == (fresh.shape.channels, fresh.shape.blocks):
            way_out = "no setting changes the rest; begin with another"
        raise InputError(f"cannot start from {path}: its network is of {shape}; the settings ask for {fresh.shape} ({way_out})")
    if checkpoint.manifest.ruleset_hash != ruleset.hash:
        raise InputError(
            f"cannot start from {path}: it was trained on ruleset {checkpoint.manifest.ruleset}, not on {ruleset.name} of today"
        )
    network.train().requires_grad_(True)
    return network


def _network_of(checkpoint: Checkpoint, path: Path, purpose: str, fresh: Seated) -> Seated:
    network = checkpoint.network
    if not isinstance(network, type(fresh)):
        found, wanted = checkpoint.manifest.network, shape_of(fresh)[0]
        raise InputError(f"cannot {purpose} {path}: its network is of the kind {found}, and one of the kind {wanted} is wanted")
    return network
