"""The sub-command that makes fighters: `arena train`."""

import os
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from arena.console import complete_ruleset
from arena.errors import InputError

if TYPE_CHECKING:
    from policies.training.folder import RunFolder
    from policies.training.run import Budget
    from policies.training.settings import Settings

METHODS = ("ppo",)


def train(
    method: Annotated[str, typer.Option(help=f"One of {', '.join(METHODS)}.")] = "ppo",
    start: Annotated[
        str,
        typer.Option(metavar="clone:FIGHTER|FILE", help="Begin as a copy of a script, or from a checkpoint; else from nothing."),
    ] = "",
    out: Annotated[Path, typer.Option(metavar="DIR", help="The run's folder.")] = Path("arena-data/run"),
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out.")] = False,
    samples: Annotated[
        int | None, typer.Option(min=1, help="Stop after so many ticks of one seat; 3,000,000 by default.")
    ] = None,
    minutes: Annotated[float | None, typer.Option(min=0.01, help="Stop after so much training, over all sittings.")] = None,
    rules: Annotated[str, typer.Option(autocompletion=complete_ruleset, help="The ruleset to train on.")] = "paper",
    seed: Annotated[int, typer.Option(min=0, help="Of the weights, the maps and the matches.")] = 1,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a setting, as in --set games=64; may be repeated."),
    ] = None,
) -> None:
    """Train a fighter. Stopped at any moment, it goes on with --resume; under torchrun, all processes train one."""
    if method not in METHODS:
        raise InputError(f"--method is {method!r}; it must be one of {', '.join(METHODS)}")
    # Kept memory is cheaper than fresh memory: without this, every large tensor is mapped, and faulted in, anew.
    if "MALLOC_TRIM_THRESHOLD_" not in os.environ:
        os.environ |= {"MALLOC_MMAP_THRESHOLD_": "1073741824", "MALLOC_TRIM_THRESHOLD_": "1073741824"}
        _run_again()
    from policies.learned import hold_threads
    from policies.training.folder import LAST, RunFolder
    from policies.training.parallel import join_processes, leave_processes
    from policies.training.run import Run

    hold_threads()
    processes = join_processes()
    folder = RunFolder(out)
    if processes.is_first and not resume:
        chosen, budget = _read(rules, seed, settings or [], samples, minutes)
        folder.create(_told(chosen, start, budget))
    processes.share_first(None)
    chosen, start, budget = _recall(folder, resume, samples, minutes)
    stops: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda caught, _: stops.append(caught))
    run = Run(folder, chosen, start, budget, processes, lambda line: typer.echo(line, err=True) if processes.is_first else None)
    is_done = run.train(lambda: bool(stops))
    leave_processes()
    if processes.is_first:
        typer.echo(
            f"trained {run.counts.cloned + run.counts.samples:,} samples in {run.counts.seconds / 60:.1f} min: {out / LAST}"
        )
        if not is_done:
            typer.echo(f"stopped early; go on with: arena train --resume --out {out}")


def _run_again() -> None:
    """Start this command anew, since the allocator reads its settings once, at the start of a process."""
    import sys

    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def _read(rules: str, seed: int, assignments: list[str], samples: int | None, minutes: float | None) -> "tuple[Settings, Budget]":
    from policies.training.run import Budget
    from policies.training.settings import Settings

    if samples is None and minutes is None:
        samples = 3_000_000
    chosen = Settings(rules=rules, seed=seed).with_(assignments)
    return chosen, Budget(samples=samples, minutes=minutes)


def _told(chosen: "Settings", start: str, budget: "Budget") -> dict[str, object]:
    from dataclasses import asdict

    return {"start": start, "budget": asdict(budget), "settings": asdict(chosen)}


def _recall(folder: "RunFolder", is_resumed: bool, samples: int | None, minutes: float | None) -> "tuple[Settings, str, Budget]":
    """Return what the run in a folder was told; a budget that is given anew counts."""
    from policies.training.run import Budget
    from policies.training.settings import from_dict

    told = folder.read_settings()
    budget = Budget(**told["budget"])
    if is_resumed and (samples is not None or minutes is not None):
        budget = Budget(samples=samples, minutes=minutes)
    return from_dict(told["settings"]), told["start"], budget
