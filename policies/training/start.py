"""The team network that training begins from, or plays: read from a checkpoint, if it fits."""

from pathlib import Path

from arena.errors import InputError
from arena.game.ruleset import Ruleset
from policies.networks.checkpoint import Checkpoint, load_checkpoint
from policies.networks.models import TeamNetwork


def read_team_network(path: Path, purpose: str) -> TeamNetwork:
    """Return the network of a checkpoint, ready to play; `InputError` if it is none of a team."""
    return _network_of(load_checkpoint(path), path, purpose)


def read_start(path: Path, ruleset: Ruleset, fresh: TeamNetwork) -> TeamNetwork:
    """Return the network of a checkpoint, ready to learn.

    Raises
    ------
    InputError
        It is none of a team, of another shape than a fresh one, or was trained on another ruleset.
    """
    checkpoint = load_checkpoint(path)
    network = _network_of(checkpoint, path, "start from")
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
    return network.train().requires_grad_(True)


def _network_of(checkpoint: Checkpoint, path: Path, purpose: str) -> TeamNetwork:
    kind, network = checkpoint.manifest.network, checkpoint.network
    if not isinstance(network, TeamNetwork):
        raise InputError(f"cannot {purpose} {path}: it holds a {kind} network, and a team network is wanted")
    return network
