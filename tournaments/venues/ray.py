"""The venue `ray`: the tasks of `arena.local.venue` on a Ray cluster, where one machine is too small.

Every machine of the cluster has this arena installed, and needs no more but bubblewrap, where strangers play: files of fighters
are sent with what is in them, and journals come back as bytes, to be written here. RAY_ADDRESS names the cluster; without it, one
is started on this machine, for itself alone and as long as it is needed.
"""

import logging
import os
import platform
import signal
import socket
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from arena.errors import ArenaError, InputError
from arena.game.ruleset import Ruleset
from arena.game.types import RULES_VERSION
from arena.local.bare import BarePlan, strip
from arena.local.saving import MOST_FILES, make_journals_folder, save
from arena.local.venue import BareRecord, MatchRecord, dress, play_bare, split
from arena.records.plan import MatchPlan
from arena.sandbox.bubblewrap import why_no_limits, why_no_wall
from arena.sandbox.process import Sandbox
from policies.workers.load import load_walled
from tournaments.outcome import Outcome
from tournaments.venues.bundle import Bundle, pack
from tournaments.venues.local import patience_s, play_rest, walled
from tournaments.venues.setting import VenueSetting

TRIES = 4
"""Times that a task is begun: machines come and go, but a fighter that ends its process would do so for ever."""
_TASKS_PER_CORE = 2
"""One runs, and one waits for the core; results that nobody has fetched yet fill the memory of the cluster."""
_SEATS_PER_TASK = 4
"""Where fighters play behind walls: they think side by side, in processes of their own, on the core that a task has."""
_REACH_S = 5.0
_NOTICED_S = 10.0
"""For how long no task ends before the machines are counted."""
_EXAMINED_S = 60.0
"""For a machine to answer, which may have to start a process for it."""
_MOST_APART_S = 2.0
"""Of two machines' clocks, by which logs are read side by side, and challenges of pits expire."""
_LOOPBACK = "127.0.0.1"
logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """Why a machine of the cluster cannot play a task: no machine could, or this one is not set up for it."""

    sentence: str
    is_input: bool


@dataclass(frozen=True, slots=True)
class _Task:
    plans: list[MatchPlan]
    n_tries: int = 1


