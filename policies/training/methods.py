"""The ways to train, by their names: what each is told, as a run's folder keeps it, and the run that it makes."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Protocol

from arena.errors import InputError
from policies.training import reinforce_settings, settings
from policies.training.budget import Budget
from policies.training.folder import RunFolder
from policies.training.parallel import Processes
from policies.training.record import Tell
from policies.training.reinforce_settings import ReinforceSettings
from policies.training.settings import Settings

PPO, REINFORCE = "ppo", "reinforce"
DEFAULT_SAMPLES, DEFAULT_EPISODES = 3_000_000, 20_000


class Trainable(Protocol):
    """A run."""

    def train(self, should_stop: Callable[[], bool]) -> bool:
        """Go on until the budget is used up, or `should_stop` says so; return whether the budget is used up."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """All that a run is told."""

    method: str
    start: str
    """`clone:FIGHTER`, a checkpoint's file, or nothing."""
    budget: Budget
    settings: Settings | ReinforceSettings

    def to_dict(self) -> dict[str, Any]:
        """Return the order as JSON has it."""
        return asdict(self)

    def for_stage(self, rules: str, start: str) -> "Order":
        """Return the same order for a stage of a curriculum."""
        return replace(self, settings=replace(self.settings, rules=rules), start=start)

    def with_budget(self, budget: Budget) -> "Order":
        """Return the order with another budget, unless that is left open."""
        return self if budget == Budget() else replace(self, budget=checked(self.method, budget))


def checked(method: str, budget: Budget) -> Budget:
    """Return a budget that the method can use up.

    Raises
    ------
    InputError
        It cannot.
    """
    if method == PPO and budget.episodes is not None:
        raise InputError("--episodes is for the method reinforce; give ppo --samples or --minutes")
    return budget


def read_order(told: dict[str, Any]) -> Order:
    """Return the order that a run's folder keeps."""
    method = told.get("method", PPO)
    read = reinforce_settings.from_dict if method == REINFORCE else settings.from_dict
    return Order(method=method, start=told["start"], budget=Budget(**told["budget"]), settings=read(told["settings"]))


def make_order(method: str, start: str, budget: Budget, *, rules: str | None, seed: int, assignments: Sequence[str]) -> Order:
    """Return an order as somebody gives it; what is left open is as the method has it.

    Raises
    ------
    InputError
        The method does not take what was said.
    """
    if method == REINFORCE:
        if start.startswith("clone:"):
            raise InputError("--start clone: is for the method ppo; reinforce begins with nothing, or from a checkpoint's file")
        chosen = ReinforceSettings(rules=rules or "exp1", seed=seed).with_(assignments)
        return Order(method=method, start=start, budget=Budget(episodes=DEFAULT_EPISODES), settings=chosen).with_budget(budget)
    usual = Settings(rules=rules or "paper", seed=seed).with_(assignments)
    return Order(method=method, start=start, budget=Budget(samples=DEFAULT_SAMPLES), settings=usual).with_budget(budget)


def make_run(order: Order, folder: RunFolder, processes: Processes, tell: Tell, device: str) -> Trainable:
    """Return the run of an order, in one of perhaps several processes."""
    if isinstance(order.settings, ReinforceSettings):
        from policies.training.reinforce_run import ReinforceRun

        return ReinforceRun(folder, order.settings, order.start, order.budget, processes, tell, device)
    if device != "cpu":
        raise InputError(f"--device {device} is for the method reinforce; ppo trains on the CPU")
    from policies.training.run import Run

    return Run(folder, order.settings, order.start, order.budget, processes, tell)
