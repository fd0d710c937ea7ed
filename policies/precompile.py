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
from policies.registry import CHECKPOINT, OWN, REFERENCES, load, shipped

if TYPE_CHECKING:
    from arena.compiling import Kernel

_FIRST_S = {"BelievingPolicy": 38.0, "UnitByUnit": 6.0}
"""What the first fighter of a family takes to compile; it compiles what they share."""
_NEXT_S = {"BelievingPolicy": 9.0, "UnitByUnit": 3.0}
_NETWORK_S = 25.0


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

    kernels, families = [], set()
    ours = (name for spec in specs for name in (shipped() if spec.endswith(CHECKPOINT) else (spec,)))
    for spec in sorted(dict.fromkeys(map(without_settings, ours)), key=_is_network):
        if spec in OWN or spec in REFERENCES:
            fighter = load(spec, cheats=True)
            family = fighter.__mro__[1].__name__ if isinstance(fighter, type) else ""
            seconds = (_NEXT_S if family in families else _FIRST_S).get(family, 6.0)
            kernels.append(Kernel(name=spec, run=partial(_prepare, spec), seconds=seconds, stage=int(family in families)))
            families.add(family)
        elif _is_network(spec):
            stage = int("BelievingPolicy" in families)  # whose belief it reads
            kernels.append(Kernel(name=spec, run=partial(_prepare, spec), seconds=_NETWORK_S, stage=stage))
    return kernels


def _is_network(spec: str) -> bool:
    return spec in shipped()


def _prepare(spec: str) -> None:
    precompile(load(spec, cheats=True))
