"""compose.yaml and what stands beside it: judged by schemas, and its own commands run as processes, with a real PostgreSQL."""

import json
import os
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import compose_spec
import pytest
import yaml
from commands import Command, nursery, quick_start
from pages import FILES
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import select
from typer.main import get_command

from arena.metrics.definitions import METRICS
from arena.records.journal import journal_name
from arena.records.journal_folder import load_journal
from arena.records.replay import verify
from tournaments.backup import back_up, restore
from tournaments.cli import app
from tournaments.ladder.ladder_store import LadderStore
from tournaments.store.schema import LADDER_MATCHES

start = quick_start
__all__ = ["nursery", "start"]  # fixtures
ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "docs" / "how-to" / "deploy"
VARIABLES = {"ARENA_DB_PASSWORD": "not a secret", "ARENA_HOST": "arena.test"}
PATIENCE_S = 60.0
_VARIABLE = re.compile(r"\$\{(\w+)(?::-([^}]*)|:\?([^}]*))\}")


def fill_in(text: str, variables: dict[str, str]) -> str:
    """Replace `${NAME:-default}` and `${NAME:?what to do}`, as compose does."""

    def value(found: re.Match[str]) -> str:
        name, default, demand = found.groups()
        assert demand is None or name in variables, f"{name}: {demand}"
        return variables.get(name, default)

    return _VARIABLE.sub(value, text)


PROJECT: dict[str, Any] = yaml.safe_load(fill_in((ROOT / "compose.yaml").read_text(encoding="utf-8"), VARIABLES))
SERVICES: dict[str, dict[str, Any]] = PROJECT["services"]
OURS = {name: service for name, service in SERVICES.items() if service["image"] == "arena"}


def named_volumes(service: dict[str, Any]) -> list[str]:
    """Return the volumes of a service that are written as NAME:PLACE."""
    return [volume for volume in service.get("volumes", ()) if isinstance(volume, str)]


# The files


def test_compose_yaml_keeps_to_the_specification() -> None:
    compose_spec.PyCompose.from_yaml(yaml.safe_dump(PROJECT)).validate()

    volumes = {volume.partition(":")[0] for service in SERVICES.values() for volume in named_volumes(service)}
    files = {volume for volume in volumes if volume.startswith("./")}
    assert volumes - files == PROJECT["volumes"].keys()
    assert all((ROOT / file).is_file() for file in files)
    assert {other for service in SERVICES.values() for other in service.get("depends_on", ())} <= SERVICES.keys()


def test_a_misspelt_key_would_be_found() -> None:
    spoilt = {"services": {"pit": {**SERVICES["pit"], "comand": []}}}

    with pytest.raises(ValueError, match="comand"):
        compose_spec.PyCompose.from_yaml(yaml.safe_dump(spoilt))


@pytest.mark.parametrize("name", sorted(OURS))
def test_its_commands_are_ones_that_the_arena_takes(name: str) -> None:
    command: Any = get_command(app)
    words = OURS[name]["command"]
    while hasattr(command, "get_command"):
        context = command.make_context("arena", [words[0], "--help"], resilient_parsing=True)
        command, words = command.get_command(context, words[0]), words[1:]
    command.make_context(name, list(words))


def test_every_part_is_watched_over_and_outlives_its_container() -> None:
    for name, service in OURS.items():
        is_fighter = service["command"][0] == "join"
        assert service["healthcheck"].get("disable", False) == is_fighter, "a fighter has nothing to ask"
        assert service["restart"] == "unless-stopped"
        assert [volume for volume in named_volumes(service) if volume.endswith(":/data")], name


def test_prometheus_asks_what_listens() -> None:
    jobs = yaml.safe_load((DEPLOY / "prometheus.yml").read_text())["scrape_configs"]
    targets = {target for job in jobs for part in job["static_configs"] for target in part["targets"]}
    listening = {
        f"{name}:{found[1]}"
        for name, service in OURS.items()
        for word in service["command"]
        if (found := re.match(r"--(?:metrics=0\.0\.0\.0:|port=)(\d+)", word))
    }

    assert targets == listening
    assert {job["job_name"] for job in jobs} == {target.partition(":")[0] for target in targets}


def test_the_board_shows_metrics_that_there_are() -> None:
    board = json.loads((DEPLOY / "grafana-board.json").read_text())
    asked = " ".join(target["expr"] for panel in board["panels"] for target in panel["targets"])
    named = set(re.findall(r"\b(?:arena|process)_\w+", asked))
    ends = {"counter": ("_total",), "histogram": ("_bucket",), "gauge": ("",)}

    assert {name for name in named if name.startswith("arena_")} <= {
        f"{metric.name}{end}" for metric in METRICS for end in ends[metric.kind]
    }
    assert named >= {"arena_turn_seconds_bucket", "arena_faults_total", "arena_queue_length", "arena_store_lag_seconds"}
    assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])


@pytest.mark.skipif(
    shutil.which("systemd-analyze") is None and os.environ.get("ARENA_REQUIRE_ALL") != "1", reason="systemd is not installed"
)
def test_the_unit_is_one_that_systemd_takes(tmp_path: Path) -> None:
    unit = tmp_path / "arena@.service"
    unit.write_text((DEPLOY / "arena@.service").read_text().replace("/opt/arena/bin/arena ", f"{sys.executable} "))

    done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, timeout=60, check=False)

    assert (done.returncode, done.stdout + done.stderr) == (0, "")


# The parts joined


