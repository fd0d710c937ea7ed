"""A run of cloning and PPO: from nothing, from a script or from a checkpoint, over as many sittings as it takes.

What was left out, and why: the state of matches is not saved. A run that goes on begins new matches, on maps of their own, which
costs nothing but the exactness of the sequel; weights, optimiser, former selves and counts are saved every half minute.
"""

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from copy import deepcopy
from dataclasses import asdict, dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from arena.envs.batched import BatchedEnv
from arena.errors import InputError
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from policies.networks.checkpoint import check_size, describe, save_checkpoint
from policies.networks.judges import Critic
from policies.networks.models import TeamNetwork, TeamShape
from policies.registry import load
from policies.training.clone import Teacher, clone
from policies.training.folder import LAST, START, STEP
from policies.training.opponents import BEST, NOBODY, PAST, SELF, Newest, Opponents, Pool, assign, check_learner, prioritise
from policies.training.ppo import Learner, schedule
from policies.training.ppo_settings import PpoSettings
from policies.training.record import Record
from policies.training.rollout import Actors, Experience, LearnerSeats, Results
from policies.training.start import read_start
from policies.training.training_run import TrainingRun

CLONE = "clone:"
_LEARNING = (
    "clone_loss", "agreed", "policy_loss", "value_loss", "entropy", "kl", "clipped", "teacher_kl", "actor_norm", "critic_norm",
    "explained", "steps", "rate", "waited_share",
)  # fmt: skip
"""Columns of the metrics about learning."""
RESEAT_EVERY = 64
"""Rollouts after which rows are given to scripts anew, where the setting `priority` asks for it; all matches begin anew, too."""
_WINDOW = 0.05
"""Weight of the newest rollout in the running scores that metrics and progress show."""


@dataclass(slots=True)
class Counts:
    """Where a run stands."""

    step: int = 0
    samples: int = 0
    """Of PPO, over all processes."""
    cloned: int = 0
    rollouts: int = 0
    seconds: float = 0.0
    """Time spent training, over all sittings."""
    ppo_seconds: float = 0.0
    sittings: int = 0


class Rollout(NamedTuple):
    """What was played to learn from."""

    rules: str
    experience: Experience
    results: Results


