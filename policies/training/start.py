"""The team network that training begins from, or plays: read from a checkpoint, if it fits."""

from pathlib import Path

from arena.errors import InputError
from arena.game.ruleset import Ruleset
from policies.networks.checkpoint import load_checkpoint
from policies.networks.models import TeamNetwork


def read_team_network(path: Path, ruleset: Ruleset, purpose: str = "start from") -> TeamNetwork:
    """Return the network of a checkpoint, ready to play.

    Raises
    ------
    InputError
        It is none of a team, or was trained on another ruleset.
    """
    checkpoint = load_checkpoint(path)
    network, manifest = checkpoint.network, checkpoint.manifest
    if not isinstance(network, TeamNetwork):
        raise InputError(f"cannot {purpose} {path}: it holds a {manifest.network} network, and a team network is wanted")
    if manifest.ruleset_hash != ruleset.hash:
        raise InputError(f"cannot {purpose} {path}: it was trained on ruleset {manifest.ruleset}, not on {ruleset.name} of today")
    return network


def read_start(path: Path, ruleset: Ruleset, fresh: TeamNetwork) -> TeamNetwork:
    """Return the network of a checkpoint, ready to learn, if it is of the shape of a fresh one; else raise `InputError`."""
    network = read_team_network(path, ruleset)
    if network.shape != fresh.shape:
        raise InputError(f"cannot start from {path}: its network is of {network.shape}; the settings ask for {fresh.shape}")
    return network.train().requires_grad_(True)
