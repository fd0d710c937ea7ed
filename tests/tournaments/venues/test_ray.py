"""The venue `ray`: a cluster of two nodes on this machine plays what the local venue plays, and survives one of them."""

import fcntl
import json
import logging
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from ray.cluster_utils import Cluster

import tournaments.venues.ray
from arena.errors import ArenaError, InputError
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load as load_rules
from arena.game.types import RULES_VERSION
from arena.jit import cache_root
from arena.local.bare import strip
from arena.match.time_control import TimeControl
from arena.records.plan import MatchPlan
from arena.sandbox.limits import BEHIND_A_WALL
from arena.sandbox.process import Sandbox
from arena.submission import PROGRAM, Submission
from policies.workers.files import fighter_in
from tournaments.fixture import plan_fixture
from tournaments.outcome import Outcome
from tournaments.venues.bundle import pack
from tournaments.venues.local import play as play_local
from tournaments.venues.open_venue import open_venue
from tournaments.venues.ray import NO_WALLS, Refusal, play_on_cluster, play_task
from tournaments.venues.ray import play as play_ray
from tournaments.venues.setting import VenueSetting

RULES = load_rules("paper").with_({"tick_limit": 20})
PATIENCE_S = 60.0
GOING_NORTH = "def act(observation):\n    return [1] * len(observation.units)\n"
SAYING_WHERE = """
import contextlib, fcntl, os, socket

class Bot:
    def start(self, info):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as said, open({gate!r}) as gate:
            said.setblocking(False)
            with contextlib.suppress(BlockingIOError):  # nobody listens any more
                said.sendto(str(os.getppid()).encode(), {ear!r})
            fcntl.flock(gate, fcntl.LOCK_SH)
        {then}

    def act(self, observation):
        return [observation.tick % 5] * len(observation.units)
"""
"""A bot that says which node its process belongs to, and begins once the gate is open."""
READING = b"""
import pathlib
orders = [int(order) for order in pathlib.Path("orders.txt").read_text().split()]
while True:
    if "observation" in input():
        print(orders, flush=True)
"""


