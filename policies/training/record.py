"""The record of a run: a row of metrics for each step, TensorBoard, when to save, and its progress."""

import math
import time
from collections.abc import Callable, Mapping

from policies.training.folder import RunFolder, open_board
from policies.training.parallel import Processes

SAVE_EVERY_S = 30.0
ReportProgress = Callable[[float, str], None]
"""Called with the share of the run that is done, from 0 to 1, and a line about how it goes."""


class Record:
    """The record of one sitting; in all processes but the first it writes nothing.

    Parameters
    ----------
    report
        Called after each step.
    """

    def __init__(self, folder: RunFolder, processes: Processes, report: ReportProgress) -> None:
        self._folder, self._processes, self._report = folder, processes, report
        self._board = open_board(folder.path) if processes.is_first else None
        self._saved_s = self._lap_s = time.monotonic()

    def lap(self) -> float:
        """Return the seconds since the last lap."""
        now_s = time.monotonic()
        took_s, self._lap_s = now_s - self._lap_s, now_s
        return took_s

    def add(self, row: Mapping[str, float | int | str], at: int) -> None:
        """Keep a row of metrics; `at` is where it stands on TensorBoard's axis."""
        if not self._processes.is_first:
            return
        self._folder.add_metrics(row)
        if self._board is not None:
            for name, value in row.items():
                if isinstance(value, int | float) and math.isfinite(value):
                    self._board.add_scalar(name, value, at)

    def report(self, progress: float, seconds: float, text: str) -> None:
        """Report how the run goes, and how much time is left."""
        left_s = seconds * max(1 / progress - 1, 0.0) if progress else math.nan
        self._report(min(progress, 1.0), f"{text}; {left_s / 60:.0f} min left" if progress else text)

    def is_save_due(self) -> bool:
        """Return whether it is time to save: the same in every process."""
        return self._processes.share_first(time.monotonic() - self._saved_s > SAVE_EVERY_S)

    def saved(self) -> None:
        """Take note that all was saved."""
        self._saved_s = time.monotonic()
