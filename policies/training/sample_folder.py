"""A folder of samples to learn from: bounded files that are written whole, and never changed.

demonstrations.json           what they are of; trials.json where they are trials
0-00001-62-4099.npz           process, number, matches and samples
"""

import io
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from arena.errors import ArenaError, InputError
from arena.folders import hold_folder, make_folder
from arena.game.ruleset import Ruleset, load
from policies.networks.checkpoint import write_whole
from policies.networks.features import FEATURES_VERSION
from policies.training.settings import read_kept

_FILE = re.compile(r"(\d+)-(\d{5,})-(\d+)-(\d+)\.npz")
Samples = TypeVar("Samples", bound=NamedTuple)
"""A named tuple of arrays whose first axis is that of the samples."""


class LostFolderError(InputError):
    """The folder of samples is not there any more."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"the folder {path} was deleted; the same command begins anew")


def join(parts: Sequence[Samples]) -> Samples:
    """Return all samples of some."""
    return type(parts[0])._make([np.concatenate(columns) for columns in zip(*parts, strict=True)])


def choose(which: NDArray[np.bool_], ones: Samples, others: Samples) -> Samples:
    """Return some samples where `which` says so, and others elsewhere; shape (n,)."""

    def column(one: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
        return other if one is other else np.where(which.reshape(-1, *[1] * (one.ndim - 1)), one, other)

    return type(others)._make([column(one, other) for one, other in zip(ones, others, strict=True)])


class File(NamedTuple):
    """A file of samples, by its name."""

    path: Path
    process: int
    number: int
    matches: int
    samples: int


class SampleFolder(Generic[Samples]):
    """The folder of samples of one kind under one ruleset."""

    what: ClassVar[str]
    """What they are, in the plural; also the name of the file that says what they are of."""
    command: ClassVar[str]
    """What makes some."""
    format: ClassVar[int]
    """Rises whenever a folder of the old kind can no longer be read."""
    columns: type[Samples]

    def __init__(self, path: Path) -> None:
        self.path = path

    def hold(self) -> AbstractContextManager[None]:
        """Let no other process add samples to the folder; `InputError` if one does."""
        return hold_folder(self.path, f"making {self.what}")

    def open_for(self, settings: Mapping[str, Any], ruleset: Ruleset) -> None:
        """Make the folder for settings, or go on with one that was made for the same.

        Raises
        ------
        InputError
            It was made for others, or cannot be made.
        """
        manifest = {**self._versions(ruleset), "settings": dict(settings)}
        if self._manifest.exists():
            old = self.read_manifest()
            if old != manifest:
                changed = [name for name, value in settings.items() if old["settings"].get(name) != value]
                what = f"with another value of {', '.join(changed)}" if changed else "by another version, or other rules"
                raise InputError(f"the {self.what} in {self.path} were made {what}; choose another --out")
            return
        make_folder(self.path, f"cannot make the folder {self.path}")
        write_whole(self._manifest, json.dumps(manifest, indent=2).encode() + b"\n")

    def read_manifest(self) -> dict[str, Any]:
        """Return what the folder says that it holds.

        Raises
        ------
        InputError
            It holds none, or the file that says what they are of is damaged.
        """
        missing = f"there are no {self.what} in {self.path}; `{self.command}` makes some"
        return read_kept(self._manifest, missing)

    def check(self) -> Ruleset:
        """Return the ruleset that the folder is of.

        Raises
        ------
        InputError
            It is of another version, or the rules have changed.
        """
        manifest = self.read_manifest()
        ruleset = load(str(manifest["settings"].get("rules", manifest.get("ruleset"))))
        for name, value in self._versions(ruleset).items():
            if manifest.get(name) != value:
                found = manifest.get(name)
                raise InputError(f"the {self.what} in {self.path} are of {name} {found}; {value} is wanted here")
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

    def add(self, process: int, parts: Iterable[Samples]) -> File:
        """Write a file of matches, all of it or nothing; `LostFolderError` if the folder was deleted."""
        matches = list(parts)
        samples = join(matches)
        number = 1 + max((file.number for file in self.files() if file.process == process), default=0)
        n_samples = len(samples[0])
        path = self.path / f"{process}-{number:05d}-{len(matches)}-{n_samples}.npz"
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **dict(zip(self.columns._fields, samples, strict=True)))
        try:
            write_whole(path, buffer.getvalue())
        except ArenaError as error:
            if not self.path.is_dir():
                raise LostFolderError(self.path) from error
            raise
        return File(path, process, number, len(matches), n_samples)

    @classmethod
    def read(cls, path: Path) -> Samples:
        """Return the samples of a file.

        Raises
        ------
        InputError
            The file is damaged.
        """
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                return cls.columns._make(arrays[name] for name in cls.columns._fields)
        except MemoryError:
            raise
        except Exception as error:  # the archive, its compression and its arrays have errors of their own
            reason = str(error) or "it is cut short"
            raise InputError(f"cannot read {path}: {reason}; delete it, and the rest can be used") from error

    @property
    def _manifest(self) -> Path:
        return self.path / f"{self.what}.json"

    def _versions(self, ruleset: Ruleset) -> dict[str, Any]:
        return {"format": self.format, "features": FEATURES_VERSION, "ruleset": ruleset.name, "ruleset_hash": ruleset.hash}
