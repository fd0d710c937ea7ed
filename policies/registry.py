"""Every fighter by its name: our own, those of others through the entry points `arena.policies`, bot files and programs.

What a worker process is sent is the name; it loads the fighter itself.
"""

import ast
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from typing import Any

from arena.errors import PolicyError, UnknownNameError
from arena.policy import BatchFactory, BatchPolicy
from policies.bot_file import load_bot
from policies.each_seat import EachSeatFactory, WithoutMemory
from policies.program import PREFIX, load_program

GROUP = "arena.policies"
"""Entry points that name a `BatchPolicy`, a class with `act`, or a function `act(observation)`."""
OWN = {
    "random": "policies.heuristics.random:Random",
    "patrol": "policies.heuristics.patrol:Patrol",
    "defend": "policies.heuristics.defend:Defend",
    "roomba": "policies.heuristics.roomba:Roomba",
    "fighter": "policies.heuristics.fighter:Fighter",
    "rush": "policies.heuristics.rush:Rush",
    "spiral": "policies.heuristics.spiral:Spiral",
}
"""Our own fighters: module and class."""


def load(spec: str) -> BatchFactory:
    """Return the fighter that `spec` names: one of ours, one that is installed, a file that ends in .py, or exec:COMMAND.

    Raises
    ------
    UnknownNameError
        No fighter has that name.
    PolicyError
        The fighter cannot be loaded.
    """
    if spec.startswith(PREFIX):
        return EachSeatFactory(load_program(spec.removeprefix(PREFIX)))
    if spec.endswith(".py"):
        return EachSeatFactory(load_bot(spec))
    if spec in OWN:
        module, _, name = OWN[spec].partition(":")
        fighter: type[BatchPolicy] = getattr(import_module(module), name)
        return fighter
    if spec in _installed():
        return _factory(spec, _loaded(_installed()[spec]))
    raise UnknownNameError("policy", spec, names())


def load_entry(specs: Mapping[str, str], name: str) -> BatchFactory:
    """Return the fighter behind an entry's name; a function of the module, so that workers can be sent it."""
    return load(specs[name])


def names() -> list[str]:
    """Return the name of every fighter, our own first."""
    return [*OWN, *sorted(set(_installed()) - set(OWN))]


def plan(name: str) -> str:
    """Return what a fighter is up to, in a line; nothing is imported for it."""
    if name in OWN:
        package, _, module = OWN[name].partition(":")[0].rpartition(".")
        source = (files(package) / f"{module}.py").read_text(encoding="utf-8")
        return (ast.get_docstring(ast.parse(source)) or "").partition("\n")[0]
    if name in _installed():
        giver = _installed()[name].dist
        return f"from {giver.name} {giver.version}" if giver else f"from {_installed()[name].module}"
    raise UnknownNameError("policy", name, names())


@cache
def _installed() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except Exception as error:
        raise PolicyError(f"the policy {entry.name} ({entry.value}) cannot be loaded: {type(error).__name__}: {error}") from error


def _factory(name: str, fighter: Any) -> BatchFactory:
    if isinstance(fighter, type):
        if issubclass(fighter, BatchPolicy):
            return fighter
        if callable(getattr(fighter, "act", None)):
            return EachSeatFactory(fighter)
    elif callable(fighter):
        bot = WithoutMemory(fighter)
        return EachSeatFactory(lambda: bot)
    raise PolicyError(f"the policy {name} is neither a BatchPolicy, nor a class with act, nor a function act(observation)")