class PpoRun(TrainingRun[PpoSettings]):
    """One run in one process of perhaps several; see `TrainingRun`."""

    counts: Counts

    def _begin(self, device: str) -> None:
        settings, start, processes = self.settings, self.start, self.processes
        self._rulesets = {name: load_rules(name) for name in settings.shares()}
        for ruleset in self._rulesets.values():
            check_learner(ruleset, settings.opponents)
        if settings.games < processes.n:
            raise InputError(f"the setting games is {settings.games}; {processes.n} processes need a row each")
        self._teachers = _teachers(start, settings)
        for name in {*settings.opponents, *self._teachers.values()} - {SELF, BEST, PAST}:
            load(name)  # who is not there is refused before the run has a folder
        if settings.teacher_kl and not (start or self._teachers):
            raise InputError("the setting teacher_kl keeps PPO near the network that it starts from; give one by --start")
        shape = TeamShape(channels=settings.channels, blocks=settings.blocks)
        check_size(shape)
        torch.manual_seed(settings.seed)
        network = TeamNetwork(shape)
        if start and not start.startswith(CLONE):
            network = read_start(Path(start), self.ruleset, network)
        critic = Critic(settings.critic_channels, settings.critic_blocks)
        self.learner = Learner(network, critic, settings, processes, device)
        self.pool = Pool(network.state_dict(), gate_matches=settings.gate_matches, gate_score=settings.gate_score)
        self.actors: dict[str, Actors] = {}
        """The learner's seats under each ruleset, while it trains."""
        self.counts = Counts()
        self.scores: dict[str, float] = {}
        self.newest = Newest()
        """Results of a run that has one opponent, and trains a best response to it."""

    def train(self, should_stop: Callable[[], bool]) -> bool:
        """Go on until the budget is used up, or `should_stop` says so; then save. Return whether the budget is used up."""
        self.counts.sittings += 1
        is_pinned = self.learner.device.type == "cuda"
        self.actors = {name: Actors(list(self._seat(rules)), is_pinned=is_pinned) for name, rules in self._rulesets.items()}
        self._generator = torch.Generator().manual_seed(self.settings.seed + self.processes.rank + 977 * self.counts.sittings)
        self._rng = np.random.default_rng([self.settings.seed, self.processes.rank, self.counts.sittings])
        self._record = Record(self.folder, self.processes, self._report)
        if self._teachers and self.counts.cloned < self.settings.clone_samples:
            self._clone(should_stop)
        if self.settings.teacher_kl:
            self.learner.stay_near(self.pool.start)
        self._meet_selves()
        with ThreadPoolExecutor(1, thread_name_prefix="ahead") as self._player:
            self._ahead: Future[Rollout] | None = None
            while not self._agree(should_stop()) and self.progress < 1:
                self._improve()
        self.save()
        return self.progress >= 1

    def _seat(self, ruleset: Ruleset) -> Iterator[LearnerSeats]:
        shares, seed = self._shares_now(), self.settings.seed * 1_000_003 + self.counts.sittings
        for first_row, n_rows in self._groups_of_rows():
            env = BatchedEnv(ruleset, n_rows, seed=seed, first_row=first_row)
            yield LearnerSeats(env, Opponents(ruleset, shares, first_row, n_rows, self.learner.network))

    def _groups_of_rows(self) -> list[tuple[int, int]]:
        """Return first and number of each group of this process's rows."""
        first_row, n_rows = self.processes.share(self.settings.games)
        n_here = int(os.environ.get("LOCAL_WORLD_SIZE", "1"))  # processes that share this machine, as torchrun says
        on_gpu = max(len(os.sched_getaffinity(0)) // n_here, 1)
        wanted = self.settings.actors or (1 if self.learner.device.type == "cpu" else on_gpu)
        n = max(min(wanted, n_rows), 1)
        edges = [first_row + n_rows * group // n for group in range(n + 1)]
        return [(first, last - first) for first, last in pairwise(edges)]

    def _shares_now(self) -> dict[str, float]:
        return prioritise(self.settings.opponents, self.processes.share_first(self.scores), self.settings.priority)

    def _reseat(self) -> None:
        """Begin new matches, with rows for each script by how it fares."""
        shares, rows = self._shares_now(), self._groups_of_rows()
        for actors in self.actors.values():
            for group, seats in enumerate(actors.groups):
                seats.env.skip_to(seats.env.episode)
                opponents = Opponents(seats.env.ruleset, shares, *rows[group], self.learner.network)
                actors.groups[group] = LearnerSeats(seats.env, opponents)
        self._meet_selves()

    def _rules_of(self, step: int) -> str:
        """Return the ruleset whose turn it is: the one that is furthest behind its share."""
        return next(iter(assign(self.settings.shares(), step, 1)))

    @property
    def _only(self) -> str | None:
        """The opponent of a best response, which is met alone."""
        names = list(self._met())
        return names[0] if len(names) == 1 and names[0] not in (SELF, BEST, PAST, NOBODY) else None

    def _met(self) -> Iterable[str]:
        """Return who is met under the run's own ruleset."""
        return self.settings.opponents if self.ruleset.team(Team.RED) else (NOBODY,)

    @property
    def progress(self) -> float:
        """How much of the budget is used up; the same in every process."""
        mine = self.budget.progress(samples=self.counts.cloned + self.counts.samples, seconds=self.counts.seconds)
        return self.processes.share_first(mine)

    def save(self) -> None:
        """Write the weights that play, and the state to go on from."""
        self._record.saved()
        if not self.processes.is_first:
            return
        self._save_weights(LAST)
        self.folder.save_state({
            "network": self.learner.network.state_dict(), "critic": self.learner.critic.state_dict(),
            "optimiser": self.learner.optimiser.state_dict(), "average": self.learner.average,
            "scale": [self.learner.scale.mean, self.learner.scale.square, self.learner.scale.weight],
            "selves": self.pool.selves, "points": self.pool.points, "recent": list(self.pool.recent),
            "counts": asdict(self.counts), "scores": self.scores, "newest": list(self.newest.points),
        })  # fmt: skip

    def _restore(self, state: Mapping[str, Any]) -> None:
        self.learner.network.load_state_dict(state["network"])
        self.learner.critic.load_state_dict(state["critic"])
        self.learner.optimiser.load_state_dict(state["optimiser"])
        self.learner.average = {name: one.to(self.learner.device) for name, one in state["average"].items()}
        self.learner.scale.mean, self.learner.scale.square, self.learner.scale.weight = state["scale"]
        self.pool.selves, self.pool.points = state["selves"], state["points"]
        self.pool.recent.extend(state["recent"])
        self.counts, self.scores = Counts(**state["counts"]), state["scores"]
        self.newest = Newest(state.get("newest", []))  # runs of earlier versions kept none

    def _clone(self, should_stop: Callable[[], bool]) -> None:
        teachers = {
            rules: [Teacher(self._teachers[rules], seats) for seats in actors.groups] for rules, actors in self.actors.items()
        }
        while self.counts.cloned < self.settings.clone_samples:
            if self._agree(should_stop()) or self.progress >= 1:
                return
            part = self.counts.cloned / self.settings.clone_samples
            rules = self._rules_of(self.counts.step)
            n, metrics = clone(self.actors[rules], teachers[rules], self.learner, part, self._rng, self._generator)
            self.counts.cloned += n * self.processes.n
            if self.counts.cloned >= self.settings.clone_samples:
                self._end_cloning()
            self._note("clone", rules, n, metrics, Results())
        self.save()

    def _end_cloning(self) -> None:
        """Begin PPO with the averaged weights; before anything is saved that says that cloning has ended."""
        self.learner.network.load_state_dict(self.learner.average)
        self.learner.optimiser = torch.optim.Adam(self.learner.parameters, lr=self.settings.rate, eps=1e-5)
        self.pool = Pool(self.learner.average, gate_matches=self.settings.gate_matches, gate_score=self.settings.gate_score)
        if self.processes.is_first:
            self._save_weights(START)

    def _improve(self) -> None:
        """Take a rollout, see whether the best self is to be replaced, and learn, while the next one is played if it may be."""
        start_s = time.monotonic()
        rules, experience, results = self._take_rollout()
        waited_s = time.monotonic() - start_s
        now = schedule(self.settings, self._ppo_progress(), self.counts.rollouts)
        n = experience.reward.numel()
        self.counts.samples += n * self.processes.n
        self.counts.rollouts += 1
        results = self._tend_opponents(rules, results)
        if self.settings.overlap:
            network = deepcopy(self.learner.to_act())  # as it stands, whatever is learned meanwhile
            self._ahead = self._player.submit(self._play, self._rules_of(self.counts.step + 1), network)
        metrics = self.learner.learn(experience, self.actors[rules].n_walkers, now, self._generator)
        metrics |= {"rate": now.rate, "waited_share": waited_s / (time.monotonic() - start_s)}
        self._note("ppo", rules, n, metrics, results)

    def _play(self, rules: str, network: TeamNetwork) -> Rollout:
        results = Results()
        return Rollout(rules, self.actors[rules].collect(network, self.settings.horizon, results), results)

    def _take_rollout(self) -> Rollout:
        """Return the rollout that was played while this process learned, or else play one."""
        if self._ahead is None:
            return self._play(self._rules_of(self.counts.step), self.learner.to_act())
        rollout, self._ahead = self._ahead.result(), None
        return rollout

    def _tend_opponents(self, rules: str, results: Results) -> Results:
        """Count results, and exchange opponents where it is time, while nobody is playing; return those of all processes."""
        if rules != self.settings.rules:
            results.points = {rules: list(chain(*results.points.values()))}
        whole = Results()
        for past, theirs in self.processes.gather((self._past, results)):
            self.pool.note_best(theirs.points.get(BEST, []))
            self.pool.note_past(past, theirs.points.get(PAST, []))
            whole.add(theirs)
        self._note_scores(whole)
        if self.settings.priority and self.counts.rollouts % RESEAT_EVERY == 0:
            self._reseat()
        elif self.pool.try_gate(self.learner.average) or self.counts.rollouts % 8 == 0:
            self._meet_selves()
        return whole

    def _ppo_progress(self) -> float:
        """How much of what cloning left of the budget is used up."""
        total, cloning = (
            self.progress,
            self.budget.progress(samples=self.counts.cloned, seconds=self.counts.seconds - self.counts.ppo_seconds),
        )
        cloning = self.processes.share_first(cloning)
        return min(max((total - cloning) / max(1 - cloning, 1e-9), 0.0), 1.0)

    def _meet_selves(self) -> None:
        self._past = min(self.pool.draw_past(self._rng), len(self.pool.selves) - 1)
        for actors in self.actors.values():
            actors.use(BEST, self.pool.best, self.learner.network)
            actors.use(PAST, self.pool.selves[self._past], self.learner.network)

    def _note(self, stage: str, rules: str, n: int, metrics: dict[str, float], results: Results) -> None:
        """Count, write the metrics, save if it is time, and report."""
        took_s = self._record.lap()
        self.counts.step += 1
        self.counts.seconds += took_s
        if stage == "ppo":
            self.counts.ppo_seconds += took_s
        per_s = n * self.processes.n / max(took_s, 1e-9)
        row: dict[str, float | int | str] = {
            STEP: self.counts.step, "stage": stage, "rules": rules, "seconds": self.counts.seconds, "cloned": self.counts.cloned,
            "samples": self.counts.samples, "per_s": per_s, "selves": len(self.pool.selves),
            "ticks": float(np.mean(results.ticks)) if results.ticks else math.nan,
        }  # fmt: skip
        row |= {name: metrics.get(name, math.nan) for name in _LEARNING}
        met = sorted([*self._met(), *self.settings.also])
        row |= {f"score_{name}": self.scores.get(name, math.nan) for name in met}
        if self._only is not None:
            self.newest.points.extend(results.points.get(self._only, []))
            row |= dict(zip(("newest", "newest_low", "newest_high"), self.newest.interval(), strict=True))
        self._record.add(row, self.counts.cloned + self.counts.samples)
        if self._record.is_save_due():
            self.save()
        self._record.report(self.progress, self.counts.seconds, self._describe(stage, per_s, metrics))

    def _note_scores(self, results: Results) -> None:
        for name, points in results.points.items():
            if points:
                weight = 1 - (1 - _WINDOW) ** (len(points) / 4)
                self.scores[name] = (1 - weight) * self.scores.get(name, 0.5) + weight * float(np.mean(points))

    def _describe(self, stage: str, per_s: float, metrics: Mapping[str, float]) -> str:
        newest, low, high = self.newest.interval()
        if stage == "clone":
            how = f"agrees with the script in {metrics['agreed']:.2f}"
        elif self._only is not None and not math.isnan(newest):
            how = f"score against {self._only} {newest:.3f} (95%: {low:.3f} to {high:.3f}) over {len(self.newest.points)} matches"
        else:
            how = "score " + ", ".join(f"{name} {score:.2f}" for name, score in sorted(self.scores.items()))
        return f"{stage} {self.counts.cloned + self.counts.samples:,} samples, {per_s:,.0f} per s; {how}"

    def _save_weights(self, name: str) -> None:
        training = {"method": "ppo", "start": self.start, "settings": asdict(self.settings), **asdict(self.counts)}
        save_checkpoint(self.folder.path / name, self.learner.average, describe(self.learner.network, self.ruleset, training))

    def _agree(self, mine: bool) -> bool:
        """Return what the first process thinks, so that all stop, or save, together."""
        return self.processes.share_first(mine)


def _teachers(start: str, settings: PpoSettings) -> dict[str, str]:
    """Return who is cloned under each ruleset; nobody, where the run begins without cloning."""
    rulesets, named = settings.shares(), settings.teachers
    if start.startswith(CLONE):
        return {**dict.fromkeys(rulesets, start.removeprefix(CLONE)), **named}
    if named and (missing := [rules for rules in rulesets if rules not in named]):
        raise InputError(f"the setting teachers names nobody for {', '.join(missing)}; who is to be cloned there?")
    return named