def play(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play on a Ray cluster what the venue `local` would play."""
    walls = Walls(sandboxes=walled(setting), patience_s=patience_s(setting.time_control))
    return play_rest(
        setting,
        plans,
        lambda left: play_on_cluster(setting.ruleset, left, setting.entries, journals=setting.journals, walls=walls),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Walls:
    """Who plays behind walls on the machines of the cluster."""

    sandboxes: Mapping[str, Sandbox]
    """By entry."""
    patience_s: float | None
    """See `tournaments.venues.local.patience_s`."""


NO_WALLS = Walls(sandboxes={}, patience_s=None)


def play_on_cluster(
    ruleset: Ruleset, plans: Sequence[MatchPlan], entries: Mapping[str, str], *, journals: Path, walls: Walls = NO_WALLS
) -> Iterator[MatchRecord]:
    """Play matches on the cluster and yield each once its journal is written here, in no promised order.

    Parameters
    ----------
    entries
        The fighter, by name or file, behind each entry.

    Raises
    ------
    InputError
        A file of a fighter, or RAY_ADDRESS, is of no use, or a journal cannot be written.
    ArenaError
        The cluster cannot be reached, a task failed again and again, or a machine cannot play any.
    """
    if not plans:
        return
    make_journals_folder(journals)
    bundle = pack(entries)
    by_identity = {plan.identity: plan for plan in plans}
    with session():
        for played in _work(ruleset, split(plans, _n_cores()), bundle, walls):
            yield from save(dress(played, by_identity), journals, bundled=len(plans) > MOST_FILES)


def _work(ruleset: Ruleset, tasks: list[list[MatchPlan]], bundle: Bundle, walls: Walls) -> Iterator[list[BareRecord]]:
    """Yield what each task returned; one that was lost with its machine or its process is begun anew.

    Ray's own retries are off: they would never give up a task that takes more memory than there is.
    """
    remote = ray.remote(max_retries=0, num_cpus=1)(play_task)
    rules, sent, behind = ray.put(ruleset), ray.put(bundle), ray.put(walls)  # once for all tasks
    waiting, running = deque(_Task(plans) for plans in tasks), dict[Any, _Task]()
    while waiting or running:
        while waiting and len(running) < _TASKS_PER_CORE * _n_cores():
            task = waiting.popleft()
            running[remote.remote(rules, strip(task.plans), sent, RULES_VERSION, behind)] = task
        done = _wait_for_one(list(running))
        task = running.pop(done)
        try:
            played = ray.get(done)
        except RayTaskError as error:
            raise _failure(error) from error
        except RayError as error:
            waiting.append(_again(task, error))
            continue
        if isinstance(played, Refusal):
            raise (InputError if played.is_input else ArenaError)(played.sentence)
        yield played


def _wait_for_one(running: list[Any]) -> Any:
    """Return one of the tasks that has ended; while no machine is left that could play, say so, and wait for the next."""
    is_told = False
    while not (done := ray.wait(running, timeout=_NOTICED_S)[0]):
        has_cores = "CPU" in ray.cluster_resources()  # type: ignore[no-untyped-call]
        if not has_cores and not is_told:
            logger.warning("no machine of the Ray cluster is left to play; the matches go on when one joins it")
        is_told = not has_cores
    return done[0]


def play_task(
    ruleset: Ruleset, plans: list[BarePlan], bundle: Bundle, rules_version: int, walls: Walls
) -> list[BareRecord] | Refusal:
    """Play a task on a machine of the cluster. Sentences come home as values: an error's class may be known only here."""
    if rules_version != RULES_VERSION:
        sentence = (
            f"machine {socket.gethostname()} of the cluster has rules version {RULES_VERSION}, this one has {rules_version}"
        )
        return Refusal(sentence=f"{sentence}; install the same arena on both", is_input=False)
    try:
        load = partial(load_walled, bundle.unpack(), walls.sandboxes, walls.patience_s, _SEATS_PER_TASK)
        return play_bare(ruleset, plans, load, None)
    except ArenaError as error:
        return Refusal(sentence=f"machine {socket.gethostname()} of the cluster: {error}", is_input=isinstance(error, InputError))


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """What has to be known of a machine, for it to play with others."""

    name: str
    arena: str
    rules_version: int
    python: str
    why_no_wall: str
    """Nothing where strangers' fighters can play."""
    clock_s: float
    """Since 1970."""


def describe_machine() -> Machine:
    """Return what this machine is."""
    return Machine(
        name=socket.gethostname(),
        arena=version("arena-pit"),
        rules_version=RULES_VERSION,
        python=platform.python_version(),
        why_no_wall=why_no_wall() or why_no_limits() or "",
        clock_s=time.time(),
    )


def examine_machines() -> list[tuple[str, bool, str]]:
    """Return for each machine of the cluster what it is called, whether it can play with this one, and what was found.

    Raises
    ------
    ArenaError
        The cluster cannot be reached.
    """
    here, found = describe_machine(), []
    with session():
        remote = ray.remote(max_retries=0, num_cpus=0)(describe_machine)
        nodes = [node for node in ray.nodes() if node["Alive"]]  # type: ignore[no-untyped-call]
        asked = [remote.options(scheduling_strategy=NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)) for node in nodes]
        for node, one in zip(nodes, asked, strict=True):
            cores = f"{node['Resources'].get('CPU', 0):.0f} cores"
            begun_s = time.time()
            try:
                there = ray.get(one.remote(), timeout=_EXAMINED_S)
            except RayError as error:
                found.append((f"machine {node['NodeManagerHostname']}", False, " ".join(str(error).split()).partition(". ")[0]))
                continue
            wrong = _compare(here, there, begun_s, time.time())
            what = f"arena {there.arena}, Python {there.python}, {cores}"
            found.append((f"machine {there.name}", not wrong, "; ".join([what, *wrong])))
    return found