class Composed:
    """The services of compose.yaml as processes of this machine, each with a folder for its volume."""

    def __init__(self, begin: Callable[..., Command], url: str, folder: Path) -> None:
        self._begin, self._folder, self.url = begin, folder, url
        self._ports: dict[tuple[str, str], int] = {}
        self.processes: dict[str, Command] = {}

    def place(self, service: str, port: str) -> str:
        """Return where a port of a service is, here."""
        key = (service, port)
        if key not in self._ports:
            self._ports[key] = find_port()
        return f"127.0.0.1:{self._ports[key]}"

    def volume(self, service: str) -> Path:
        """Return the folder that stands for the volume at /data."""
        [name] = [volume.partition(":")[0] for volume in named_volumes(SERVICES[service]) if volume.endswith(":/data")]
        return self._folder / name

    def localize(self, service: str, word: str) -> str:
        """Return a word of a service's command as it is here."""
        word = word.replace("database:5432/arena", self.url.partition("@")[2]).replace("/data", str(self.volume(service)))
        word = word.replace("/course/", f"{self._folder}/course/")
        word = re.sub(r"\b(?:0\.0\.0\.0|127\.0\.0\.1):(\d{4})\b", lambda found: self.place(service, found[1]), word)
        word = re.sub(r"--port=(\d+)", lambda found: f"--port={self.place(service, found[1]).partition(':')[2]}", word)
        return re.sub(r"\b(pit|season|web):(\d{4})\b", lambda found: self.place(found[1], found[2]), word)

    def up(self, service: str) -> Command:
        """Start a service, once those that it waits for are well."""
        for other in SERVICES[service].get("depends_on", ()):
            if other in OURS:
                self.wait_until_well(other)
        with pytest.MonkeyPatch.context() as patch:
            for name, value in {**SERVICES[service]["environment"], "ARENA_CONFIG": f"{self.volume(service)}/config"}.items():
                patch.setenv(name, value)
            words = [self.localize(service, word) for word in SERVICES[service]["command"]]
            self.processes[service] = self._begin(*words)
        return self.processes[service]

    def is_well(self, service: str) -> bool:
        """Run the health check of a service."""
        kind, program, *words = SERVICES[service]["healthcheck"]["test"]
        assert (kind, program) == ("CMD", "python")
        command = [sys.executable, *(self.localize(service, word) for word in words)]
        return subprocess.run(command, capture_output=True, timeout=PATIENCE_S, check=False).returncode == 0

    def wait_until_well(self, service: str) -> None:
        give_up_at = time.monotonic() + PATIENCE_S
        while not self.is_well(service):
            assert time.monotonic() < give_up_at, f"{service} is not well; it said:\n{self.processes[service].said}"

    def scrape(self, target: str) -> dict[str, float]:
        """Return the samples of a target of prometheus.yml."""
        with urllib.request.urlopen(f"http://{self.place(*target.split(':'))}/metrics", timeout=30) as answer:
            families = list(text_string_to_metric_families(answer.read().decode()))
        return {
            " ".join((sample.name, *sample.labels.values())): sample.value for family in families for sample in family.samples
        }


def find_port() -> int:
    """Return a port that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def composed(start: Callable[..., Command], cluster: Any, tmp_path: Path) -> Composed:
    return Composed(start, cluster.make_database(), tmp_path)


def test_the_parts_join_are_well_and_are_backed_up_while_they_play(
    composed: Composed, cluster: Any, tmp_path: Path, size: Callable[[int, int], int]
) -> None:
    (tmp_path / "course").mkdir()
    (tmp_path / "course" / "course.toml").write_text(composed.localize("season", FILES["course.toml"]))
    services = [name for name in OURS if name != "season" or size(0, 1)]  # tests/tournaments/test_course.py opens one
    for service in services:
        composed.up(service)
    for service in services:
        if not service.startswith("fighter"):
            composed.wait_until_well(service)
    pit = composed.processes["pit"].wait_for("pit/ladder/000001/")

    jobs = yaml.safe_load((DEPLOY / "prometheus.yml").read_text())["scrape_configs"]
    samples = {
        job["job_name"]: composed.scrape(job["static_configs"][0]["targets"][0]) for job in jobs if job["job_name"] in services
    }
    assert sum(value for name, value in samples["pit"].items() if name.startswith("arena_matches_ended_total")) >= 2
    assert samples["pit"]["arena_ticks_total"] > 0
    assert samples["web"]["arena_pit_reachable"] == 1
    if "season" in services:
        assert samples["season"]["arena_queue_length submissions"] == 0

    copied = back_up(tmp_path / "backup", composed.volume("pit"), composed.url)
    played = matches(composed.url)
    restored, database = tmp_path / "restored", cluster.make_database()
    assert restore(tmp_path / "backup", restored, database).n_files == copied.n_files
    kept = matches(database)
    assert len(kept) >= 2
    assert kept == played[: len(kept)]
    for identity in kept:
        verify(load_journal(restored / "journals" / journal_name(identity)))

    if not size(0, 1):
        return
    pit.kill()
    assert not composed.is_well("pit")
    pit = composed.up("pit").wait_for("pit/ladder/")
    composed.wait_until_well("pit")
    assert matches(composed.url)[: len(played)] == played, "what was played before is counted once"


def matches(url: str) -> list[str]:
    """Return the matches of a ladder, in the order in which they were counted."""
    with LadderStore(url, make=False) as store:
        query = select(LADDER_MATCHES.c.identity).order_by(LADDER_MATCHES.c.id)
        return store._do("read", lambda connection: list(connection.scalars(query)))
