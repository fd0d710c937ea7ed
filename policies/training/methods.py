"""The methods of training by name: the configuration of a run, as its folder keeps it, and the run that it makes."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from arena.errors import InputError, UnknownNameError
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from policies.networks.checkpoint import read_manifest
from policies.registry import CHECKPOINT, load, shipped
from policies.training import ppo_settings, reinforce_settings
from policies.training.appraise_settings import AppraiseSettings
from policies.training.budget import Budget
from policies.training.distil_settings import DistilSettings
from policies.training.folder import RunFolder
from policies.training.opponents import BEST, PAST, SELF
from policies.training.parallel import Processes
from policies.training.ppo_settings import PpoSettings
from policies.training.record import ReportProgress
from policies.training.reinforce_settings import ReinforceSettings
from policies.training.settings import read_values

PPO, REINFORCE, DISTIL, APPRAISE = "ppo", "reinforce", "distil", "appraise"
Settings = PpoSettings | ReinforceSettings | DistilSettings | AppraiseSettings
_FROM_FILES: dict[str, type[DistilSettings] | type[AppraiseSettings]] = {DISTIL: DistilSettings, APPRAISE: AppraiseSettings}
"""Methods that learn from samples in files."""
DEFAULT_SAMPLES, DEFAULT_EPISODES = 3_000_000, 20_000


class Trainable(Protocol):
    """A run."""

    def train(self, should_stop: Callable[[], bool]) -> bool:
        """Go on until the budget is used up, or `should_stop` says so; return whether the budget is used up."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class RunConfig:
    """Everything that a run is made from."""

    method: str
    start: str
    """`clone:FIGHTER`, a checkpoint's file, or nothing."""
    budget: Budget
    settings: Settings

    def to_dict(self) -> dict[str, Any]:
        """Return the configuration as JSON has it."""
        return asdict(self)

    def for_stage(self, rules: str, start: str) -> "RunConfig":
        """Return the same config for a stage of a curriculum."""
        return replace(self, settings=replace(self.settings, rules=rules), start=start)

    def with_budget(self, budget: Budget) -> "RunConfig":
        """Return the config with another budget, unless that is left open."""
        return self if budget == Budget() else replace(self, budget=checked(self.method, budget))


def checked(method: str, budget: Budget) -> Budget:
    """Return a budget that the method can use up.

    Raises
    ------
    InputError
        It cannot.
    """
    if method != REINFORCE and budget.episodes is not None:
        raise InputError(f"--episodes is for the method reinforce; give {method} --samples or --minutes")
    return budget


def read_config(values: dict[str, Any]) -> RunConfig:
    """Return the config that a run's folder keeps; `InputError` if it is not as it was written."""
    method = values.get("method", PPO)
    try:
        given, budget = values["settings"], Budget(**values["budget"])
        settings: Settings
        if method == REINFORCE:
            settings = reinforce_settings.from_dict(given)
        else:
            settings = read_values(_FROM_FILES[method], given) if method in _FROM_FILES else ppo_settings.from_dict(given)
        return RunConfig(method=method, start=values["start"], budget=budget, settings=settings)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"the settings of this run are not as they were written ({error}); begin another") from error


def make_config(
    method: str,
    start: str,
    budget: Budget,
    *,
    rules: str | None,
    seed: int,
    assignments: Sequence[str],
    data: Sequence[str] = (),
    against: str = "",
) -> RunConfig:
    """Return a configuration from command line options; what is not given is the method's default.

    Parameters
    ----------
    start
        `clone:FIGHTER`, a checkpoint's file, the name of a network that ships, or nothing.
    against
        The only opponent, to which a best response is trained; or nobody.

    Raises
    ------
    InputError
        The method does not take an option.
    """
    if data and method not in _FROM_FILES:
        raise InputError(f"--data is for the methods {' and '.join(_FROM_FILES)}; {method} learns from the matches that it plays")
    if against and method != PPO:
        raise InputError(f"--against is for the method ppo; {method} has no opponents to choose, or chooses them by --set")
    if against and any(assignment.startswith("opponents") for assignment in assignments):
        raise InputError("--against names the only opponent; leave out --set opponents, or --against")
    if method != PPO and start.startswith("clone:"):
        raise InputError(f"--start clone: is for the method ppo; {method} begins with nothing, or from a checkpoint's file")
    known = shipped()
    if start and not (start in known or start.startswith("clone:") or start.endswith(CHECKPOINT) or Path(start).exists()):
        raise UnknownNameError("start", start, ["a checkpoint's file", "clone:SCRIPT", *known])
    start = str(known.get(start, start))
    if method != REINFORCE:
        assignments = [*_shape_of(Path(start)), *assignments]
    if method in _FROM_FILES:
        taught = _FROM_FILES[method](rules=rules or "paper", seed=seed, data=list(data)).with_(assignments)
        return RunConfig(method=method, start=start, budget=checked(method, budget), settings=taught)
    if method == REINFORCE:
        chosen = ReinforceSettings(rules=rules or "exp1", seed=seed).with_(assignments)
        return RunConfig(method=method, start=start, budget=Budget(episodes=DEFAULT_EPISODES), settings=chosen).with_budget(
            budget
        )
    usual = PpoSettings(rules=rules or "paper", seed=seed).with_(assignments)
    if against:
        if against in (SELF, BEST, PAST):
            raise InputError(f"--against is {against!r}; a best response is to a fighter that stays as it is")
        load(against)  # a name that nobody has is refused before anything is made
        if not (alone := load_rules(usual.rules)).team(Team.RED):
            raise InputError(f"--against {against}: ruleset {alone.name} gives red no units, so nobody is met")
        usual = replace(usual, opponents={against: 1.0})
    return RunConfig(method=method, start=start, budget=Budget(samples=DEFAULT_SAMPLES), settings=usual).with_budget(budget)


def _shape_of(start: Path) -> list[str]:
    """Return the settings by which a run has the shape of the checkpoint that it begins from, if it does from one of a team."""
    if not start.is_file():
        return []
    shape = read_manifest(start).shape
    return [f"{name}={shape[name]}" for name in ("channels", "blocks") if name in shape]


def make_run(config: RunConfig, folder: RunFolder, processes: Processes, report: ReportProgress, device: str) -> Trainable:
    """Return the run of a configuration, in one of perhaps several processes."""
    if isinstance(config.settings, ReinforceSettings):
        from policies.training.reinforce_run import ReinforceRun

        return ReinforceRun(folder, config.settings, config.start, config.budget, processes, report, device)
    if isinstance(config.settings, AppraiseSettings):
        from policies.training.appraise_run import AppraiseRun

        return AppraiseRun(folder, config.settings, config.start, config.budget, processes, report, device)
    if isinstance(config.settings, DistilSettings):
        from policies.training.distil_run import DistilRun

        return DistilRun(folder, config.settings, config.start, config.budget, processes, report, device)
    from policies.training.ppo_run import PpoRun

    return PpoRun(folder, config.settings, config.start, config.budget, processes, report, device)
