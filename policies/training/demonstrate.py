"""Make demonstrations: a learner, or its teacher, plays, and the teacher says in every tick what it would order there.

Source: Ross, Gordon, Bagnell, "A reduction of imitation learning and structured prediction to no-regret online learning" (DAgger,
2011). The teacher has a mind for each seat, which hears of all that happened there, whoever played.

What was left out, and why: matches that are under way are not saved. Whoever goes on begins new ones, on maps of their own.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import wait
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from arena.envs.batched import BatchedEnv
from arena.errors import ArenaError, InputError
from arena.game.ruleset import Ruleset, parse_overrides
from arena.game.ruleset import load as load_rules
from arena.game.types import Action, Team
from policies.networks.features import ONE, Encoded
from policies.networks.learned import choose, infer
from policies.networks.models import N_ENEMY_PLANES, N_TRUTH_PLANES, TeamNetwork, TeamShape
from policies.networks.play_settings import MOST_TEMPERATURE, at_temperature
from policies.networks.precision import precision_of, to_act_in
from policies.registry import CHECKPOINT, load, shipped
from policies.search.planner import MOST_SIDE, Planner
from policies.training.clone import Teacher, as_legal
from policies.training.demonstrations import CERTAIN, UNKNOWN, DemonstrationFolder, Demonstrations, LostFolderError
from policies.training.opponents import BEST, PAST, SELF, Opponents, check_self_play
from policies.training.record import ReportProgress
from policies.training.rollout import LearnerSeats, Results
from policies.training.settings import MOST_SEED, check_range, check_shares, merge_shares, read_values
from policies.training.start import read_team_network

_LOOK_EVERY_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DemonstrationSettings:
    """What demonstrations are of."""

    teacher: str = "planner-fast"
    student: str = ""
    """A checkpoint's file or a shipped network's name, or nothing: the teacher plays all matches."""
    own: float = 0.7
    """Share of the matches that the student plays, where there is one; the teacher plays the rest."""
    temperature: float = 1.0
    """At which the student's orders are drawn; at 0 it plays the likeliest."""
    rules: str = "paper"
    seed: int = 1
    games: int = 24
    """Matches that a process plays at once."""
    file_samples: int = 4096
    """Samples from which on a file is written: 31 MB in memory under the ruleset `paper`, 2 MB on the disk."""
    opponents: dict[str, float] = field(
        default_factory=lambda: {
            "self": 0.05, "planner-fast": 0.13, "role_team": 0.12, "squad": 0.1, "turtle": 0.12, "border_hunter": 0.12,
            "chameleon": 0.1, "scout_rush": 0.06, "defend": 0.05, "rush": 0.03, "fighter": 0.03, "patrol": 0.03, "roomba": 0.02,
            "spiral": 0.02, "random": 0.02,
        }
    )  # fmt: skip
    """Share of the matches against each: `self` is learned from on both sides, any other is a fighter."""

    def __post_init__(self) -> None:
        check_range(self, "seed", 0, MOST_SEED)
        check_range(self, "games", 1, 10**6)
        check_range(self, "file_samples", 1, 10**9)
        check_range(self, "own", 0, 1)
        check_range(self, "temperature", 0, MOST_TEMPERATURE)
        check_shares("opponents", self.opponents)
        if others := {BEST, PAST} & set(self.opponents):
            raise InputError(
                f"the setting opponents names {', '.join(sorted(others))}, which PPO alone has; name a checkpoint's file"
            )

    def with_(self, assignments: Iterable[str]) -> "DemonstrationSettings":
        """Return a copy with values such as "own=0.5" or "opponents.rush=0.5" replaced."""
        new: Mapping[str, Any] = parse_overrides(assignments)
        if "opponents" in new:
            new = {**new, "opponents": merge_shares("opponents", self.opponents, new["opponents"])}
        return read_values(DemonstrationSettings, {**asdict(self), **new})


