"""Make demonstrations: a learner, or its teacher, plays, and the teacher says in every tick what it would order there.

Source: Ross, Gordon, Bagnell, "A reduction of imitation learning and structured prediction to no-regret online learning" (DAgger,
2011). The teacher has a mind for each seat, which hears of all that happened there, whoever played.
"""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.envs.batched import BatchedEnv
from arena.errors import InputError
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Action
from policies.networks.features import ONE, Encoded
from policies.networks.judges import N_ENEMY_PLANES, N_TRUTH_PLANES
from policies.networks.learned import choose, infer
from policies.networks.models import TeamNetwork, TeamShape
from policies.networks.play_settings import MOST_TEMPERATURE, at_temperature
from policies.networks.precision import precision_of, to_act_in
from policies.registry import load
from policies.search.planner import MOST_SIDE, Planner
from policies.training.clone import Teacher, as_legal
from policies.training.demonstrations import CERTAIN, UNKNOWN, DemonstrationFolder, Demonstrations
from policies.training.gather import gather
from policies.training.gather_settings import GatherSettings
from policies.training.opponents import BEST, PAST, Opponents
from policies.training.record import ReportProgress
from policies.training.rollout import LearnerSeats, Results
from policies.training.settings import check_range
from policies.training.start import read_student


@dataclass(frozen=True, slots=True, kw_only=True)
class DemonstrationSettings(GatherSettings):
    """What demonstrations are of. Without a student, the teacher plays all matches."""

    teacher: str = "planner-fast"
    own: float = 0.7
    """Share of the matches that the student plays, where there is one; the teacher plays the rest."""
    temperature: float = 1.0
    """At which the student's orders are drawn; at 0 it plays the likeliest."""
    file_samples: int = 4096
    """31 MB in memory under the ruleset `paper`, 2 MB on the disk."""
    opponents: dict[str, float] = field(
        default_factory=lambda: {
            "self": 0.05, "planner-fast": 0.13, "role_team": 0.12, "squad": 0.1, "turtle": 0.12, "border_hunter": 0.12,
            "chameleon": 0.1, "scout_rush": 0.06, "defend": 0.05, "rush": 0.03, "fighter": 0.03, "patrol": 0.03, "roomba": 0.02,
            "spiral": 0.02, "random": 0.02,
        }
    )  # fmt: skip
    """Share of the matches against each: `self` is learned from on both sides, any other is a fighter."""

    def __post_init__(self) -> None:
        self.check()
        check_range(self, "own", 0, 1)
        check_range(self, "temperature", 0, MOST_TEMPERATURE)
        if others := {BEST, PAST} & set(self.opponents):
            raise InputError(
                f"the setting opponents names {', '.join(sorted(others))}, which PPO alone has; name a checkpoint's file"
            )


def check(settings: DemonstrationSettings) -> Ruleset:
    """Return the ruleset, if everybody can play under it.

    Raises
    ------
    InputError
        Somebody cannot, or is not there.
    """
    ruleset = settings.load_rules()
    teacher = load(settings.teacher)
    if isinstance(teacher, type) and issubclass(teacher, Planner) and ruleset.side > MOST_SIDE:
        raise InputError(
            f"{settings.teacher} cannot teach under {ruleset.name}: it looks ahead on boards of up to {MOST_SIDE} cells a side"
        )
    load_student(settings)
    return ruleset


def load_student(settings: DemonstrationSettings) -> TeamNetwork:
    """Return the student's network; a fresh one where there is none."""
    fresh = TeamNetwork(TeamShape())
    return read_student(settings.student, fresh) if settings.student else fresh


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

    @property
    def n_seats(self) -> int:
        """Seats from which something is to be learned."""
        return self.seats.n_seats


def demonstrate(
    folder: DemonstrationFolder, settings: DemonstrationSettings, n_matches: int, n_processes: int, report: ReportProgress,
    should_stop: Callable[[], bool],
) -> bool:  # fmt: skip
    """Have processes of their own add matches, as `gather` does."""
    folder.open_for(asdict(settings), check(settings))
    return gather(folder, Demonstrator, settings, n_matches, n_processes, report, should_stop)
