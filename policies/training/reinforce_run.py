"""A run of the paper's method, over as many sittings as it takes.

What was left out, and why: the replay is not saved, since it would be as large as all else together. A run that goes on fills it
anew, so that its first dozen updates draw from fewer and younger samples than they would have.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from arena.envs.batched import BatchedEnv
from arena.errors import InputError
from arena.game.ruleset import load as load_rules
from arena.game.types import Code, Team
from arena.policy import BatchPolicy
from policies.networks.checkpoint import describe, load_checkpoint, save_checkpoint
from policies.networks.models import PaperTeam
from policies.registry import load
from policies.training.curriculum import PROGRESS, check_start
from policies.training.folder import LAST, STEP
from policies.training.opponents import SELF, check_learner
from policies.training.record import Record
from policies.training.reinforce import METRICS, Reinforcer
from policies.training.reinforce_settings import ReinforceSettings
from policies.training.training_run import TrainingRun
from policies.training.trajectories import Outcome, RoundPlayer

_WINDOW = 0.1
"""Weight of the newest round in the running means that progress shows."""


@dataclass(slots=True)
class Counts:
    """Where a run stands; over all processes."""

    step: int = 0
    """Rounds of matches, and so updates."""
    episodes: int = 0
    samples: int = 0
    """Ticks of single units."""
    seconds: float = 0.0
    """Time spent training, over all sittings."""
    sittings: int = 0


class ReinforceRun(TrainingRun[ReinforceSettings]):
    """One run in one process of perhaps several; see `TrainingRun`."""

    counts: Counts

    def _begin(self, device: str) -> None:
        settings, start, processes = self.settings, self.start, self.processes
        check_learner(self.ruleset, {})
        if settings.update_every < processes.n:
            raise InputError(f"update_every is {settings.update_every}; {processes.n} processes need a match each")
        if settings.opponent != SELF:
            load(settings.opponent)  # who is not there is refused before the run has a folder
        torch.manual_seed(settings.seed)
        agents = settings.agents(len(self.ruleset.team(Team.BLUE)))
        network = PaperTeam(settings.window, agents, settings.planes, settings.edge_code)
        if start:
            _transfer(Path(start), self.ruleset.name, network)
        self.learner = Reinforcer(network, settings, processes, device)
        self.counts = Counts()
        self.means = {"won": 0.0, "score": 0.0}

    def train(self, should_stop: Callable[[], bool]) -> bool:
        """Go on until the budget is used up, or `should_stop` says so; then save. Return whether the budget is used up."""
        self.counts.sittings += 1
        first_row, n_rows = self.processes.share(self.settings.update_every)
        env = BatchedEnv(self.ruleset, n_rows, seed=self.settings.seed, first_row=first_row)
        self._rounds = RoundPlayer(env, self._seat_opponent(n_rows), self.settings)
        self._rng = np.random.default_rng([self.settings.seed, self.processes.rank, self.counts.sittings])
        self._record = Record(self.folder, self.processes, self._report)
        while self.progress < 1 and not self.processes.share_first(should_stop()):
            self._round()
        self.save()
        return self.progress >= 1

    @property
    def progress(self) -> float:
        """How much of the budget is used up; the same in every process."""
        counts = self.counts
        return self.processes.share_first(
            self.budget.progress(samples=counts.samples, episodes=counts.episodes, seconds=counts.seconds)
        )

    def save(self) -> None:
        """Write the weights that play, and the state to go on from."""
        self._record.saved()
        progress = self.progress
        if not self.processes.is_first:
            return
        network = self.learner.network
        training = {
            "method": "reinforce", "start": self.start, "settings": asdict(self.settings), **asdict(self.counts),
            PROGRESS: progress,
        }  # fmt: skip
        save_checkpoint(self.folder.path / LAST, network.state_dict(), describe(network, self.ruleset, training))
        self.folder.save_state({
            "network": network.state_dict(), "optimiser": self.learner.optimiser.state_dict(),
            "counts": asdict(self.counts), "means": self.means,
        })  # fmt: skip

    def _restore(self, state: Mapping[str, Any]) -> None:
        self.learner.network.load_state_dict(state["network"])
        self.learner.optimiser.load_state_dict(state["optimiser"])
        self.counts, self.means = Counts(**state["counts"]), state["means"]

    def _seat_opponent(self, n_rows: int) -> BatchPolicy | None:
        """Return who plays red, or None: nobody does, or the learner itself."""
        if self.settings.opponent == SELF or not self.ruleset.team(Team.RED):
            return None
        return load(self.settings.opponent)(self.ruleset, Team.RED, n_rows)

    def _round(self) -> None:
        """Play as many matches as an update needs, and update; in the warm-up only play, and at random."""
        learner, is_warmup = self.learner, self.counts.episodes < self.settings.warmup
        samples, outcome = self._rounds.play_round(None if is_warmup else learner.to_act(), self.counts.step)
        learner.replay.add(samples)
        metrics = dict.fromkeys(METRICS, math.nan) if is_warmup else learner.update(self.counts.step, self._rng)
        self._note(len(samples.unit), outcome, metrics)

    def _note(self, n_samples: int, outcome: Outcome, metrics: Mapping[str, float]) -> None:
        """Count, write the metrics, save if it is time, and report."""
        counts, took_s = self.counts, self._record.lap()
        whole = self.processes.gather((n_samples, outcome))
        counts.step += 1
        counts.episodes += self.settings.update_every
        counts.samples += sum(n for n, _ in whole)
        counts.seconds += took_s
        results = {
            "score": _mean([one.score for _, one in whole]), "won": _mean([one.is_won for _, one in whole]),
            "captures": _mean([one.is_captured for _, one in whole]), "ticks": _mean([one.ticks for _, one in whole]),
            "seen": _mean([one.seen for _, one in whole]), "blocked": _mean([one.blocked for _, one in whole]),
        }  # fmt: skip
        for name in self.means:
            self.means[name] += _WINDOW * (results[name] - self.means[name])
        per_s = sum(n for n, _ in whole) / max(took_s, 1e-9)
        row: dict[str, float | int | str] = {
            STEP: counts.step, "stage": self.ruleset.name, "seconds": counts.seconds, "episodes": counts.episodes,
            "samples": counts.samples, "per_s": per_s, **results, **metrics,
        }  # fmt: skip
        self._record.add(row, counts.episodes)
        if self._record.is_save_due():
            self.save()
        how = f"win rate {self.means['won']:.2f}, score {self.means['score']:+.1f}"
        self._record.report(
            self.progress, counts.seconds, f"{self.ruleset.name} {counts.episodes:,} episodes, {per_s:,.0f} samples per s; {how}"
        )


def _mean(parts: list[np.ndarray[Any, Any]]) -> float:
    return float(np.concatenate(parts).mean())


def _transfer(path: Path, rules: str, network: PaperTeam) -> None:
    """Give a network the weights of a checkpoint; a unit that there was none for gets those of the one that it played as."""
    checkpoint = load_checkpoint(path)
    before = checkpoint.network
    if not isinstance(before, PaperTeam):
        raise InputError(f"cannot start from {path}: it holds a {checkpoint.manifest.network} network, not one of the paper's")
    check_start(path, checkpoint.manifest, load_rules(rules))
    for name in ("window", "planes", "edge"):
        found, wanted = getattr(before, name), getattr(network, name)
        if found != wanted:
            if name == "edge":
                found, wanted = (Code(one).name.lower() for one in (found, wanted))
            raise InputError(f"cannot start from {path}: its {name} is {found}, and the settings ask for {wanted}")
    for index, member in enumerate(network.members):
        member.load_state_dict(before.members[index % before.agents].state_dict())
