"""PPO where the network computes on a device of its own, and several threads play for it."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small import PAPER, SETTINGS, SMALL, make_seats

from arena.errors import InputError
from policies.networks.checkpoint import load_checkpoint
from policies.networks.models import TeamNetwork
from policies.training.budget import Budget
from policies.training.folder import LAST, RunFolder
from policies.training.parallel import Processes, join_processes
from policies.training.ppo_run import PpoRun
from policies.training.rollout import Actors, Results, collect


def train(path: Path, device: str, samples: int, **settings: int) -> PpoRun:
    folder = RunFolder(path)
    if not path.exists():
        folder.create({})
    chosen = replace(SETTINGS, **settings)  # type: ignore[arg-type]
    run = PpoRun(folder, chosen, "clone:rush", Budget(samples=samples), Processes(), lambda *_: None, device)
    run.train(lambda: False)
    return run


def test_several_threads_play_what_one_plays() -> None:
    """Who is met and what happens in a row does not depend on the thread that plays it."""
    settings, network = replace(SETTINGS, opponents={"patrol": 0.5, "rush": 0.5}), TeamNetwork(SMALL).eval()
    apart, whole = Results(), Results()
    actors = Actors([make_seats(settings, first_row=first, n_rows=n) for first, n in ((0, 3), (3, 3), (6, 2))])
    experience = actors.collect(network, 60, apart)
    other = collect(make_seats(settings), network, 60, whole)

    for name in ("planes", "truth", "scalars", "cell", "alive", "legal", "actions", "reward", "gain", "has_ended"):
        assert torch.equal(getattr(experience, name), getattr(other, name)), name
    assert torch.equal(experience.last[0], other.last[0])
    assert {name: sorted(points) for name, points in apart.points.items()} == {
        name: sorted(points) for name, points in whole.points.items()
    }


def test_a_run_with_several_threads_clones_improves_and_goes_on(tmp_path: Path) -> None:
    first = train(tmp_path / "run", "cpu", 200, actors=3)
    second = train(tmp_path / "run", "cpu", 400, actors=3)

    assert [len(actors.groups) for actors in second.actors.values()] == [3]
    assert sum(seats.env.n_games for seats in second.actors["paper"].groups) == SETTINGS.games
    assert second.counts.samples > first.counts.samples > 0
    assert load_checkpoint(tmp_path / "run" / LAST).manifest.ruleset_hash == PAPER.hash


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_gpu_that_is_not_there_is_refused_in_a_sentence() -> None:
    with pytest.raises(InputError, match="there is no GPU here that torch can use"):
        join_processes("cuda")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU here that torch can use")
def test_a_run_on_a_gpu_goes_on_on_the_cpu_and_back(tmp_path: Path) -> None:
    first = train(tmp_path / "run", "cuda", 200)
    assert next(first.learner.network.parameters()).is_cuda
    assert first.learner.precision is torch.bfloat16
    here = train(tmp_path / "run", "cpu", 400)
    back = train(tmp_path / "run", "cuda", 600)

    assert back.counts.samples > here.counts.samples > first.counts.samples > 0
    assert all(one.is_cuda for one in back.learner.average.values())
    assert load_checkpoint(tmp_path / "run" / LAST).manifest.ruleset_hash == PAPER.hash
