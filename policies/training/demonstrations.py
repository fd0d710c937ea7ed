"""Demonstrations: what seats saw, what a teacher would have ordered there, and how the match ended; in a folder of bounded files.

demonstrations.json           what they are of
0-00001-62-4099.npz           process, number, matches and samples; written whole, never changed
"""

import io
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.errors import ArenaError, InputError
from arena.folders import hold_folder, make_folder
from arena.game.ruleset import Ruleset, load
from policies.networks.checkpoint import write_whole
from policies.networks.features import FEATURES_VERSION, UPSIDE_DOWN
from policies.training.settings import read_kept

FORMAT = 2
"""Rises whenever a folder of the old kind can no longer be read."""
UNKNOWN = -1
"""The label of a unit that is not alive."""
CERTAIN = 255
"""Stands for a chance of 1."""
_MANIFEST = "demonstrations.json"
_FILE = re.compile(r"(\d+)-(\d{5,})-(\d+)-(\d+)\.npz")


class LostFolderError(InputError):
    """The folder of demonstrations is not there any more."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"the folder {path} was deleted; the same command begins anew")


class Demonstrations(NamedTuple):
    """Samples: ticks of one seat, in the frame of `features.Encoder`."""

    planes: NDArray[np.uint8]
    """Shape (n, side, side, N_PLANES)."""
    scalars: NDArray[np.float32]
    """Shape (n, N_SCALARS)."""
    cell: NDArray[np.int16]
    """Shape (n, units)."""
    legal: NDArray[np.uint8]
    """Shape (n, units, actions)."""
    labels: NDArray[np.int8]
    """Shape (n, units): what the teacher ordered, or `UNKNOWN`."""
    chances: NDArray[np.uint8]
    """Shape (n, units, actions): the chances that it gave each action, in parts of `CERTAIN`."""
    enemies: NDArray[np.uint8]
    """Shape (n, side, side, N_ENEMY_PLANES): how many of the enemy's units truly stood there, whether seen or not."""
    outcome: NDArray[np.float32]
    """Shape (n,): 1 where the seat's match was won, -1 where it was lost."""


def join(parts: Sequence[Demonstrations]) -> Demonstrations:
    """Return all samples of some demonstrations."""
    return Demonstrations(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def mirrored(samples: Demonstrations, which: NDArray[np.bool_]) -> Demonstrations:
    """Return a copy in which some samples are mirrored north to south, where everything is worth the same; shape (n,)."""
    side = samples.planes.shape[1]
    row, column = np.divmod(samples.cell, side)
    turned = samples._replace(
        planes=samples.planes[:, ::-1],
        cell=((side - 1 - row) * side + column).astype(np.int16),
        legal=samples.legal[..., UPSIDE_DOWN],
        labels=np.where(samples.labels == UNKNOWN, UNKNOWN, UPSIDE_DOWN[samples.labels]).astype(np.int8),
        chances=samples.chances[..., UPSIDE_DOWN],
        enemies=samples.enemies[:, ::-1],
    )
    both: list[tuple[NDArray[Any], NDArray[Any]]] = list(zip(samples, turned, strict=True))
    return Demonstrations(*(np.where(which.reshape(-1, *[1] * (one.ndim - 1)), other, one) for one, other in both))


class File(NamedTuple):
    """A file of demonstrations, by its name."""

    path: Path
    process: int
    number: int
    matches: int
    samples: int


class DemonstrationFolder:
    """The folder of demonstrations under one ruleset."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def hold(self) -> AbstractContextManager[None]:
        """Let no other process make demonstrations in the folder; `InputError` if one does."""
        return hold_folder(self.path, "making demonstrations")

    def open_for(self, settings: Mapping[str, Any], ruleset: Ruleset) -> None:
        """Make the folder for settings, or go on with one that was made for the same.

        Raises
        ------
        InputError
            It was made for others, or cannot be made.
        """
        manifest = {**_versions(ruleset), "settings": dict(settings)}
        if (self.path / _MANIFEST).exists():
            old = self.read_manifest()
            if old != manifest:
                changed = [name for name, value in settings.items() if old["settings"].get(name) != value]
                what = f"with another value of {', '.join(changed)}" if changed else "by another version, or other rules"
                raise InputError(f"the demonstrations in {self.path} were made {what}; choose another --out")
            return
        make_folder(self.path, f"cannot make the folder {self.path}")
        write_whole(self.path / _MANIFEST, json.dumps(manifest, indent=2).encode() + b"\n")

    def read_manifest(self) -> dict[str, Any]:
        """Return what the folder says that it holds.

        Raises
        ------
        InputError
            It holds no demonstrations, or the file that says what they are of is damaged.
        """
        missing = f"there are no demonstrations in {self.path}; `arena train demonstrate` makes some"
        return read_kept(self.path / _MANIFEST, missing)

    def check(self) -> Ruleset:
        """Return the ruleset that the folder is of.

        Raises
        ------
        InputError
            It is of another version, or the rules have changed.
        """
        manifest = self.read_manifest()
        ruleset = load(str(manifest["settings"].get("rules", manifest.get("ruleset"))))
        for name, value in _versions(ruleset).items():
            if manifest.get(name) != value:
                found = manifest.get(name)
                raise InputError(f"the demonstrations in {self.path} are of {name} {found}; {value} is wanted here")
        return ruleset

    def files(self) -> list[File]:
        """Return its files, by process and number; `LostFolderError` if it was deleted."""
        try:
            paths = list(self.path.iterdir())
        except FileNotFoundError as error:
            raise LostFolderError(self.path) from error
        found = ((path, _FILE.fullmatch(path.name)) for path in paths)
        files = [File(path, *map(int, name.groups())) for path, name in found if name]
        return sorted(files, key=lambda file: (file.process, file.number))

    def add(self, process: int, parts: Iterable[Demonstrations]) -> File:
        """Write a file of matches, all of it or nothing; `LostFolderError` if the folder was deleted."""
        matches = list(parts)
        samples = join(matches)
        number = 1 + max((file.number for file in self.files() if file.process == process), default=0)
        n_samples = len(samples.outcome)
        path = self.path / f"{process}-{number:05d}-{len(matches)}-{n_samples}.npz"
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **samples._asdict())
        try:
            write_whole(path, buffer.getvalue())
        except ArenaError as error:
            if not self.path.is_dir():
                raise LostFolderError(self.path) from error
            raise
        return File(path, process, number, len(matches), n_samples)


def read(path: Path) -> Demonstrations:
    """Return the samples of a file.

    Raises
    ------
    InputError
        The file is damaged.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return Demonstrations(**{name: arrays[name] for name in Demonstrations._fields})
    except MemoryError:
        raise
    except Exception as error:  # the archive, its compression and its arrays have errors of their own
        raise InputError(f"cannot read {path}: {str(error) or 'it is cut short'}; delete it, and the rest can be used") from error


def _versions(ruleset: Ruleset) -> dict[str, Any]:
    return {"format": FORMAT, "features": FEATURES_VERSION, "ruleset": ruleset.name, "ruleset_hash": ruleset.hash}
