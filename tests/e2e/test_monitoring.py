"""What a monitor is told by an open pit and by its web page, both of them real processes."""

import json
import signal
import socket
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from commands import Command
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import select

from tournaments.ladder.ladder_store import LadderStore
from tournaments.store.schema import LADDER_MATCHES


@pytest.fixture
def ports() -> list[int]:
    """Return three ports that were free a moment ago."""
    with ExitStack() as probes:
        found = [probes.enter_context(socket.socket()) for _ in range(3)]
        for probe in found:
            probe.bind(("127.0.0.1", 0))
        return [int(probe.getsockname()[1]) for probe in found]


def scrape(url: str) -> dict[str, float]:
    """Return the samples of a process, by their names and the values of their labels."""
    with urllib.request.urlopen(f"{url}/metrics", timeout=30) as answer:
        families = list(text_string_to_metric_families(answer.read().decode()))
    return {" ".join((sample.name, *sample.labels.values())): sample.value for family in families for sample in family.samples}


def ask(url: str, **headers: str) -> int:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=30) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def logged(process: Command) -> list[dict[str, Any]]:
    """Return what a process logged."""
    return [json.loads(line) for line in process.said.splitlines() if line.startswith("{")]


def test_a_monitor_learns_what_was_played_and_how_the_pit_its_page_and_a_client_are(
    serve: Callable[..., Command], join: Callable[..., Command], ports: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ARENA_LOG", "json")
    pit_url, web_url, client_url = (f"http://127.0.0.1:{port}" for port in ports)
    pit = serve(
        "--ladder", "--metrics", f"127.0.0.1:{ports[0]}", "--web", ports[1], "--web-host", "0.0.0.0", "--web-name", "arena.test"
    )
    before = scrape(pit_url)
    stays = ("--forever", "--metrics", f"127.0.0.1:{ports[2]}")
    ann, bob = (
        join("--policy", "rush", "--name", name, "--no-audit", "--no-transcripts", *more)
        for name, more in (("ann", ()), ("bob", stays))
    )
    assert ann.finish() == 0
    pit.wait_for("pit/ladder/000000/")
    bob.wait_for('"match ended"')

    after = scrape(pit_url)
    with LadderStore(str(tmp_path / "arena.db"), make=False) as store:
        row = store._do("read", lambda connection: connection.execute(select(LADDER_MATCHES)).one())
    assert before["arena_ticks_total"] == 0
    assert after["arena_ticks_total"] == row.ticks
    assert after[f"arena_matches_ended_total {row.ending}"] == 1
    assert after["arena_turn_seconds_count"] == 2 * row.ticks - after["arena_faults_total late"]
    assert after["arena_matches_running"] == after["arena_store_rows_waiting"] == 0
    assert after["arena_queue_length clients"] in (0, 1)  # bob, as soon as he asks again
    assert after["arena_store_seconds_count"] > before["arena_store_seconds_count"] > 0
    assert after["arena_store_failures_total"] == 0
    assert ask(f"{pit_url}/healthz") == 200

    played = scrape(client_url)
    assert played["arena_ticks_total"] == played["arena_think_seconds_count"] == row.ticks
    assert played[f"arena_matches_ended_total {row.ending}"] == played["arena_pit_reachable"] == 1
    assert ask(f"{client_url}/healthz") == 200
    (ended,) = (line for line in logged(pit) if line["event"] == "match ended")
    assert (ended["identity"], ended["ticks"]) == (row.identity, row.ticks)
    for process, events in ((pit, ("match begins", "match ended")), (bob, ("seat taken", "match ended"))):
        assert [line["event"] for line in logged(process) if line.get("match") == ended["match"]] == list(events)
    bob.send(signal.SIGTERM)
    assert bob.finish() == 0

    pit.wait_for(f"web page at http://arena.test:{ports[1]}/")
    assert scrape(web_url)["arena_pit_reachable"] in (0, 1)
    asked = {name: ask(f"{web_url}/metrics", Host=name) for name in ("arena.test", "localhost", "evil.test")}
    assert asked == {"arena.test": 200, "localhost": 200, "evil.test": 421}
    assert ask(f"{web_url}/healthz") == 200
    pit.send(signal.SIGTERM)
    assert pit.finish() == 0