def check(settings: DemonstrationSettings) -> Ruleset:
    """Return the ruleset, if everybody can play under it.

    Raises
    ------
    InputError
        Somebody cannot, or is not there.
    """
    ruleset = load_rules(settings.rules)
    if not ruleset.team(Team.BLUE):
        raise InputError(f"ruleset {ruleset.name}: blue has no units to show anything with")
    check_self_play(ruleset, settings.opponents)
    teacher = load(settings.teacher)
    if isinstance(teacher, type) and issubclass(teacher, Planner) and ruleset.side > MOST_SIDE:
        raise InputError(
            f"{settings.teacher} cannot teach under {ruleset.name}: it looks ahead on boards of up to {MOST_SIDE} cells a side"
        )
    for name in settings.opponents:
        if name != SELF:
            load(name)
    load_student(settings)
    return ruleset


def load_student(settings: DemonstrationSettings) -> TeamNetwork:
    """Return the student's network; a fresh one where there is none."""
    name = settings.student
    if not name:
        return TeamNetwork(TeamShape())
    if not name.endswith(CHECKPOINT) and name not in shipped():
        raise InputError(f"the student is {name!r}; it must be a checkpoint's file, or one of {', '.join(shipped())}")
    return read_team_network(shipped().get(name, Path(name)), "learn by playing")


class Demonstrator:
    """Plays matches in some rows without end, and yields each that has ended."""

    def __init__(self, settings: DemonstrationSettings, process: int, sitting: int) -> None:
        ruleset, n = load_rules(settings.rules), settings.games
        self._settings, self._network = settings, to_act_in(load_student(settings), precision_of("cpu"))
        env = BatchedEnv(ruleset, n, seed=settings.seed * 1_000_003 + sitting, first_row=process * n)
        self.seats = LearnerSeats(env, Opponents(ruleset, settings.opponents, process * n, n, self._network))
        self.teacher = Teacher(settings.teacher, self.seats)
        self._rng = np.random.default_rng([settings.seed, process, sitting])
        self._is_own = self._draw_players(self.seats.n_seats)
        self._begun: list[list[tuple[NDArray[Any], ...]]] = [[] for _ in range(self.seats.n_seats)]
        """What each seat has of its match so far, tick by tick."""
        self._truth = np.zeros((self.seats.n_seats, ruleset.side, ruleset.side, N_TRUTH_PLANES), np.uint8)

    def play_tick(self) -> Iterator[tuple[int, Demonstrations]]:
        """Play a tick in every row, and yield each seat whose match has ended, with what it has of it."""
        seats = self.seats
        seen = seats.env.observe()
        encoded, seeds = seats.look(seen)
        taught, chances = as_legal(self.teacher.label(seen), encoded.legal), self._legal_chances(encoded)
        actions = np.where(self._is_own[:, None], self._act(encoded, seeds), taught)
        self.teacher.hear(actions)
        labels = np.where(encoded.alive, taught, UNKNOWN).astype(np.int8)
        seats.reveal(self._truth)
        enemies = self._truth[..., :N_ENEMY_PLANES] // ONE
        columns = (encoded.planes, encoded.scalars, encoded.cell.astype(np.int16), encoded.legal, labels, chances, enemies)
        for seat, ticks in enumerate(self._begun):
            ticks.append(tuple(column[seat].copy() for column in columns))
        turn = seats.step(seen, actions, Results())
        reward, _, has_ended = seats.earn(turn)
        self.teacher.start(turn)
        for seat in np.flatnonzero(has_ended).tolist():
            ticks, self._begun[seat] = self._begun[seat], []
            whole = [np.stack(column) for column in zip(*ticks, strict=True)]
            whole.append(np.full(len(ticks), reward[seat], np.float32))
            yield seat, Demonstrations(*whole)
            self._is_own[seat] = self._draw_players(1)[0]

    def _draw_players(self, n: int) -> NDArray[np.bool_]:
        return self._rng.random(n) < self._settings.own if self._settings.student else np.zeros(n, np.bool_)

    def _act(self, encoded: Encoded, seeds: NDArray[np.uint64]) -> NDArray[np.int8]:
        actions = np.zeros((self.seats.n_seats, self.seats.n_units), np.int8)
        if self._is_own.any():
            logits = at_temperature(infer(self._network, encoded, self.seats.n_walkers), self._settings.temperature)
            choose(logits, np.ascontiguousarray(seeds), actions)
        return actions

    def _legal_chances(self, encoded: Encoded) -> NDArray[np.uint8]:
        chances = self.teacher.chances()
        lost = (chances * (encoded.legal == 0)).sum(-1)
        chances *= encoded.legal
        chances[..., Action.STAY] += lost
        return np.rint(CERTAIN * chances).astype(np.uint8)


