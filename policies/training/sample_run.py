"""A run that learns from samples in files, passing over them as often as it is told, over as many sittings as it takes."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from arena.errors import InputError
from arena.game.ruleset import Ruleset
from policies.networks.checkpoint import check_size, describe, save_checkpoint
from policies.networks.learned import CHUNK
from policies.networks.models import TeamShape, channels_last
from policies.networks.play_settings import PlaySettings
from policies.networks.precision import precision_of
from policies.training.folder import LAST, STEP
from policies.training.gradients import bound_gradients
from policies.training.record import Record
from policies.training.sample_folder import File, SampleFolder, Samples, join
from policies.training.sample_settings import SampleSettings
from policies.training.start import Seated, read_start
from policies.training.training_run import TrainingRun

MOST_NORM = 1.0
AT_ONCE = 4
"""Files whose samples are mixed, and held in memory, at a time."""
UNSEEN_EVERY = 10
"""Of the files of each process in a folder, one in so many is not learned from, but shows how the network fares with what it has
not seen; the same ones, however many files come after."""
_APART = 3
"""By how many numbers the unseen files of a process and of the next are apart."""
_WARMUP = 50
"""Steps in which the rate rises."""
_LEAST_RATE = 0.01
Rows = NDArray[np.intp]


Settings = TypeVar("Settings", bound=SampleSettings)


@dataclass(slots=True)
class Counts:
    """Where a run stands."""

    step: int = 0
    """Rows of metrics: groups of files."""
    passes: int = 0
    """Passes that have ended."""
    groups: int = 0
    """Groups of files of the pass that is under way."""
    updates: int = 0
    """Steps of the optimiser."""
    samples: int = 0
    """Over all processes."""
    seconds: float = 0.0
    """Time spent training, over all sittings."""


def choose_unseen(files: Iterable[File]) -> set[File]:
    """Return those of a folder's files that are not learned from.

    A process begins with the matches that end first, so its first files are of short ones. So each process leaves out another
    number: 2, 12, 22 and so on by the first, 5, 15, 25 by the second, up to 1, 11, 21 by the fourth. Where that file was deleted,
    the next one that is there takes its place, up to the next number that is left out.

    A file that was written later changes nothing, as it has a higher number.
    """
    unseen: dict[tuple[int, int], File] = {}
    for file in sorted(files, key=lambda file: file.number):
        first = 1 + (_APART * file.process + 1) % UNSEEN_EVERY
        if file.number >= first:
            unseen.setdefault((file.process, (file.number - first) // UNSEEN_EVERY), file)
    return set(unseen.values())


class SampleRun(TrainingRun[Settings], Generic[Settings, Samples, Seated]):
    """One run in one process of perhaps several; see `TrainingRun`."""

    method: ClassVar[str]
    errors: ClassVar[tuple[str, ...]]
    """What a minibatch tells of the network; the first is the loss."""
    play: ClassVar[PlaySettings] = PlaySettings()
    """How what is saved is to be played."""
    folder_type: type[SampleFolder[Samples]]
    counts: Counts
    network: Seated
    """What is saved as a checkpoint, averaged over its last steps."""
    others: dict[str, nn.Module]
    """What learns beside it, and is saved in the run's state alone."""

    def _shape(self) -> TeamShape:
        """Return the shape that the settings ask for."""
        raise NotImplementedError

    def _fresh(self) -> Seated:
        """Return a network of that shape, on the CPU."""
        raise NotImplementedError

    def _heads(self) -> dict[str, nn.Module]:
        """Return what is to learn beside the network, on the CPU."""
        return {}

    def _mirror(self, samples: Samples, which: NDArray[np.bool_]) -> Samples:
        """Return a copy in which some samples are mirrored north to south; shape (n,)."""
        raise NotImplementedError

    def _loss(self, network: Seated, samples: Samples, rows: Rows, ruleset: Ruleset) -> tuple[Tensor, Tensor]:
        """Return what is to become small, and `errors`, both over some rows of the samples."""
        raise NotImplementedError

    def _tell(self, metrics: Mapping[str, float]) -> str:
        """Return how it goes, in a few words."""
        raise NotImplementedError

    def _begin(self, device: str) -> None:
        settings = self.settings
        self.device, self.precision = torch.device(device), precision_of(device)
        self._files: list[tuple[Path, Ruleset]] = []
        self._unseen: list[tuple[Path, Ruleset]] = []
        what, command = self.folder_type.what, self.folder_type.command
        for path in settings.data:
            data = self.folder_type(Path(path))
            ruleset, files = data.check(), data.files()
            unseen = choose_unseen(files)
            for file in files:
                (self._unseen if file in unseen else self._files).append((file.path, ruleset))
        if all(ruleset.hash != self.ruleset.hash for _, ruleset in [*self._files, *self._unseen]):
            raise InputError(f"there are no {what} of ruleset {settings.rules} in {', '.join(settings.data)}")
        if not self._files or not self._unseen:
            raise InputError(
                f"there are too few {what} in {', '.join(settings.data)} to learn from some and be judged by others;"
                f" `{command}` adds some, with more --matches"
            )
        torch.manual_seed(settings.seed)
        check_size(self._shape())
        self.network = self._fresh()
        if self.start:
            self.network = read_start(Path(self.start), self.ruleset, self.network)
        self.others = self._heads()
        for module in (self.network, *self.others.values()):
            channels_last(module.to(self.device))
        self.average = {name: tensor.detach().clone() for name, tensor in self.network.state_dict().items()}
        """Running average of the weights: what is saved."""
        self.parameters = [one for module in (self.network, *self.others.values()) for one in module.parameters()]
        self.optimiser = torch.optim.Adam(self.parameters, lr=settings.rate)
        self.counts = Counts()
        self._metrics = (*self.errors, "norm", *(f"unseen_{name}" for name in self.errors), "rate")

    def train(self, should_stop: Callable[[], bool]) -> bool:
        """Go on until passes or budget are used up, or `should_stop` says so; then save. Return whether they are used up."""
        self._record = Record(self.folder, self.processes, self._report)
        while self.progress < 1 and not self.processes.share_first(should_stop()):
            self._learn_group()
        self.save()
        return self.progress >= 1

    @property
    def progress(self) -> float:
        """How much of the passes, or of the budget, is used up; the same in every process."""
        counts = self.counts
        passes = (counts.passes + min(counts.groups / max(self._n_groups, 1), 1.0)) / self.settings.passes
        return self.processes.share_first(max(passes, self.budget.progress(samples=counts.samples, seconds=counts.seconds)))

    def save(self) -> None:
        """Write the weights that play, and the state to go on from."""
        self._record.saved()
        if not self.processes.is_first:
            return
        settings = asdict(cast(Any, self.settings))
        training = {"method": self.method, "start": self.start, "settings": settings, **asdict(self.counts)}
        manifest = replace(describe(self.network, self.ruleset, training), play=self.play)
        save_checkpoint(self.folder.path / LAST, self.average, manifest)
        self.folder.save_state({
            "network": self.network.state_dict(), **{name: module.state_dict() for name, module in self.others.items()},
            "optimiser": self.optimiser.state_dict(), "average": self.average, "counts": asdict(self.counts),
        })  # fmt: skip

    def _restore(self, state: Mapping[str, Any]) -> None:
        for name, module in {"network": self.network, **self.others}.items():
            module.load_state_dict(state[name])
        self.optimiser.load_state_dict(state["optimiser"])
        self.average = {name: tensor.to(self.device) for name, tensor in state["average"].items()}
        self.counts = Counts(**state["counts"])

    @property
    def _n_groups(self) -> int:
        return math.ceil(len(self._files) / AT_ONCE)

    def _learn_group(self) -> None:
        """Learn from the next files of the pass, and count."""
        counts = self.counts
        order = np.random.default_rng([self.settings.seed, counts.passes]).permutation(len(self._files))
        files = np.array_split(order, self._n_groups)[min(counts.groups, self._n_groups - 1)]
        rng = np.random.default_rng([self.settings.seed, counts.passes, counts.groups])
        rate, sums = 0.0, torch.zeros(len(self.errors) + 1)
        batches = [batch for part in self._read_mixed(files, rng) for batch in part]
        for index in rng.permutation(len(batches)):
            samples, rows, ruleset = batches[index]
            rate = self._set_rate()
            sums += self._step(samples, np.array_split(rows, self.processes.n)[self.processes.rank], ruleset)
        means = (self.processes.mean(sums) / len(batches)).tolist()
        unseen = self._judge_unseen(rng)
        counts.groups += 1
        if counts.groups >= self._n_groups:
            counts.passes, counts.groups = counts.passes + 1, 0
        self._note(
            sum(len(rows) for _, rows, _ in batches),
            dict(zip(self._metrics, (*means, *unseen, rate), strict=True)),
        )

    def _read_mixed(self, files: Rows, rng: np.random.Generator) -> Iterator[list[tuple[Samples, Rows, Ruleset]]]:
        """Yield the minibatches of some files, which are of one ruleset each; half of their samples are mirrored."""
        for wanted in dict.fromkeys(self._files[index][1].hash for index in files):
            mine = [self._files[index] for index in files if self._files[index][1].hash == wanted]
            samples = join([self.folder_type.read(path) for path, _ in mine])
            n = len(samples[0])
            samples = self._mirror(samples, rng.random(n) < 0.5)
            parts = np.array_split(rng.permutation(n), max(round(n / self.settings.minibatch), 1))
            yield [(samples, rows, mine[0][1]) for rows in parts]

    def _set_rate(self) -> float:
        done = min(self.progress, 1.0)
        cosine = 0.5 + 0.5 * math.cos(math.pi * done)
        self.counts.updates += 1
        rate = self.settings.rate * (_LEAST_RATE + (1 - _LEAST_RATE) * cosine) * min(1.0, self.counts.updates / _WARMUP)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        return rate

    def _step(self, samples: Samples, rows: Rows, ruleset: Ruleset) -> Tensor:
        """Take a step, if its gradient is sound; return `errors`, and the norm."""
        self.optimiser.zero_grad(set_to_none=True)
        sums = torch.zeros(len(self.errors), device=self.device)
        size = CHUNK if self.device.type == "cpu" else max(len(rows), 1)
        for part in np.array_split(rows, max(math.ceil(len(rows) / size), 1)):
            loss, metrics = self._loss(self.network, samples, part, ruleset)
            share = len(part) / len(rows)
            (loss * share).backward()  # type: ignore[no-untyped-call]
            sums += metrics * share
        self.processes.average_gradients(self.parameters)
        norm = bound_gradients(self.parameters, MOST_NORM)
        self.optimiser.step()
        with torch.no_grad():
            for name, tensor in self.network.state_dict().items():
                self.average[name].lerp_(tensor, 1 - self.settings.average)
        return torch.cat([sums.cpu(), torch.tensor([norm])])

    def _judge_unseen(self, rng: np.random.Generator) -> list[float]:
        """Return `errors` with the averaged weights, on some samples that are not learned from."""
        path, ruleset = self._unseen[self.counts.step % len(self._unseen)]
        samples = self.folder_type.read(path)
        rows = rng.permutation(len(samples[0]))[: self.settings.minibatch]
        averaged = self._fresh()
        channels_last(averaged.to(self.device))
        averaged.load_state_dict(self.average)
        sums = torch.zeros(len(self.errors), device=self.device)
        with torch.inference_mode():
            for part in np.array_split(rows, math.ceil(len(rows) / CHUNK)):
                sums += self._loss(averaged, samples, part, ruleset)[1] * (len(part) / len(rows))
        return list(sums.tolist())

    def _note(self, n: int, metrics: Mapping[str, float]) -> None:
        """Count, write the metrics, save if it is time, and report."""
        counts, took_s = self.counts, self._record.lap()
        counts.step += 1
        counts.samples += n
        counts.seconds += took_s
        per_s = n / max(took_s, 1e-9)
        row = {STEP: counts.step, "passes": counts.passes, "seconds": counts.seconds, "samples": counts.samples, "per_s": per_s}
        self._record.add({**row, **metrics}, counts.samples)
        if self._record.is_save_due():
            self.save()
        text = f"{counts.samples:,} samples, {per_s:,.0f} per s; {self._tell(metrics)}"
        self._record.report(self.progress, counts.seconds, text)