def _compare(here: Machine, there: Machine, begun_s: float, ended_s: float) -> list[str]:
    """Return why a machine, asked within these times by our clock, cannot play with this one."""
    wrong = []
    if (there.arena, there.rules_version) != (here.arena, here.rules_version):
        ours = f"arena {here.arena} with rules version {here.rules_version}"
        wrong.append(f"this machine has {ours}, that one rules version {there.rules_version}: install the same on both")
    if there.why_no_wall:
        wrong.append(f"no stranger's fighter can play there: {there.why_no_wall}")
    apart_s = max(begun_s - there.clock_s, there.clock_s - ended_s, 0.0)
    if apart_s > _MOST_APART_S:
        wrong.append(f"its clock is {apart_s:.0f} s off: keep it by NTP")
    return wrong


def _again(task: _Task, error: RayError) -> _Task:
    blue, red, n = task.plans[0].blue, task.plans[0].red, len(task.plans)
    why = " ".join(str(error).split()).partition(". ")[0]
    if task.n_tries == TRIES:
        raise ArenaError(
            f"{n} matches of {blue} against {red} were begun {TRIES} times and never ended: a fighter ends its process or takes "
            f"too much memory, or the cluster is failing; the last time: {why}"
        ) from error
    logger.warning("%d matches of %s against %s are begun again: %s", n, blue, red, why)
    return _Task(task.plans, task.n_tries + 1)


def _failure(error: RayTaskError) -> BaseException:
    """Return what to raise for a task that raised: trying again would not help."""
    if "ModuleNotFoundError" in str(error) and "failed to import" in str(error):  # all that Ray says of it is text
        return ArenaError(f"a machine of the cluster lacks what tasks need: {str(error).strip().splitlines()[-1]}")
    return error


def _n_cores() -> int:
    """Return how many there are by now; machines come and go."""
    return max(int(ray.cluster_resources().get("CPU", 0)), 1)  # type: ignore[no-untyped-call]


@contextmanager
def session() -> Iterator[None]:
    """Be part of the cluster that RAY_ADDRESS names, or of one of our own; within a session, of the same."""
    if ray.is_initialized():
        yield
        return
    address = os.environ.get("RAY_ADDRESS", "")
    own: dict[str, Any] = {"num_cpus": len(os.sched_getaffinity(0)), "include_dashboard": False, "_node_ip_address": _LOOPBACK}
    _check(address)
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # who plays here is nobody else's business
    handler = signal.getsignal(signal.SIGTERM)
    try:
        # What workers print stays in Ray's own logs, and so do the long reports of what was killed.
        ray.init(address or "local", **({} if address else own), log_to_driver=False, logging_level=logging.ERROR)
    except (OSError, RuntimeError, ValueError) as error:
        why = " ".join(str(error).split()).partition(". ")[0]
        raise ArenaError(f"cannot use the Ray cluster{f' at {address}' if address else ''}: {why}") from error
    try:
        if signal.getsignal(signal.SIGTERM) is not handler:  # Ray puts its own there, which would leave the league at once
            signal.signal(signal.SIGTERM, handler)
        yield
    finally:
        ray.shutdown()


def _check(address: str) -> None:
    """Say at once what Ray would say after a minute, in many lines."""
    host, _, port = address.rpartition(":")
    if address in ("", "auto", "local"):
        return
    if "//" in address or not host or not port.isdecimal():
        way_out = "let this machine join the cluster (ray start --address HOST:PORT), and name HOST:PORT or auto"
        raise InputError(f"RAY_ADDRESS is {address!r}; {way_out}")
    try:
        socket.create_connection((host, int(port)), _REACH_S).close()
    except (OSError, OverflowError) as error:
        raise ArenaError(f"no Ray cluster answers at RAY_ADDRESS {address}: {error}") from error