def demonstrate_alone(
    folder: DemonstrationFolder, settings: DemonstrationSettings, process: int, sitting: int, n_matches: int,
    should_stop: Callable[[], bool],
) -> None:  # fmt: skip
    """Add so many matches to the folder, in this process; what has ended is kept when it is stopped.

    Each seat has its share of them: if the first to end were kept, most of them would be short. A seat that has its share
    plays on, and nothing of that is kept.
    """
    torch.set_num_threads(1)
    demonstrator = Demonstrator(settings, process, sitting)
    left = share_matches(n_matches, demonstrator.seats.n_seats, sitting)
    kept: list[Demonstrations] = []
    while left.any() and not should_stop():
        for seat, match in demonstrator.play_tick():
            if left[seat]:
                kept.append(match)
                left[seat] -= 1
        if kept and (not left.any() or sum(len(match.outcome) for match in kept) >= settings.file_samples):
            folder.add(process, kept)
            kept = []
    if kept:
        folder.add(process, kept)


def share_matches(n_matches: int, n_seats: int, first: int) -> NDArray[np.intp]:
    """Return how many matches are kept of each seat: equally many, or one more, by turns from the seat `first` on."""
    bounds = n_matches * np.arange(n_seats + 1) // n_seats
    return np.roll(np.diff(bounds), first)


def demonstrate(
    folder: DemonstrationFolder, settings: DemonstrationSettings, n_matches: int, n_processes: int, report: ReportProgress,
    should_stop: Callable[[], bool],
) -> bool:  # fmt: skip
    """Have processes of their own add matches, until the folder holds `n_matches`; return whether it does.

    Raises
    ------
    ArenaError
        A process has failed, another command does the same there, or the folder was deleted meanwhile.
    """
    folder.open_for(asdict(settings), check(settings))
    with folder.hold():
        return _add_matches(folder, settings, n_matches, n_processes, report, should_stop)


def _add_matches(
    folder: DemonstrationFolder, settings: DemonstrationSettings, n_matches: int, n_processes: int, report: ReportProgress,
    should_stop: Callable[[], bool],
) -> bool:  # fmt: skip
    sitting = sum(file.matches for file in folder.files())
    left = max(n_matches - sitting, 0)
    parts = [left * (process + 1) // n_processes - left * process // n_processes for process in range(n_processes)]
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    workers = [
        context.Process(target=_work, args=(folder.path, settings, process, sitting, part, stop, os.getpid()))
        for process, part in enumerate(parts) if part
    ]  # fmt: skip
    for worker in workers:
        worker.start()
    running = list(workers)
    while running:
        wait([worker.sentinel for worker in running], _LOOK_EVERY_S)
        running = [worker for worker in running if worker.is_alive()]
        try:
            files = folder.files()
        except LostFolderError:
            stop.set()
            raise
        done, samples = sum(file.matches for file in files), sum(file.samples for file in files)
        report(done / n_matches, f"{done:,} matches, {samples:,} samples")
        if should_stop() or any(worker.exitcode for worker in workers):
            stop.set()
    if any(worker.exitcode for worker in workers):
        raise ArenaError("a process that made demonstrations has failed; what was written is good, and the same command goes on")
    return sum(file.matches for file in folder.files()) >= n_matches


def _work(
    path: Path, settings: DemonstrationSettings, process: int, sitting: int, n_matches: int, stop: Event, parent: int
) -> None:  # fmt: skip
    """Be one of the processes; it ends when the first one says so, or has ended."""
    for number in (signal.SIGINT, signal.SIGTERM):  # which a terminal, or a job's manager, sends to all
        signal.signal(number, signal.SIG_IGN)
    with suppress(LostFolderError):  # which the first process tells
        demonstrate_alone(
            DemonstrationFolder(path), settings, process, sitting, n_matches, lambda: stop.is_set() or os.getppid() != parent
        )
