"""What a monitor is told by an open pit and by its web page, both of them real processes."""

import signal
import socket
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest
from commands import Command
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import select

from tournaments.ladder.ladder_store import LadderStore
from tournaments.store.schema import LADDER_MATCHES


@pytest.fixture
def ports() -> list[int]:
    """Return two ports that were free a moment ago."""
    with ExitStack() as probes:
        found = [probes.enter_context(socket.socket()) for _ in range(2)]
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


def test_a_monitor_learns_what_was_played_and_how_the_pit_and_its_page_are(
    serve: Callable[..., Command], join: Callable[..., Command], ports: list[int], tmp_path: Path
) -> None:
    pit_url, web_url = (f"http://127.0.0.1:{port}" for port in ports)
    pit = serve(
        "--ladder", "--metrics", f"127.0.0.1:{ports[0]}", "--web", ports[1], "--web-host", "0.0.0.0", "--web-name", "arena.test"
    )
    before = scrape(pit_url)
    players = [join("--policy", "rush", "--name", name, "--no-audit", "--no-transcripts") for name in ("ann", "bob")]
    assert [player.finish() for player in players] == [0, 0]
    pit.wait_for("pit/ladder/000000/")

    after = scrape(pit_url)
    with LadderStore(str(tmp_path / "arena.db"), make=False) as store:
        row = store._do("read", lambda connection: connection.execute(select(LADDER_MATCHES)).one())
    assert before["arena_ticks_total"] == 0
    assert after["arena_ticks_total"] == row.ticks
    assert after[f"arena_matches_ended_total {row.ending}"] == 1
    assert after["arena_turn_seconds_count"] == 2 * row.ticks - after["arena_faults_total late"]
    assert after["arena_matches_running"] == after["arena_queue_length clients"] == after["arena_store_rows_waiting"] == 0
    assert ask(f"{pit_url}/healthz") == 200

    pit.wait_for(f"web page at http://arena.test:{ports[1]}/")
    assert scrape(web_url)["arena_pit_reachable"] in (0, 1)
    asked = {name: ask(f"{web_url}/metrics", Host=name) for name in ("arena.test", "localhost", "evil.test")}
    assert asked == {"arena.test": 200, "localhost": 200, "evil.test": 421}
    assert ask(f"{web_url}/healthz") == 200
    pit.send(signal.SIGTERM)
    assert pit.finish() == 0
