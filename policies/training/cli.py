"""The sub-command that makes fighters: `arena train`."""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from arena.console import AsJson, complete_ruleset, print_json, print_table, say
from arena.errors import InputError

if TYPE_CHECKING:
    from policies.training.gather_settings import GatherSettings
    from policies.training.methods import RunConfig
    from policies.training.parallel import Processes
    from policies.training.sample_folder import SampleFolder

METHODS = ("ppo", "reinforce", "distil", "appraise")
_LINE_EVERY_S = 10.0

Matches = Annotated[int, typer.Option(min=1, help="How many matches the folder is to hold.")]
NProcesses = Annotated[int | None, typer.Option(min=1, help="As many as there are processors, by default.")]
Rules = Annotated[str, typer.Option(autocompletion=complete_ruleset, help="The ruleset.")]
MapSeed = Annotated[int, typer.Option(min=0, help="Of the maps and the matches.")]
Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a setting, as in --set opponents.rush=0.5; may be repeated."),
]

train = typer.Typer(invoke_without_command=True, pretty_exceptions_enable=False)


@train.callback()
def start_or_go_on(
    context: typer.Context,
    method: Annotated[str, typer.Option(help=f"One of {', '.join(METHODS)}; reinforce is the paper's.")] = "ppo",
    against: Annotated[str, typer.Option(metavar="FIGHTER", help="ppo: meet this one alone, for a best response to it.")] = "",
    data: Annotated[
        list[Path] | None,
        typer.Option(metavar="DIR", help="distil, appraise: what to learn from; may be repeated."),
    ] = None,
    start: Annotated[
        str,
        typer.Option(
            metavar="clone:FIGHTER|FILE",
            help="Begin as a copy of a script, or from a checkpoint or reflex; else from nothing.",
        ),
    ] = "",
    curriculum: Annotated[
        str, typer.Option(metavar="paper", help="Train stage after stage, each from the one before, in folders of --out.")
    ] = "",
    stage: Annotated[str, typer.Option(help="Of the curriculum, this stage alone.")] = "",
    out: Annotated[Path, typer.Option(metavar="DIR", help="The run's folder.")] = Path("arena-data/run"),
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out.")] = False,
    samples: Annotated[
        int | None, typer.Option(min=1, help="Stop after so many ticks of one seat; ppo: 3,000,000 by default.")
    ] = None,
    episodes: Annotated[int | None, typer.Option(min=1, help="Stop after so many matches; reinforce: 20,000 by default.")] = None,
    minutes: Annotated[float | None, typer.Option(min=0.01, help="Stop after so much training, over all sittings.")] = None,
    rules: Annotated[
        str | None, typer.Option(autocompletion=complete_ruleset, help="The ruleset; paper for ppo, exp1 for reinforce.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the weights, the maps and the matches.")] = 1,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a setting, as in --set games=64; may be repeated."),
    ] = None,
    device: Annotated[str, typer.Option(metavar="cpu|cuda", help="Where the network computes.")] = "cpu",
) -> None:
    """Train a fighter. Stopped at any moment, it goes on with --resume; under torchrun, all processes train one."""
    if context.invoked_subcommand is not None:
        return
    if method not in METHODS:
        raise InputError(f"--method is {method!r}; it must be one of {', '.join(METHODS)}")
    if device not in ("cpu", "cuda"):
        raise InputError(f"--device is {device!r}; it must be cpu or cuda")
    if (curriculum and (method != "reinforce" or rules or start)) or (stage and not curriculum):
        raise InputError(
            "--curriculum is for the method reinforce, chooses the rules and the start itself, and only it has a --stage"
        )
    from arena.extras import needs
    from policies.training.allocator import KEEP

    if not os.environ.keys() >= KEEP.keys():
        # The allocator reads its settings once, at the start of a process.
        os.environ |= KEEP | {name: os.environ[name] for name in KEEP if name in os.environ}
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    with needs("train", "arena train"):
        from arena.compiling import Kernel, compile_kernels, game_kernels
        from arena.game.ruleset import load
        from policies.networks.features import prepare_encoder
        from policies.networks.learned import limit_threads
        from policies.training.budget import Budget
        from policies.training.curriculum import has_ended, stages_of, start_of
        from policies.training.folder import LAST, SETTINGS, RunFolder
        from policies.training.methods import make_config, read_config
        from policies.training.parallel import join_processes, leave_processes

    budget = Budget(samples=samples, episodes=episodes, minutes=minutes)
    folders = {name: out / name for name in stages_of(curriculum, stage)} if curriculum else {"": out}
    if resume:
        config = read_config(RunFolder(next(iter(folders.values()))).read_settings()).with_budget(budget)
    else:
        folders_of_data = [str(path) for path in data or ()]
        config = make_config(
            method, start, budget, rules=rules, seed=seed, assignments=settings or (), data=folders_of_data, against=against
        )
    limit_threads()
    processes = join_processes(device)
    if processes.is_first:  # the kernels are the same for all rulesets; those of single fighters follow as they are met
        ruleset = load("paper")
        compile_kernels([*game_kernels(ruleset), Kernel(name="features", run=partial(prepare_encoder, ruleset), seconds=22)])
    processes.share_first(None)
    for name, folder in folders.items():
        if curriculum and resume and has_ended(folder):
            continue
        if resume and (folder / SETTINGS).exists():
            config = read_config(RunFolder(folder).read_settings()).with_budget(budget)
        else:
            RunFolder(folder).refuse_if_taken()
            processes.share_first(None)  # none makes the folder before all have looked
            config = config.for_stage(name, start_of(curriculum, name, out)) if curriculum else config
        if not _train(config, folder, processes, device):
            break
    else:
        if processes.is_first and curriculum:
            say(f"the curriculum has ended: {', '.join(str(folder / LAST) for folder in folders.values())}")
    leave_processes()


