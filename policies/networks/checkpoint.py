"""A trained network in one file: weights as safetensors, and in the file's own metadata a manifest that says what they are.

Loading a stranger's file runs no code. A file that does not fit is refused with a sentence that says why.
"""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn

from arena.errors import ArenaError, InputError, PolicyError
from arena.files import check_file
from arena.game.ruleset import Ruleset
from arena.game.types import Code
from policies.networks.appraiser import Appraiser, AppraiserShape
from policies.networks.features import FEATURES_VERSION
from policies.networks.first_person import WINDOW
from policies.networks.models import SIGNED_PLANES, PaperTeam, TeamNetwork, TeamShape
from policies.networks.play_settings import PlaySettings

FORMAT = 1
"""Rises whenever a file of the old kind can no longer be read."""
MOST_BYTES = 12_000_000
"""Of a checkpoint, or of each policy in one that has a policy for each unit, with the window that the paper has; one with
a larger window may take more."""
MOST_AGENTS = 16
MOST_WINDOW = 64
MOST_SIZE = 1024
"""Of a team's network: channels, blocks, and the rest."""
_TEAM, _APPRAISER, _PAPER = KINDS = ("team", "appraiser", "paper")
_OF_TEAMS = {_TEAM: (TeamShape, TeamNetwork), _APPRAISER: (AppraiserShape, Appraiser)}
"""Networks that see `features`, and their sizes."""
_KEY = "arena"
_MANIFEST_BYTES = 65_536
"""Room for all that stands before the tensors."""
_TYPES = {
    "network": str, "shape": dict, "features": int, "ruleset": str, "ruleset_hash": str, "training": dict, "evaluation": dict
}  # fmt: skip
_KINDS_OF_NUMBERS = (torch.float16, torch.bfloat16, torch.float32, torch.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What a checkpoint is."""

    network: str
    """One of `KINDS`."""
    shape: dict[str, int]
    """Sizes of the network: those of `TeamShape` or `AppraiserShape`, or the arguments of `PaperTeam`."""
    features: int
    """`features.FEATURES_VERSION` of the planes that it was trained on."""
    ruleset: str
    ruleset_hash: str
    play: PlaySettings = field(default_factory=PlaySettings)
    """How it is to be played. Checkpoints that do not say so are of a time when all were played as it is by default."""
    training: dict[str, Any] = field(default_factory=dict)
    """How it came about: method, start, settings, samples, seed."""
    evaluation: dict[str, Any] = field(default_factory=dict)
    """What `arena evaluate` measured, where somebody kept it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """A network and what it is."""

    manifest: Manifest
    network: nn.Module


def build_network(kind: str, shape: Mapping[str, int]) -> nn.Module:
    """Return a fresh network of a kind.

    Raises
    ------
    ValueError
        There is no such kind, or its sizes are others.
    """
    sizes = {"edge": Code.HIDDEN, **shape} if kind == _PAPER else dict(shape)  # checkpoints did not always say the edge
    if kind in _OF_TEAMS:
        make_shape, make = _OF_TEAMS[kind]
        with suppress(TypeError):  # a size that there is not, or one that is missing
            team = make_shape(**sizes)
            if all(_is_size(size) for size in asdict(team).values()) and team.patch % 2:
                return make(team)
    elif kind == _PAPER and set(sizes) == {"window", "agents", "planes", "edge"}:
        is_known = all(_is_whole(size) for size in sizes.values())
        is_known = is_known and sizes["planes"] in (1, len(SIGNED_PLANES), len(Code))
        is_known = is_known and sizes["edge"] in (Code.HIDDEN, Code.OBSTACLE)
        is_known = is_known and _is_size(sizes["window"], MOST_WINDOW) and _is_size(sizes["agents"], MOST_AGENTS)
        if is_known and sizes["window"] >= 7:
            return PaperTeam(**sizes)
    if kind in KINDS:
        raise ValueError(f"no network of the kind {kind} has the sizes {sizes!s:.200}")
    raise ValueError(f"its network is {kind!r:.40}; known: {', '.join(KINDS)}")


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_size(value: object, most: int = MOST_SIZE) -> bool:
    return type(value) is int and 1 <= value <= most


def shape_of(network: nn.Module) -> tuple[str, dict[str, int]]:
    """Return the kind and the sizes of a network."""
    if isinstance(network, TeamNetwork):
        return _TEAM, asdict(network.shape)
    if isinstance(network, Appraiser):
        return _APPRAISER, asdict(network.shape)
    if isinstance(network, PaperTeam):
        return _PAPER, {"window": network.window, "agents": network.agents, "planes": network.planes, "edge": network.edge}
    raise ValueError(f"{type(network).__name__} is no network that a checkpoint can hold")


def describe(network: nn.Module, ruleset: Ruleset, training: Mapping[str, Any]) -> Manifest:
    """Return the manifest of a network that was trained on a ruleset, with the features of today."""
    kind, shape = shape_of(network)
    return Manifest(
        network=kind, shape=shape, features=FEATURES_VERSION, ruleset=ruleset.name, ruleset_hash=ruleset.hash,
        training=dict(training),
    )  # fmt: skip


def check_size(shape: TeamShape) -> None:
    """Refuse a team's network that no checkpoint can hold, before anything is made of it.

    Raises
    ------
    InputError
        A size is out of bounds, or a checkpoint would be larger than one may be.
    """
    asked = f"a network of channels={shape.channels} and blocks={shape.blocks}"
    kind = next(kind for kind, (make_shape, _) in _OF_TEAMS.items() if type(shape) is make_shape)
    try:
        with torch.device("meta"):  # takes no memory
            weights = build_network(kind, asdict(shape)).state_dict()
    except ValueError as error:
        raise InputError(f"{asked} cannot be kept in a checkpoint; no size may be above {MOST_SIZE:,}") from error
    n_bytes = _MANIFEST_BYTES + torch.float32.itemsize * sum(tensor.numel() for tensor in weights.values())
    if n_bytes > MOST_BYTES:
        raise InputError(
            f"{asked} would take {n_bytes:,} bytes as a checkpoint; {MOST_BYTES:,} is the most, so choose fewer of them"
        )


def save_checkpoint(path: Path, weights: Mapping[str, Tensor], manifest: Manifest) -> None:
    """Write a checkpoint, all of it or nothing: what was there before stays until the new file is whole.

    Raises
    ------
    ArenaError
        It cannot be written, or is larger than a checkpoint may be.
    """
    tensors = {name: tensor.detach().to("cpu", torch.float32).contiguous() for name, tensor in weights.items()}
    data = save(tensors, {_KEY: json.dumps({"format": FORMAT, **asdict(manifest)}, sort_keys=True)})
    most = _most_bytes(manifest)
    if len(data) > most:
        raise ArenaError(f"the checkpoint {path} would take {len(data):,} bytes; {most:,} is the most")
    write_whole(path, data)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that nobody ever finds a part of it."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with beside.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise ArenaError(f"cannot write {path}: {error.strerror}; what was there before is kept") from error


def read_manifest(path: Path) -> Manifest:
    """Return the manifest of a checkpoint.

    Raises
    ------
    PolicyError
        The file is not there, is no checkpoint, or is one of another version.
    """
    try:
        size = check_file(path, MOST_BYTES * MOST_AGENTS)
        with safe_open(path, "pt") as file:  # reads no more than what stands before the tensors
            text = (file.metadata() or {}).get(_KEY)
    except OSError as error:
        raise PolicyError(f"cannot read the checkpoint {path}: {error.strerror or error}") from error
    except SafetensorError as error:
        raise PolicyError(f"{path} is no safetensors file, or is cut short: {error}") from error
    if text is None:
        raise PolicyError(f"{path} holds tensors, but no manifest of ours; `arena train` writes one")
    try:
        values = json.loads(text)
        version = values.pop("format")
        if version == FORMAT:
            manifest = Manifest(**{**values, "play": PlaySettings(**values.get("play", {}))})
            if any(type(getattr(manifest, name)) is not kind for name, kind in _TYPES.items()):
                raise TypeError("a fact of it is of another type")
    except PolicyError as error:
        raise PolicyError(f"the checkpoint {path} cannot be played: {error}") from error
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise PolicyError(f"the manifest of the checkpoint {path} cannot be read") from error
    if version != FORMAT:
        raise PolicyError(f"the checkpoint {path} is of format {version!s:.40}; this arena reads format {FORMAT}")
    if size > _most_bytes(manifest):
        raise PolicyError(f"the checkpoint {path} has {size:,} bytes; {_most_bytes(manifest):,} is the most")
    return manifest


def _most_bytes(manifest: Manifest) -> int:
    agents, window = (manifest.shape.get(name) for name in ("agents", "window")) if manifest.network == _PAPER else (1, WINDOW)
    n_policies = agents if isinstance(agents, int) and 1 <= agents <= MOST_AGENTS else 1
    side = window if isinstance(window, int) and WINDOW <= window <= MOST_WINDOW else WINDOW
    dense = ((side - 6) / (WINDOW - 6)) ** 2
    return min(int(MOST_BYTES * n_policies * dense), MOST_BYTES * MOST_AGENTS)


def load_checkpoint(path: Path) -> Checkpoint:
    """Return the network of a file, ready to play.

    Raises
    ------
    PolicyError
        The file does not fit; the sentence says why.
    """
    manifest = read_manifest(path)
    if manifest.network in _OF_TEAMS and manifest.features != FEATURES_VERSION:
        raise PolicyError(
            f"the checkpoint {path} was trained on features of version {manifest.features}; this arena has version "
            f"{FEATURES_VERSION}"
        )
    try:
        with torch.device("meta"):  # takes no memory: a file decides how much it is only once it has shown as much
            wanted = build_network(manifest.network, manifest.shape).state_dict()
    except ValueError as error:
        raise PolicyError(f"the checkpoint {path} cannot be built: {error}") from error
    with safe_open(path, "pt") as file:
        weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no mapping
    for name in sorted(wanted.keys() | weights.keys()):
        if name not in weights or name not in wanted:
            raise PolicyError(f"the checkpoint {path} {'lacks the' if name in wanted else 'has an unknown'} tensor {name!r:.80}")
        if weights[name].shape != wanted[name].shape:
            found, needed = list(weights[name].shape), list(wanted[name].shape)
            raise PolicyError(f"in the checkpoint {path}, {name} has shape {found}; its network wants {needed}")
        if weights[name].dtype not in _KINDS_OF_NUMBERS:
            raise PolicyError(
                f"in the checkpoint {path}, {name} is of {weights[name].dtype}; a network has floating-point numbers"
            )
        if not torch.isfinite(weights[name]).all():
            raise PolicyError(f"in the checkpoint {path}, {name} holds numbers that are not finite")
    network = build_network(manifest.network, manifest.shape)
    network.load_state_dict(weights)
    return Checkpoint(manifest=manifest, network=network.eval().requires_grad_(False))
