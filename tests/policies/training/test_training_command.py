"""`arena train` at a terminal, its benchmark, and that both methods learn where learning is easy."""

import csv
import os
import pty
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
import torch

from benchmarks import train as benchmark
from policies.training.budget import Budget
from policies.training.folder import METRICS, RunFolder
from policies.training.methods import RunConfig, make_run, read_config
from policies.training.parallel import Processes
from policies.training.ppo_settings import PpoSettings
from policies.training.reinforce_settings import ReinforceSettings

torch.set_num_threads(1)
FOUR_ROUNDS = ("--method", "reinforce", "--episodes", 8, "--set", "window=7", "--set", "batch=20", "--set", "update_every=2")


def test_a_terminal_is_shown_a_bar_with_the_win_rate_and_the_time_left(
    train: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    master, slave = pty.openpty()
    shown = bytearray()

    def read() -> None:
        with suppress(OSError):  # the last who wrote has gone
            while part := os.read(master, 65_536):
                shown.extend(part)

    reader = Thread(target=read)
    reader.start()
    with os.fdopen(slave, "w") as terminal, monkeypatch.context() as changed:
        changed.setattr(sys, "stderr", terminal)
        train(*FOUR_ROUNDS, "--out", tmp_path / "run")
    reader.join(120)
    os.close(master)
    text = shown.decode()

    for part in ("8 episodes", "win rate", "samples per s", "min left", "100%", "\u2501"):
        assert part in text


def test_the_benchmark_compares_the_loop_with_what_the_cores_multiply(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "1")  # more would only wait for each other here
    monkeypatch.setattr(benchmark, "has_fast_bf16", lambda: False)  # measured here, where it costs no process
    sizes = {"MATCHES": 1, "MULTIPLIED": 64, "BATCH": 60, "RUNS": 1, "GAMES": 8, "HORIZON": 2, "TRUNKS": ((8, 1),)}
    for name, small in sizes.items():
        monkeypatch.setattr(benchmark, name, small)
    said: list[str] = []
    found = benchmark.run(said.append)

    assert said == ["fp32_as_it_comes", "fp32", "ppo 8 x 1"]
    assert list(found) == ["threads", "fp32_as_it_comes", "fp32", "ppo_on_one_core"]
    for figures in (found["fp32_as_it_comes"], found["fp32"], benchmark.measure(True, 1, 64, 60, 1)):
        assert all(value > 0 for value in figures.values())
        assert figures["loop_network_share"] <= 1
    ppo = found["ppo_on_one_core"]["8 x 1"]
    assert all(value > 0 for value in ppo.values())
    assert ppo["acting"] + ppo["game"] + ppo["judging"] + ppo["learning"] == pytest.approx(1, abs=0.01)


def test_the_cost_of_a_view_is_that_of_table_5() -> None:
    counted = 0

    def count(module: torch.nn.Module, _: object, out: torch.Tensor) -> None:
        nonlocal counted
        weight = module.weight
        assert isinstance(weight, torch.Tensor)
        counted += 2 * weight.numel() * (out.shape[2] * out.shape[3] if out.dim() == 4 else 1)

    network = benchmark.PaperTeam()
    for module in network.modules():
        if isinstance(module, torch.nn.Conv2d | torch.nn.Linear):
            module.register_forward_hook(count)
    network(torch.zeros(1, 20, 20, dtype=torch.int8), torch.zeros(1, dtype=torch.int64))

    assert benchmark.flops_per_view() == counted


@pytest.mark.parametrize("settings", [PpoSettings(games=7), ReinforceSettings(reward="stream")])
def test_an_order_comes_back_from_the_folder_as_it_was_given(tmp_path: Path, settings: PpoSettings | ReinforceSettings) -> None:
    method = "ppo" if isinstance(settings, PpoSettings) else "reinforce"
    config = RunConfig(method=method, start="x.safetensors", budget=Budget(minutes=3.0), settings=settings)
    folder = RunFolder(tmp_path / "run")
    folder.create(config.to_dict())

    assert read_config(folder.read_settings()) == config


@pytest.fixture
def easy(tmp_path: Path) -> str:
    """The smallest task there is: one unit, nobody in its way, a flag in full sight."""
    file = tmp_path / "easy.toml"
    file.write_text('base = "exp1"\nside = 8\ntick_limit = 30\nobstacles = false\n\n[units.ugv]\nblue = 1\n')
    return str(file)


@pytest.mark.skipif(os.environ.get("ARENA_TEST_SIZE") != "full", reason="takes a minute; make test-full")
@pytest.mark.parametrize("method", ["ppo", "reinforce"])
def test_both_methods_learn_to_fetch_a_flag_that_nobody_guards(easy: str, tmp_path: Path, method: str) -> None:
    easy_paper = ReinforceSettings(
        rules=easy, window=16, rate=4e-4, update_every=32, batch=500, buffer=2_000, reward="differences", baseline="mean",
        normalise=True, discount_steps=False, importance=2.0, entropy=0.05,
    )  # fmt: skip
    easy_team = PpoSettings(
        rules=easy, channels=16, blocks=1, games=64, horizon=16, minibatch=256, critic_warmup=2, opponents={"random": 1.0}
    )
    settings = easy_paper if method == "reinforce" else easy_team
    folder = RunFolder(tmp_path / "run")
    config = RunConfig(method=method, start="", budget=Budget(samples=120_000), settings=settings)
    folder.create(config.to_dict())
    make_run(config, folder, Processes(), lambda *_: None, "cpu").train(lambda: False)
    with (folder.path / METRICS).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))[-10:]
    # Nobody can lose here: what is no capture is a draw.
    captures = [float(row["captures"]) if method == "reinforce" else 2 * float(row["score_nobody"]) - 1 for row in rows]

    assert np.mean(captures) > 0.9
