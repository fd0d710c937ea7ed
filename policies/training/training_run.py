"""What the runs of all methods share: what a run is made from, and how it goes on from what its folder keeps."""

from collections.abc import Mapping
from typing import Any, Generic, Protocol, TypeVar

from arena.errors import InputError
from arena.game.ruleset import load as load_rules
from policies.training.budget import Budget
from policies.training.folder import RunFolder
from policies.training.parallel import Processes
from policies.training.record import ReportProgress


class RunSettings(Protocol):
    """The settings of a method."""

    @property
    def rules(self) -> str:
        """The ruleset's name."""


class RunCounts(Protocol):
    """Where a run stands."""

    step: int
    """Rows of metrics so far."""


Settings = TypeVar("Settings", bound=RunSettings)


class TrainingRun(Generic[Settings]):
    """One run in one process of perhaps several.

    Parameters
    ----------
    start
        A checkpoint's file, or nothing; for PPO also `clone:FIGHTER`.
    report
        Called after each step.
    device
        Where the networks compute, as torch names it; matches are played on the CPU.
    """

    counts: RunCounts

    def __init__(
        self,
        folder: RunFolder,
        settings: Settings,
        start: str,
        budget: Budget,
        processes: Processes,
        report: ReportProgress,
        device: str = "cpu",
    ) -> None:
        self.folder, self.settings, self.start, self.budget, self.processes, self._report = (
            folder, settings, start, budget, processes, report,
        )  # fmt: skip
        self.ruleset = load_rules(settings.rules)
        self._begin(device)
        state = folder.load_state()
        if state is not None:
            self._go_on(state)
        if processes.is_first:
            folder.cut_metrics(self.counts.step)

    def _begin(self, device: str) -> None:
        """Make all that learns, and counts of nothing."""
        raise NotImplementedError

    def _restore(self, state: Mapping[str, Any]) -> None:
        """Take up what `save` kept; any error of reading it means that another version did."""
        raise NotImplementedError

    def _go_on(self, state: Mapping[str, Any]) -> None:
        try:
            self._restore(state)
        except (KeyError, RuntimeError, TypeError, ValueError) as error:
            raise InputError(f"cannot go on from {self.folder.path}: its state is of another version ({error})") from error
