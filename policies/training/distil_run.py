"""A run that learns from demonstrations, passing over them as often as it is told, over as many sittings as it takes.

Of a teacher that is unsure, its chances are learned beside its orders. Source: Hinton, Vinyals, Dean, "Distilling the knowledge
in a neural network" (2015). A network that is taught what a search makes of the positions that it gets itself into is expert
iteration: Anthony, Tian, Barber, "Thinking fast and slow with deep learning and tree search" (2017).
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from arena.errors import InputError
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from policies.networks.checkpoint import check_size, describe, save_checkpoint
from policies.networks.learned import CHUNK
from policies.networks.models import Judge, Locator, TeamNetwork, TeamShape, channels_last
from policies.networks.precision import autocast, precision_of
from policies.training.demonstrations import CERTAIN, DemonstrationFolder, Demonstrations, File, join, mirrored, read
from policies.training.distil_settings import DistilSettings
from policies.training.folder import LAST, STEP
from policies.training.gradients import bound_gradients
from policies.training.record import Record
from policies.training.start import read_start
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
_ERRORS = ("loss", "agreed", "value_loss", "belief_loss")
"""What a minibatch tells of the network: cross entropies in nats, the share of orders that are the teacher's, a squared error."""
_METRICS = (*_ERRORS, "norm", *(f"unseen_{name}" for name in _ERRORS), "rate")
Rows = NDArray[np.intp]
Batch = tuple[Demonstrations, Rows, Ruleset]
"""Samples, the rows of them that are a minibatch, and the ruleset that they are of."""


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


class DistilRun(TrainingRun[DistilSettings]):
    """One run in one process of perhaps several; see `TrainingRun`."""

    counts: Counts

    def _begin(self, device: str) -> None:
        settings, start = self.settings, self.start
        shape = TeamShape(channels=settings.channels, blocks=settings.blocks)
        check_size(shape)
        self.device, self.precision = torch.device(device), precision_of(device)
        self._files: list[tuple[Path, Ruleset]] = []
        self._unseen: list[tuple[Path, Ruleset]] = []
        for path in settings.data:
            data = DemonstrationFolder(Path(path))
            ruleset, files = data.check(), data.files()
            unseen = choose_unseen(files)
            for file in files:
                (self._unseen if file in unseen else self._files).append((file.path, ruleset))
        if all(ruleset.hash != self.ruleset.hash for _, ruleset in [*self._files, *self._unseen]):
            raise InputError(f"there are no demonstrations of ruleset {settings.rules} in {', '.join(settings.data)}")
        if not self._files or not self._unseen:
            raise InputError(
                f"there are too few demonstrations in {', '.join(settings.data)} to learn from some and be judged by others;"
                " `arena train demonstrate` adds some, with more --matches"
            )
        torch.manual_seed(settings.seed)
        network = TeamNetwork(shape)
        if start:
            network = read_start(Path(start), self.ruleset, network)
        self.network, self.judge = channels_last(network.to(self.device)), Judge(network.shape).to(self.device)
        self.locator = channels_last(Locator(network.shape).to(self.device))
        self.average = {name: tensor.detach().clone() for name, tensor in network.state_dict().items()}
        """Running average of the weights: what is saved."""
        self.parameters = [*self.network.parameters(), *self.judge.parameters(), *self.locator.parameters()]
        self.optimiser = torch.optim.Adam(self.parameters, lr=settings.rate)
        self.counts = Counts()

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
        training = {"method": "distil", "start": self.start, "settings": asdict(self.settings), **asdict(self.counts)}
        save_checkpoint(self.folder.path / LAST, self.average, describe(self.network, self.ruleset, training))
        self.folder.save_state({
            "network": self.network.state_dict(), "judge": self.judge.state_dict(), "locator": self.locator.state_dict(),
            "optimiser": self.optimiser.state_dict(), "average": self.average, "counts": asdict(self.counts),
        })  # fmt: skip

    def _restore(self, state: Mapping[str, Any]) -> None:
        self.network.load_state_dict(state["network"])
        self.judge.load_state_dict(state["judge"])
        self.locator.load_state_dict(state["locator"])
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
        rate, sums = 0.0, torch.zeros(len(_ERRORS) + 1)
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
            dict(zip(_METRICS, (*means, *unseen, rate), strict=True)),
        )

    def _read_mixed(self, files: Rows, rng: np.random.Generator) -> Iterator[list[Batch]]:
        """Yield the minibatches of some files, which are of one ruleset each; half of their samples are mirrored."""
        for wanted in dict.fromkeys(self._files[index][1].hash for index in files):
            mine = [self._files[index] for index in files if self._files[index][1].hash == wanted]
            samples = join([read(path) for path, _ in mine])
            n = len(samples.outcome)
            samples = mirrored(samples, rng.random(n) < 0.5)
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

    def _step(self, samples: Demonstrations, rows: Rows, ruleset: Ruleset) -> Tensor:
        """Take a step, if its gradient is sound; return `_ERRORS`, and the norm."""
        self.optimiser.zero_grad(set_to_none=True)
        sums = torch.zeros(len(_ERRORS), device=self.device)
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

    def _loss(self, network: TeamNetwork, samples: Demonstrations, rows: Rows, ruleset: Ruleset) -> tuple[Tensor, Tensor]:
        n_walkers = sum(not unit.flies for unit in ruleset.team(Team.BLUE))
        planes, scalars, cell, legal, labels, chances, enemies, outcome = (
            torch.from_numpy(column[rows]).to(self.device) for column in samples
        )
        with autocast(self.device.type, self.precision):
            values, board = network.look(planes, scalars)
            logits = network.decide(values, board, cell.long(), legal, n_walkers)
            value, places = self.judge(board, scalars), self.locator(board)
        is_known = (labels >= 0).float()
        sure = functional.one_hot(labels.long().clamp_min(0), logits.shape[-1]).float()
        chances = chances.float() / chances.float().sum(-1, keepdim=True).clamp_min(1 / CERTAIN)
        target = sure.lerp(chances, self.settings.soft)
        n = is_known.sum().clamp_min(1)
        loss = -((target * logits.log_softmax(-1)).sum(-1) * is_known).sum() / n
        agreed = ((logits.argmax(-1) == labels) * is_known).sum() / n
        value_loss = (value - outcome).square().mean()
        there = enemies.flatten(1, 2).float()
        belief_loss = -(there * places.log_softmax(1)).sum() / there.sum().clamp_min(1)
        whole = loss + self.settings.value * value_loss + self.settings.belief * belief_loss
        return whole, torch.stack([loss.detach(), agreed, value_loss.detach(), belief_loss.detach()])

    def _judge_unseen(self, rng: np.random.Generator) -> list[float]:
        """Return `_ERRORS` with the averaged weights, on some samples that are not learned from."""
        path, ruleset = self._unseen[self.counts.step % len(self._unseen)]
        samples = read(path)
        rows = rng.permutation(len(samples.outcome))[: self.settings.minibatch]
        averaged = channels_last(TeamNetwork(self.network.shape).to(self.device))
        averaged.load_state_dict(self.average)
        sums = torch.zeros(len(_ERRORS), device=self.device)
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
        how = f"agrees with the teacher in {metrics['agreed']:.3f}, unseen {metrics['unseen_agreed']:.3f}"
        self._record.report(self.progress, counts.seconds, f"{counts.samples:,} samples, {per_s:,.0f} per s; {how}")
