"""A run as a folder: its settings, its metrics, checkpoints to play with, and the state to go on from.

settings.json       the run's configuration
metrics.csv         a row for each rollout
start.safetensors   the cloned start
last.safetensors    the newest weights, ready to play; after the run, the result
state.pt            all that `--resume` needs
"""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import torch

from arena.errors import ArenaError, InputError
from arena.folders import hold_folder, make_folder
from policies.networks.checkpoint import write_whole
from policies.training.settings import read_kept

SETTINGS, METRICS, START, LAST, STATE = "settings.json", "metrics.csv", "start.safetensors", "last.safetensors", "state.pt"
STEP = "step"
"""The column that counts rows, from 1."""


class RunFolder:
    """The folder of one run."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def refuse_if_taken(self) -> None:
        """Let no new run begin where there is one.

        Raises
        ------
        InputError
            There is a run in the folder already.
        """
        if (self.path / SETTINGS).exists():
            raise InputError(f"there is a run in {self.path} already; go on with it by --resume, or choose another --out")

    def create(self, config: Mapping[str, Any]) -> None:
        """Make the folder of a new run.

        Raises
        ------
        InputError
            There is a run in it already, or nothing can be written there.
        """
        self.refuse_if_taken()
        make_folder(self.path, f"cannot make the folder {self.path}")
        write_whole(self.path / SETTINGS, json.dumps(config, indent=2).encode() + b"\n")

    def hold(self) -> AbstractContextManager[None]:
        """Let no other process train in the folder; `InputError` if one does."""
        return hold_folder(self.path, "training")

    def read_settings(self) -> dict[str, Any]:
        """Return the run's configuration.

        Raises
        ------
        InputError
            There is no run in the folder, or its file is damaged.
        """
        return read_kept(self.path / SETTINGS, f"there is no run in {self.path}; start one without --resume")

    def save_state(self, state: Mapping[str, Any]) -> None:
        """Keep what `--resume` needs, all of it or nothing."""
        buffer = io.BytesIO()
        torch.save(dict(state), buffer)
        write_whole(self.path / STATE, buffer.getvalue())

    def load_state(self) -> dict[str, Any] | None:
        """Return what was kept, or None before anything was.

        Raises
        ------
        InputError
            The file is damaged.
        """
        path = self.path / STATE
        if not path.exists():
            return None
        try:
            state: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:
            raise InputError(f"cannot go on from {path}: it is damaged ({type(error).__name__})") from error
        return state

    def add_metrics(self, row: Mapping[str, float | int | str]) -> None:
        """Add a row; a column that an earlier row did not have is no longer added."""
        path = self.path / METRICS
        values = {name: round(value, 6) if isinstance(value, float) else value for name, value in row.items()}
        try:
            with path.open("a+", encoding="utf-8", newline="") as file:
                file.seek(0)
                header = next(csv.reader(file), None)
                writer = csv.DictWriter(file, header or list(row), extrasaction="ignore", restval="")
                if not header:  # nothing, or an empty line
                    file.truncate(0)
                    writer.writeheader()
                writer.writerow(values)
        except OSError as error:
            raise ArenaError(f"cannot write {path}: {error.strerror}; the last checkpoint is good") from error

    def cut_metrics(self, step: int) -> None:
        """Drop the rows after `step`: they belong to what was lost when the run was killed.

        If none are left, the file is begun anew: where a full disk ended the run, the header may be cut, too.

        Raises
        ------
        InputError
            The file is damaged.
        """
        path = self.path / METRICS
        if not path.exists():
            return
        names, rows = read_metrics(path)
        if rows and (STEP not in names or any(None in row for row in rows)):
            raise InputError(f"cannot go on with {path}: its header is damaged; move it away, and it is begun anew")
        rows = [row for row in rows if (row[STEP] or "").isdecimal() and int(row[STEP]) <= step]
        if not rows:
            path.unlink()
            return
        text = io.StringIO()
        writer = csv.DictWriter(text, names)
        writer.writeheader()
        writer.writerows(rows)
        write_whole(path, text.getvalue().encode())


def read_metrics(path: Path) -> tuple[Sequence[str], list[dict[str, str]]]:
    """Return the columns and the rows of a file of metrics.

    Raises
    ------
    InputError
        It cannot be read, or is no text.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.DictReader(file)
            return reader.fieldnames or [], list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot read {path}: {error}; move it away, and the run goes on without it") from error


def open_board(path: Path) -> Any | None:
    """Return a TensorBoard writer, or None where TensorBoard is not installed (the extra `train`)."""
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(path))
