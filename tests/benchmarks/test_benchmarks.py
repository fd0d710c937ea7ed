"""Benchmarks: what they give, tried with sizes that measure nothing."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import benchmarks.local
import benchmarks.policies
from arena.errors import InputError
from arena.game.observation import Observations
from arena.local import venue as local
from arena.records.journal_folder import JournalFolder
from benchmarks import envs, kernel, planner, spectators
from benchmarks.measuring import rates as measure
from benchmarks.measuring import turns
from policies.heuristics.random import Random
from policies.registry import load, names
from policies.search.planner import PlannerFast
from tournaments.commands import bench

Run = Callable[..., subprocess.CompletedProcess[str]]
A_YARDSTICK = """
class Games:
    def __init__(self, n_games):
        self.n_games = n_games

    def step(self, orders, mode):
        assert orders.shape == (self.n_games, 12)
        assert mode == 5
"""


@pytest.fixture(autouse=True)
def _in_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ARENA_YARDSTICK", raising=False)
    for function, defaults in ((measure.rate, (0.001,)), (measure.threaded_rate, (0.001,)), (measure.median_rate, (1,))):
        monkeypatch.setattr(function, "__defaults__", defaults)
    monkeypatch.setattr(measure.paired_rates, "__defaults__", (2,))
    # A clock on which every look takes a millisecond: no rate is rounded to 0 because the machine was busy.
    clock = SimpleNamespace(perf_counter=partial(next, count(0, 0.001)), perf_counter_ns=partial(next, count(0, 1_000_000)))
    for module in (measure, benchmarks.local, turns):
        monkeypatch.setattr(module, "time", clock)
    for module in (kernel, benchmarks.policies, benchmarks.local):
        monkeypatch.setattr(module, "RUNS", 1)


def is_positive(value: object) -> bool:
    return all(map(is_positive, value.values())) if isinstance(value, dict) else isinstance(value, int | float) and value > 0


def test_the_kernel_s_headline_is_of_batch_64_and_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "BATCHES", (1, 64))
    said: list[str] = []

    results = kernel.run(said.append)

    assert list(results) == ["paper", "gym-cap"]
    for figures in results.values():
        assert set(figures) == {"ticks_per_s", "batch"}
        assert figures["ticks_per_s"] == figures["batch"]["64"]["one_thread"]
        assert {key: set(row) for key, row in figures["batch"].items()} == {
            size: {"one_thread", "two_threads", "two_over_one"} for size in ("1", "64")
        }
    assert is_positive(results)
    assert json.loads(json.dumps(results)) == results
    assert said[0] == "paper, batch 1"


def test_the_kernel_is_held_against_a_yardstick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "ctfkernel.py").write_text(A_YARDSTICK)
    monkeypatch.setenv("ARENA_YARDSTICK", str(tmp_path))
    monkeypatch.setattr(kernel, "BATCHES", (64,))
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "ctfkernel", raising=False)

    results = kernel.run(lambda _: None)

    assert all(set(figures["yardstick"]) == {"ours", "yardstick", "ratio"} for figures in results.values())
    monkeypatch.delitem(sys.modules, "ctfkernel")


def test_a_yardstick_that_is_not_there_is_said_before_anything_is_measured(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, arena: Run
) -> None:
    monkeypatch.setenv("ARENA_YARDSTICK", str(tmp_path))

    with pytest.raises(InputError, match=r"there is no ctfkernel.py"):
        kernel.run(pytest.fail)
    done = arena("bench", "kernel", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"arena: ARENA_YARDSTICK is {tmp_path}; there is no ctfkernel.py\n"


def test_every_fighter_is_measured_in_a_batch_that_suits_it_and_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmarks.policies, "_TICKS", 2)
    monkeypatch.setattr(benchmarks.policies, "_TICKS_ALONE", 3)
    fighters = [name for name in names() if name not in ("planner", "planner-deep")]  # planner-fast with more time
    monkeypatch.setattr(benchmarks.policies, "names", lambda: fighters)

    results = benchmarks.policies.run(lambda _: None, turn_time=60.0)  # enough for any machine

    assert list(results) == fighters
    for name, row in results.items():
        batch = min(getattr(load(name), "most_seats", 1024), 1024)
        assert tuple(row) == (f"batch_{batch}_ns", "batch_1_ns", "batch_1_p99_ns", "late")
        assert row.pop("late") == 0.0
    assert is_positive(results)


def test_playouts_are_held_against_the_rules_and_planners_are_timed_and_weighed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner, "PLANNERS", {"planner-fast": PlannerFast})
    for name, size in {"WORLDS": 3, "_TURNS": 3, "_FIRST_TURNS": 1}.items():
        monkeypatch.setattr(planner, name, size)

    results = planner.run(lambda _: None)

    assert {name: tuple(figures) for name, figures in results.items()} == {
        "playout": ("us", "rules_us", "over_rules", "per_s", "ticks"),
        "planner-fast": ("budget", "ms", "p99_ms", "memory_mb"),
    }
    assert is_positive(results)
    assert results["playout"]["ticks"] <= planner.HORIZON
    assert json.loads(json.dumps(results)) == results


@pytest.mark.parametrize(("turn_time", "late"), [(0.004, 0.5), (1.0, 0.0), (0.002, 0.0)])
def test_turns_that_take_longer_than_a_fighter_was_told_are_late(
    turn_time: float, late: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Dawdler(Random):
        """Takes five milliseconds for every other turn, unless it hears that there are no more than two."""

        dawdles = True

        def set_turn_time(self, seconds: float) -> None:
            self.dawdles = seconds > 0.002

        def act(self, observations: Observations, orders: np.ndarray) -> None:
            if self.dawdles and observations.tick[0] % 2:
                for _ in range(4):
                    turns.time.perf_counter_ns()

    monkeypatch.setattr(benchmarks.policies, "_TICKS", 2)
    monkeypatch.setattr(benchmarks.policies, "_TICKS_ALONE", 10)
    monkeypatch.setattr(benchmarks.policies, "names", lambda: ["dawdler"])
    monkeypatch.setattr(benchmarks.policies, "load", {"dawdler": Dawdler, "random": Random}.__getitem__)

    results = benchmarks.policies.run(lambda _: None, turn_time=turn_time)

    assert results["dawdler"]["late"] == late


def test_the_local_venue_is_measured_with_its_journals(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[int] = []

    def play(*arguments: Any, journals: Path) -> Any:
        yield from local.play(*arguments, journals=journals, n_workers=1)
        written.append(len(JournalFolder(journals).identities()))

    monkeypatch.setattr(benchmarks.local, "N_PAIRS", 20)
    monkeypatch.setattr(benchmarks.local, "_PAIRS_AT_START", 1)
    monkeypatch.setattr(benchmarks.local, "play", play)

    results = benchmarks.local.run(lambda _: None)

    assert list(results) == [
        *("ticks_per_s", "matches_per_s", "once_started", "ticks_per_core_s", "us_per_match"),
        *("kernel_ticks_per_core_s", "over_kernel", "start_s", "start_core_s", "cores", "ticks_per_match"),
    ]
    assert is_positive(results)
    assert written == [2, 40, 2, 40]


@pytest.mark.skipif(os.environ.get("ARENA_TEST_SIZE") != "full", reason="starts processes for half a minute; make test-full")
def test_spectators_through_a_relay_cost_the_pit_no_more_the_more_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spectators, "RUNS", 1)

    results = spectators.measure(lambda _: None, (1, 200))

    direct, relayed = results["at_the_pit"], results["through_a_relay"]
    assert [found["heard_by"] for way in (direct, relayed) for found in way.values()] == [1, 200] * 2
    assert direct["200"]["process_ms_a_turn"] > 1.5 * direct["1"]["process_ms_a_turn"]
    assert relayed["200"]["process_ms_a_turn"] < 1.5 * relayed["1"]["process_ms_a_turn"]
    assert results["stopped"]["late_turns"] == 0


def test_a_rate_is_work_over_time() -> None:
    assert measure.rate(lambda: 0) == 0
    assert measure.median_rate(lambda: 3, runs=3) > 0
    assert measure.threaded_rate([lambda: 1, lambda: 1]) > 0
    assert measure.threaded_rate([lambda: 1, lambda: 1], 0.0) > 0, "a thread that began late did nothing"
    one, other, ratio = measure.paired_rates(lambda: 2, lambda: 2)
    assert min(one, other, ratio) > 0


def test_bench_lists_what_can_be_measured(arena: Run) -> None:
    done = arena("bench", "--json")

    assert {"kernel", "policies", "local"} <= set(json.loads(done.stdout))
    assert done.returncode == 0


@pytest.mark.parametrize(("option", "untold"), [("minutes", 2.0), ("turn_time", 0.1)])
def test_an_option_is_told_to_those_who_take_it(
    option: str, untold: float, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def quick(progress: Any) -> dict[str, Any]:
        return {"ran": True}

    def long(progress: Any, minutes: float = 2.0) -> dict[str, Any]:
        return {"minutes": minutes}

    def late(progress: Any, turn_time: float = 0.1) -> dict[str, Any]:
        return {"turn_time": turn_time}

    one = long if option == "minutes" else late
    monkeypatch.setattr(bench, "_find", lambda: {"quick": lambda: quick, "one": lambda: one})

    for given, told in ((None, untold), (0.5, 0.5)):
        bench.bench([], run_all=True, as_json=True, **{option: given})  # type: ignore[arg-type]  # each is a float
        assert json.loads(capsys.readouterr().out) == {"one": {option: told}, "quick": {"ran": True}}
    with pytest.raises(InputError, match=rf"--{option.replace('_', '-')} is for benchmarks .*; quick do not"):
        bench.bench(["quick"], **{option: 1.0})  # type: ignore[arg-type]  # as above


def test_every_form_of_the_environments_has_its_rate() -> None:
    results = envs.run(lambda _: None)

    assert [name.removesuffix("_steps_per_s") for name in results] == ["single", "parallel_teams", "parallel_units", "vector_256"]
    assert is_positive(results)