def _train(config: "RunConfig", out: Path, processes: "Processes", device: str) -> bool:
    """Train one run; return whether its budget is used up."""
    from policies.training.folder import LAST, SETTINGS, RunFolder
    from policies.training.methods import make_run

    folder = RunFolder(out)
    stops = _stop_on_signals()
    with ExitStack() as held:
        report = held.enter_context(_reporting(str(out), processes.is_first))
        is_new = not (out / SETTINGS).exists()
        if processes.is_first and not is_new:
            held.enter_context(folder.hold())
        run = make_run(config, folder, processes, report, device)
        if processes.is_first and is_new:  # only now: what cannot run leaves nothing behind
            folder.create(config.to_dict())
            held.enter_context(folder.hold())
        is_done = run.train(lambda: bool(stops))
    if processes.is_first:
        say(f"trained: {out / LAST}")
        if not is_done:
            say("stopped early; the same command with --resume goes on")
    return is_done


@train.command()
def demonstrate(
    out: Annotated[Path, typer.Option(metavar="DIR", help="The folder of demonstrations; it goes on with one that is there.")],
    teacher: Annotated[str, typer.Option(metavar="FIGHTER", help="Who says what to order.")] = "planner-fast",
    student: Annotated[
        str, typer.Option(metavar="FILE|NAME", help="A network that plays most of the matches; else the teacher plays all.")
    ] = "",
    matches: Matches = 1000,
    processes: NProcesses = None,
    rules: Rules = "paper",
    seed: MapSeed = 1,
    settings: Assignments = None,
) -> None:
    """Play matches to learn from with --method distil: a teacher says in every tick what it would order."""
    from arena.extras import needs

    with needs("train", "arena train demonstrate"):
        from policies.training.demonstrate import DemonstrationSettings
        from policies.training.demonstrate import demonstrate as play
        from policies.training.demonstrations import DemonstrationFolder

    chosen = DemonstrationSettings(teacher=teacher, student=student, rules=rules, seed=seed).with_(settings or ())
    _gather(DemonstrationFolder(out), chosen, matches, processes, play)


@train.command()
def try_plans(
    out: Annotated[Path, typer.Option(metavar="DIR", help="The folder of trials; it goes on with one that is there.")],
    student: Annotated[
        str,
        typer.Option(metavar="FILE|NAME", help="A network that values plans; else what did best in playouts is played."),
    ] = "",
    matches: Matches = 1000,
    processes: NProcesses = None,
    rules: Rules = "paper",
    seed: MapSeed = 1,
    settings: Assignments = None,
) -> None:
    """Play matches to learn from with --method appraise: in every tick, plans are tried in playouts."""
    from arena.extras import needs

    with needs("train", "arena train try-plans"):
        from policies.training.trials import TrialFolder
        from policies.training.try_plans import TrialSettings, try_in_matches

    chosen = TrialSettings(student=student, rules=rules, seed=seed).with_(settings or ())
    _gather(TrialFolder(out), chosen, matches, processes, try_in_matches)


def _gather(
    folder: "SampleFolder[Any]", settings: "GatherSettings", matches: int, processes: int | None, play: Callable[..., bool]
) -> None:
    """Add matches to a folder until it holds as many, or a signal comes."""
    stops = _stop_on_signals()
    with _reporting(str(folder.path), True) as report:
        n_processes = processes or len(os.sched_getaffinity(0))
        is_done = play(folder, settings, matches, n_processes, report, lambda: bool(stops))
    say(f"{folder.what}: {folder.path}")
    if not is_done:
        say("stopped early; the same command goes on")


@train.command()
def figures(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Folders of runs, or folders that hold some.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where figure4.svg to figure6.svg go.")] = Path("docs/figures"),
    as_json: AsJson = False,
) -> None:
    """Draw the paper's Figures 4 to 6 from the metrics of runs, with their spread over seeds."""
    from dataclasses import asdict

    from policies.training.figures import read_traces, write_figures

    rows = [asdict(one) for one in write_figures(read_traces(runs), out)]
    if as_json:
        print_json(rows)
    else:
        print_table([name.replace("_", " ") for name in rows[0]], [list(row.values()) for row in rows])


def _stop_on_signals() -> list[int]:
    """Return what Ctrl-C and a request to end will be added to, in place of what they do otherwise."""
    stops: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda caught, _: stops.append(caught))
    return stops


@contextmanager
def _reporting(what: str, is_first: bool) -> Iterator[Callable[[float, str], None]]:
    """Show on stderr how a run goes: a bar on a terminal, a plain line now and then elsewhere."""
    if not is_first:
        yield lambda progress, text: None
        return
    if not sys.stderr.isatty():
        reported_s = [time.monotonic()]

        def report(progress: float, text: str) -> None:
            if time.monotonic() - reported_s[0] >= _LINE_EVERY_S or progress >= 1:
                reported_s[0] = time.monotonic()
                say(f"{what}: {100 * progress:.0f}%, {text}", err=True)

        yield report
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda progress, text: bar.update(task, completed=progress, description=text)
