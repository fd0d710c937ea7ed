"""Make trials: a learner plays, and in every tick plans are tried in playouts, those around its own among them.

So it learns from the positions that it gets itself into, and from the plans that it will choose between there. Before there is a
learner, whatever did best in the playouts is played.
"""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.envs.batched import BatchedEnv
from arena.errors import InputError
from arena.game.observation import Observations
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from policies.networks.appraiser import Appraiser
from policies.networks.models import TeamNetwork, TeamShape
from policies.networks.play_settings import PlaySettings
from policies.search.climb import BEST, BLUEPRINT, LAST, Effort
from policies.search.planner import MOST_SIDE
from policies.search.plans import copy_plan
from policies.search.strategist import Strategist, fresh_shape, to_frame
from policies.search.trials import UNTRIED, try_plans, write_variants
from policies.training.gather import gather
from policies.training.gather_settings import GatherSettings
from policies.training.opponents import BEST as BEST_SELF
from policies.training.opponents import PAST, SELF, Opponents
from policies.training.record import ReportProgress
from policies.training.settings import check_range
from policies.training.start import read_student
from policies.training.trials import TrialFolder, Trials

_KEPT = 0.06
"""Before there is a learner: by how much a plan must do better than that of before, or the blueprint: few worlds say little."""
_SALT = np.uint64(0x7A11)
"""Apart the chance by which plans are tried and that by which roles order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSettings(GatherSettings):
    """What trials are of. Without a student, what did best in playouts is played."""

    worlds: int = 3
    """Worlds in which each plan is tried."""
    stray: float = 0.06
    """Share of the ticks in which any plan is played instead of the best, so that there is something to mend."""
    file_samples: int = 8192
    """65 MB in memory under the ruleset `paper`, 5 MB on the disk."""
    opponents: dict[str, float] = field(
        default_factory=lambda: {
            "planner-fast": 0.06, "champion": 0.08, "role_team": 0.14, "squad": 0.1, "turtle": 0.1, "border_hunter": 0.1,
            "chameleon": 0.1, "scout_rush": 0.06, "defend": 0.08, "rush": 0.06, "fighter": 0.06, "patrol": 0.04, "roomba": 0.04,
            "spiral": 0.04, "random": 0.02,
        }
    )  # fmt: skip

    def __post_init__(self) -> None:
        self.check()
        check_range(self, "worlds", 1, Strategist.n_worlds)
        check_range(self, "stray", 0, 1)
        if others := {SELF, BEST_SELF, PAST} & set(self.opponents):
            raise InputError(f"the setting opponents names {', '.join(sorted(others))}; name fighters, or a checkpoint's file")


def check(settings: TrialSettings) -> Ruleset:
    """Return the ruleset, if everybody can play under it.

    Raises
    ------
    InputError
        Somebody cannot, or is not there.
    """
    ruleset = settings.load_rules()
    if ruleset.side > MOST_SIDE:
        raise InputError(f"plans are tried on boards of up to {MOST_SIDE} cells a side, and {ruleset.name} has {ruleset.side}")
    read_network(settings)
    return ruleset


def read_network(settings: TrialSettings) -> Appraiser:
    """Return the student's network; a fresh one where there is none."""
    fresh = Appraiser(fresh_shape())
    return read_student(settings.student, fresh) if settings.student else fresh


class PlanTrier:
    """Plays blue in some rows without end, and yields the trials of each match that has ended. See `gather.Player`."""

    def __init__(self, settings: TrialSettings, process: int, sitting: int) -> None:
        ruleset, n = load_rules(settings.rules), settings.games
        self._settings, self.n_seats = settings, n
        self._env = BatchedEnv(ruleset, n, seed=settings.seed * 1_000_003 + sitting, first_row=process * n)
        self._opponents = Opponents(ruleset, settings.opponents, process * n, n, TeamNetwork(TeamShape()))
        play = PlaySettings(temperature=0.0)
        self._learner = Strategist(ruleset, Team.BLUE, n, network=read_network(settings).eval(), play=play, name="the student")
        self._rng = np.random.default_rng([settings.seed, process, sitting])
        self._orders = {team: np.zeros((n, len(ruleset.team(team))), np.int8) for team in Team}
        self._begun: list[list[tuple[NDArray[Any], ...]]] = [[] for _ in range(n)]
        """What each seat has of its match so far, tick by tick."""

    def play_tick(self) -> Iterator[tuple[int, Trials]]:
        """Play a tick in every row, and yield each seat whose match has ended, with its trials."""
        seen = self._env.observe()
        self._think(seen[Team.BLUE], self._orders[Team.BLUE])
        self._opponents.act(seen[Team.RED], self._orders[Team.RED])
        turn = self._env.step(self._orders)
        ended = np.flatnonzero(turn.has_ended)
        self._learner.start(ended)
        self._opponents.start(turn)
        for seat in ended.tolist():
            ticks, self._begun[seat] = self._begun[seat], []
            yield seat, Trials(*(np.stack(column) for column in zip(*ticks, strict=True)))

    def _think(self, observations: Observations, orders: NDArray[np.int8]) -> None:
        """Try plans, keep what came of them, and write orders."""
        learner, effort = self._learner, Effort.of(1)
        if self._settings.student:
            learner.act(observations, orders)
        else:
            learner.take_in(observations)
        for seat, (mind, seed) in enumerate(zip(learner.minds, observations.seed, strict=True)):
            plans, bench = mind.plans[0], mind.benches[0]
            if not self._settings.student:
                copy_plan(LAST, plans, BEST, plans)
            write_variants(int(Team.BLUE), plans, bench, seed ^ _SALT)
            try_plans(int(Team.BLUE), self._settings.worlds, plans, bench, seed ^ _SALT, effort.horizon, effort.hold)
            self._keep(seat)
            strays = self._rng.random() < self._settings.stray
            if strays or not self._settings.student:
                copy_plan(self._draw(seat) if strays else self._best(seat), plans, BEST, plans)
                orders[seat] = mind.carry_out(BEST)

    def _values(self, seat: int) -> NDArray[np.float32]:
        plans = self._learner.minds[seat].plans[0]
        means = plans.value[:, : self._settings.worlds].mean(1)
        return np.where(plans.n_tried > 0, means, UNTRIED).astype(np.float32)

    def _best(self, seat: int) -> int:
        values = self._values(seat)
        values[[BLUEPRINT, BEST]] += _KEPT
        return int(values.argmax())

    def _draw(self, seat: int) -> int:
        return int(self._rng.choice(np.flatnonzero(self._learner.minds[seat].plans[0].n_tried > 0)))

    def _keep(self, seat: int) -> None:
        encoded, plans = self._learner.encoded, self._learner.minds[seat].plans[0]
        seen = (encoded.planes[seat], encoded.scalars[seat], encoded.cell[seat].astype(np.int16), encoded.alive[seat])
        first = to_frame(plans.first.astype(np.int64), self._learner.encoder.is_turned[seat]).astype(np.int8)
        kept = (*seen, self._learner.likely[seat], plans.role, first, self._values(seat))
        self._begun[seat].append(tuple(column.copy() for column in kept))


def try_in_matches(
    folder: TrialFolder, settings: TrialSettings, n_matches: int, n_processes: int, report: ReportProgress,
    should_stop: Callable[[], bool],
) -> bool:  # fmt: skip
    """Have processes of their own add matches, as `gather` does."""
    folder.open_for(asdict(settings), check(settings))
    return gather(folder, PlanTrier, settings, n_matches, n_processes, report, should_stop)