@contextmanager
def two_nodes(folder: Path, head_cores: int = 1) -> Iterator[Cluster]:
    """Start two nodes, the second of one core, named by RAY_ADDRESS, with a cache of their own for what is sent to them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NUMBA_CACHE_DIR", str(cache_root()))
        patch.setenv("XDG_CACHE_HOME", str(folder))
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": head_cores, "include_dashboard": False})
        try:
            cluster.add_node(num_cpus=1)
            patch.setenv("RAY_ADDRESS", cluster.address)
            yield cluster
        finally:
            cluster.shutdown()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with two_nodes(tmp_path_factory.mktemp("cache")) as cluster:
        yield cluster


class Witness:
    """Hears where matches begin, and can hold them there."""

    def __init__(self, folder: Path) -> None:
        self._ear, self._gate = folder / "ear", folder / "gate"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(self._ear))
        self._gate.touch()
        self._file = self._gate.open()

    def bot(self, path: Path, then: str = "pass") -> str:
        path.write_text(SAYING_WHERE.format(ear=str(self._ear), gate=str(self._gate), then=then))
        return str(path)

    def wait_for(self, node: Any) -> None:
        """Wait until a match has begun on a node."""
        self._socket.settimeout(PATIENCE_S)
        raylets = {str(process.process.pid).encode() for process in node.all_processes["raylet"]}
        while self._socket.recv(64) not in raylets:
            pass

    def count(self) -> int:
        """Return how many matches have begun that were not heard of before."""
        self._socket.setblocking(False)
        n = 0
        while True:
            try:
                self._socket.recv(64)
            except BlockingIOError:
                return n
            n += 1

    def shut_gate(self) -> None:
        fcntl.flock(self._file, fcntl.LOCK_EX)

    def open_gate(self) -> None:
        fcntl.flock(self._file, fcntl.LOCK_UN)

    def close(self) -> None:
        self._file.close()
        self._socket.close()


@pytest.fixture
def witness(tmp_path: Path) -> Iterator[Witness]:
    witness = Witness(tmp_path)
    yield witness
    witness.close()


def setting_of(entries: dict[str, str], folder: Path, *walled: str) -> VenueSetting:
    places = {place: folder / place for place in ("journals", "keys", "homes")}
    sandboxes = dict.fromkeys(walled, Sandbox(has_wall=True, limits=BEHIND_A_WALL))
    return VenueSetting(
        ruleset=RULES, entries=entries, time_control=TimeControl(turn_time_s=None), slots=1, sandboxes=sandboxes, **places
    )


def plans_of(entries: dict[str, str], n_pairs: int = 3) -> list[MatchPlan]:
    names, secret = sorted(entries), secret_from_seed(5)
    return [
        plan
        for number, one in enumerate(names)
        for other in names[number + 1 :]
        for plan in plan_fixture("friday", one, other, n_pairs, secret)
    ]


def journals_in(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "journals").iterdir()}


def by_identity(outcomes: Iterator[Outcome]) -> dict[str, Outcome]:
    found: dict[str, Outcome] = {}
    for outcome in outcomes:
        assert outcome.identity not in found, "a match counts once"
        found[outcome.identity] = outcome
    return found


@pytest.mark.usefixtures("one_core")
def test_two_nodes_play_what_one_process_plays(cluster: Cluster, tmp_path: Path) -> None:
    (tmp_path / "north.py").write_text(GOING_NORTH)
    entries = {"rush": "rush", "random": "random", "north": str(tmp_path / "north.py")}

    alone = by_identity(play_local(setting_of(entries, tmp_path / "local"), plans_of(entries)))
    together = by_identity(play_ray(setting_of(entries, tmp_path / "ray"), plans_of(entries)))

    assert len(alone) == 18
    assert together == alone
    assert journals_in(tmp_path / "ray") == journals_in(tmp_path / "local")


def test_a_fighter_that_ends_its_process_is_not_tried_for_ever(
    cluster: Cluster, witness: Witness, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries = 2
    monkeypatch.setattr(tournaments.venues.ray, "TRIES", tries)
    entries = {"bad": witness.bot(tmp_path / "bad.py", then="os._exit(3)"), "random": "random"}
    plans = plans_of(entries)[:1]

    with pytest.raises(ArenaError, match=rf"1 matches of bad against random were begun {tries} times and never ended"):
        list(play_on_cluster(RULES, plans, entries, journals=tmp_path / "journals"))

    assert witness.count() == tries


def test_the_doctor_asks_every_machine_and_finds_what_keeps_one_from_playing(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tournaments.venues.ray, "RULES_VERSION", 99)
    amiss = tournaments.venues.ray.examine_machines()
    here = replace(tournaments.venues.ray.describe_machine(), why_no_wall="")
    off = replace(here, clock_s=here.clock_s - 60, why_no_wall="no bubblewrap")

    assert [(what, is_ok, finding.partition(", Python")[0]) for what, is_ok, finding in amiss] == [
        (f"machine {socket.gethostname()}", False, f"arena {version('arena-pit')}")
    ] * 2
    assert all("with rules version 99, that one rules version" in finding for _, _, finding in amiss)
    assert tournaments.venues.ray._compare(here, here, here.clock_s - 1, here.clock_s) == []
    assert tournaments.venues.ray._compare(here, off, here.clock_s, here.clock_s) == [
        "no stranger's fighter can play there: no bubblewrap",
        "its clock is 60 s off: keep it by NTP",
    ]


def test_a_bug_is_raised_at_once(cluster: Cluster, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(KeyError, match="random"):
        list(play_on_cluster(RULES, plans_of({"rush": "", "random": ""})[:1], {"rush": "rush"}, journals=tmp_path))

    assert "begun again" not in caplog.text


def test_a_machine_that_cannot_load_a_fighter_says_so_in_a_sentence(cluster: Cluster, tmp_path: Path) -> None:
    (tmp_path / "beside.py").touch()
    (tmp_path / "bad.py").write_text(f"import beside\n{GOING_NORTH}")
    entries = {"bad": str(tmp_path / "bad.py"), "random": "random"}

    with pytest.raises(InputError, match=r"^machine .* of the cluster: .*bad\.py, line 1: .*No module named 'beside'$"):
        list(play_on_cluster(RULES, plans_of(entries)[:1], entries, journals=tmp_path / "journals"))


def test_a_machine_that_does_not_know_a_fighter_says_so_in_a_sentence() -> None:
    entries = {"wolf": "wolf", "random": "random"}

    refusal = play_task(RULES, strip(plans_of(entries)), pack(entries), RULES_VERSION, NO_WALLS)

    assert isinstance(refusal, Refusal)
    assert refusal.is_input
    assert re.match(r"machine .* of the cluster: unknown policy 'wolf'", refusal.sentence)


def test_who_leaves_early_can_begin_again(cluster: Cluster, tmp_path: Path) -> None:
    entries = {"rush": "rush", "random": "random"}
    running = play_ray(setting_of(entries, tmp_path), plans_of(entries))
    first = next(running)
    running.close()  # type: ignore[attr-defined]

    rest = by_identity(play_ray(setting_of(entries, tmp_path), plans_of(entries)))

    assert first == rest[first.identity]
    assert len(rest) == 6


@pytest.mark.usefixtures("one_core")
def test_a_node_that_is_killed_loses_nothing_and_strangers_play_behind_walls_wherever_they_are_sent(
    cluster: Cluster, witness: Witness, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    submitted = Submission(kind=PROGRAM, main="python3 main.py", files={"main.py": READING, "orders.txt": b"1 2 1 4 0 3"})
    (tmp_path / "deep").mkdir()
    submitted.write(tmp_path / "deep")
    entries = {"rush": "rush", "here": witness.bot(tmp_path / "here.py"), "deep": fighter_in(tmp_path / "deep")}
    plans = plans_of(entries, 1)

    alone = by_identity(play_local(setting_of(entries, tmp_path / "local", "deep"), plans))
    witness.shut_gate()
    third = cluster.add_node(num_cpus=1)  # the others are left as they were
    cluster.wait_for_nodes()

    def kill() -> None:
        try:
            witness.wait_for(third)
            cluster.remove_node(third, allow_graceful=False)
        finally:
            witness.open_gate()

    with ThreadPoolExecutor(1) as beside, caplog.at_level(logging.WARNING, "tournaments.venues.ray"):
        killed = beside.submit(kill)
        with open_venue("ray", setting_of(entries, tmp_path / "ray", "deep")) as venue:
            venue.add({}, plans)
            received = []
            while venue.n_left:
                received += venue.receive()
        together = by_identity(iter(received))
        killed.result(PATIENCE_S)
    cluster.wait_for_nodes(PATIENCE_S)  # until the cluster knows that the third is gone: another test may come next

    assert "are begun again: Task failed because the node it was running on is dead" in caplog.text
    assert together == alone
    assert not any(seat.faults for outcome in received for seat in outcome.seats.values())
    assert journals_in(tmp_path / "ray") == journals_in(tmp_path / "local")


@pytest.mark.usefixtures("one_core")
def test_a_cluster_that_lost_all_its_machines_is_waited_for_and_that_is_said_once(
    witness: Witness, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tournaments.venues.ray, "_NOTICED_S", 0.2)
    entries = {"rush": "rush", "here": witness.bot(tmp_path / "here.py")}
    plans, said = plans_of(entries, 1), "no machine of the Ray cluster is left to play"
    witness.shut_gate()

    with two_nodes(tmp_path / "cache", head_cores=0) as cluster, ThreadPoolExecutor(1) as beside:
        [only] = cluster.worker_nodes
        playing = beside.submit(lambda: by_identity(play_ray(setting_of(entries, tmp_path), plans)))
        witness.wait_for(only)
        cluster.remove_node(only, allow_graceful=False)
        until_s = time.monotonic() + PATIENCE_S
        while said not in caplog.text and time.monotonic() < until_s:
            time.sleep(0.1)
        time.sleep(1)
        witness.open_gate()
        cluster.add_node(num_cpus=1)
        played = playing.result(2 * PATIENCE_S)

    assert len(played) == len(plans)
    assert caplog.text.count(said) == 1


def test_a_machine_with_other_rules_plays_nothing() -> None:
    parcel = pack({"rush": "rush", "random": "random"})

    refusal = play_task(RULES, strip(plans_of({"rush": "", "random": ""})), parcel, RULES_VERSION + 1, NO_WALLS)

    assert isinstance(refusal, Refusal)
    assert "install the same arena on both" in refusal.sentence


@pytest.mark.parametrize(
    ("address", "kind", "says"),
    [
        ("nonsense", InputError, "RAY_ADDRESS is 'nonsense'; let this machine join the cluster"),
        ("ray://127.0.0.1:10001", InputError, "let this machine join the cluster"),
        ("127.0.0.1:1", ArenaError, "no Ray cluster answers at RAY_ADDRESS 127.0.0.1:1: "),
    ],
)
def test_an_address_of_no_use_is_one_sentence(
    address: str, kind: type[ArenaError], says: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("RAY_ADDRESS", address)
    entries = {"rush": "rush", "random": "random"}

    with pytest.raises(kind, match=says) as raised:
        list(play_on_cluster(RULES, plans_of(entries), entries, journals=tmp_path))

    assert type(raised.value) is kind


LEAGUE = 'pairs = 1\nseed = 1\nvenue = "ray"\nentries = ["rush", "random"]\n[rules]\ntick_limit = 20'


def test_a_league_plays_on_a_cluster_of_its_own_and_stdout_is_the_document_s(
    arena: Callable[..., subprocess.CompletedProcess[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    (tmp_path / "friday.toml").write_text(LEAGUE)

    done = arena("tournament", "run", tmp_path / "friday.toml", "--data", tmp_path, "--json")

    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["matches"]["played"] == 2
    assert "ray" not in done.stderr.replace("(ray)", "").replace("venue ray", "").lower()


def test_without_ray_the_way_out_is_named(
    here: Callable[..., subprocess.CompletedProcess[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "friday.toml").write_text(LEAGUE)
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.delitem(sys.modules, "tournaments.venues.ray")

    done = here("tournament", "run", tmp_path / "friday.toml", "--data", tmp_path)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "arena: the venue ray needs ray, which is not installed here: pip install 'arena-pit[cluster]'\n"
