"""Networks learn and act in bf16 where the processor is good at it, and nowhere else."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from small import FULL, SETTINGS, make_learner, make_seats
from torch import nn

from policies.networks import precision
from policies.networks.models import Trunk
from policies.training.budget import Budget
from policies.training.clone import Teacher, clone
from policies.training.folder import RunFolder
from policies.training.parallel import Processes
from policies.training.ppo_run import PpoRun
from policies.training.rollout import Actors, Results, collect

Numbers = set[tuple[bool, torch.dtype]]
"""In what a trunk computed: whether for gradients, and its numbers."""


@pytest.fixture(params=[torch.float32, torch.bfloat16], ids=["fp32", "bf16"])
def fast(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> torch.dtype:
    """What the processor is said to be good at."""
    kind: torch.dtype = request.param
    monkeypatch.setattr(precision, "has_fast_bf16", lambda: kind == torch.bfloat16)
    return kind


def watch(*networks: nn.Module) -> Numbers:
    """Return what will be filled with the numbers of every pass through these networks, and through their copies."""
    found: Numbers = set()

    def note(_module: nn.Module, _given: object, board: torch.Tensor) -> None:
        found.add((torch.is_grad_enabled(), board.dtype))

    for network in networks:
        for trunk in network.modules():
            if isinstance(trunk, Trunk):
                trunk.stem.register_forward_hook(_Shared(note))
    return found


class _Shared:
    """A function that a copy of a network shares with it."""

    def __init__(self, call: Callable[..., None]) -> None:
        self._call = call

    def __call__(self, *given: object) -> None:
        self._call(*given)

    def __deepcopy__(self, _memo: object) -> "_Shared":
        return self


def test_ppo_judges_and_learns_in_what_is_fast(fast: torch.dtype) -> None:
    seats, learner = make_seats(), make_learner()
    experience = collect(seats, learner.network.eval(), 6, Results())
    critic, network = watch(learner.critic), watch(learner.network)

    learner.learn(experience, seats.n_walkers, FULL, torch.Generator().manual_seed(0))

    assert critic == {(False, fast), (True, fast)}
    assert network == {(True, fast)}


def test_a_clone_acts_and_learns_in_what_is_fast(fast: torch.dtype) -> None:
    seats, learner = make_seats(), make_learner()
    network = watch(learner.network)

    clone(Actors([seats]), [Teacher("rush", seats)], learner, 0.5, np.random.default_rng(0), torch.Generator().manual_seed(0))

    assert network == {(False, fast), (True, fast)}


def test_a_run_of_ppo_acts_in_what_is_fast(tmp_path: Path, fast: torch.dtype) -> None:
    folder = RunFolder(tmp_path / "run")
    folder.create({})
    settings = replace(SETTINGS, opponents={"rush": 1.0})  # nobody plays a copy: few seats are quicker in fp32 everywhere
    run = PpoRun(folder, settings, "", Budget(samples=100), Processes(), lambda *_: None)
    network = watch(run.learner.network)

    run.train(lambda: False)

    assert network == {(False, fast), (True, fast)}
