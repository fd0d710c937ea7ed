"""Compiling what fighters need, before anybody waits for it.

A stranger's process imports this, one for each match of each seat: the compiler is imported where something is compiled.
"""

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from arena.policy import BatchFactory, BatchPolicy
from arena.protocol.observation_codec import ObservationReader
from policies.registry import CHECKPOINT, OWN, PLANNERS, REFERENCES, load, shipped, without_settings

if TYPE_CHECKING:
    from arena.compiling import Kernel

_FIRST_S = {"BelievingPolicy": 38.0, "UnitByUnit": 6.0, "Planner": 85.0}
"""What the first fighter of a family takes to compile; it compiles what they share."""
_NEXT_S = {"BelievingPolicy": 9.0, "UnitByUnit": 3.0, "Planner": 0.1}
_CALLS = {"Planner": "BelievingPolicy"}
"""Families that call what another shares: they are compiled after its first fighter, or compile that, too."""
_NETWORK_S = 25.0
_READS = {"champion": ("BelievingPolicy", "Planner")}
"""Families whose kernels a network calls; others call those of the first."""


def precompile(make: BatchFactory) -> None:
    """Compile, or load, what a fighter of ours needs by letting it act once; a stranger's bot is left alone."""
    if not _is_ours(make):
        return
    ruleset = load_rules("paper")
    blank = ObservationReader(ruleset, Team.BLUE).blank()
    policy = make(ruleset, Team.BLUE, 1)
    policy.start(np.zeros(1, np.intp))
    policy.act(blank, np.zeros(blank.cell.shape, np.int8))


def _is_ours(make: BatchFactory) -> bool:
    if isinstance(make, type):
        return issubclass(make, BatchPolicy) and make.__module__.startswith("policies.")
    return getattr(make, "is_ours", False)


def fighter_kernels(specs: Iterable[str]) -> "list[Kernel]":
    """Return the kernels of those fighters that are ours, scripts and networks; `policies.registry` knows them by these names.

    Those of a checkpoint are those of our own networks: a stranger's file is not read here.
    """
    from arena.compiling import Kernel

    kernels: list[Kernel] = []
    stages: dict[str, int] = {}  # of each family's first
    ours = (name for spec in map(without_settings, specs) for name in (shipped() if spec.endswith(CHECKPOINT) else (spec,)))
    for spec in sorted(dict.fromkeys(ours), key=lambda spec: (_is_network(spec), spec in PLANNERS)):
        if spec in OWN or spec in REFERENCES:
            family = _family_of(load(spec, cheats=True))
            called = _CALLS.get(family, "")
            if family in stages:
                stage, seconds = stages[family] + 1, _NEXT_S.get(family, 6.0)
            else:
                stage = stages[family] = stages.get(called, -1) + 1
                seconds = _FIRST_S.get(family, 6.0) + (0.0 if called in stages else _FIRST_S.get(called, 0.0))
            kernels.append(Kernel(name=spec, run=partial(_prepare, spec), seconds=seconds, stage=stage))
        elif _is_network(spec):
            read: tuple[str, ...] = _READS.get(spec, ("BelievingPolicy",))
            stage = max((stages[family] + 1 for family in read if family in stages), default=0)
            seconds = _NETWORK_S + sum(_FIRST_S[family] for family in read[1:] if family not in stages)
            kernels.append(Kernel(name=spec, run=partial(_prepare, spec), seconds=seconds, stage=stage))
    return kernels


def _family_of(fighter: BatchFactory) -> str:
    """Return the class whose kernels a fighter shares with others, by name."""
    bases = [base.__name__ for base in fighter.__mro__] if isinstance(fighter, type) else []
    return next((name for name in bases if name in _FIRST_S), bases[1] if bases else "")


def _is_network(spec: str) -> bool:
    return spec in shipped()


def _prepare(spec: str) -> None:
    precompile(load(spec, cheats=True))
