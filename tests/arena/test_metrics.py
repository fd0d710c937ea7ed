"""Metrics as a monitor meets them: over HTTP, in Prometheus's format, read by Prometheus's own parser."""

import socket
import urllib.error
import urllib.request
from collections.abc import Sequence

import pytest
from prometheus_client.parser import text_string_to_metric_families

from arena.errors import InputError
from arena.metrics.definitions import METRICS, QUEUE, TICKS, TURN_SECONDS, Histogram, Reading
from arena.metrics.exposition import expose
from arena.metrics.server import serve_metrics
from arena.pit.monitor import PitMonitor


def parse(text: str) -> dict[str, float]:
    """Return every sample, by its name and labels."""
    return {
        sample.name + "".join(f",{key}={value}" for key, value in sample.labels.items()): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def ask(where: str, path: str) -> tuple[int, str]:
    try:
        with urllib.request.urlopen(f"http://{where}{path}", timeout=30) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def tell() -> Sequence[Reading]:
    turns = Histogram((0.1, 1.0))
    turns.add([0.05, 0.1, 0.5, 7.0])
    return [Reading(TICKS, 42), Reading(QUEUE, {"requests": 3, "clients": 4}), Reading(TURN_SECONDS, turns)]


def test_prometheus_reads_what_is_exposed_and_what_the_process_costs() -> None:
    samples = parse(expose(tell()).decode())

    assert samples["arena_ticks_total"] == 42
    assert samples["arena_queue_length,queue=clients"] == 4
    assert [samples[f"arena_turn_seconds_bucket,le={bound}"] for bound in ("0.1", "1.0", "+Inf")] == [2, 3, 4]
    assert samples["arena_turn_seconds_count"] == 4
    assert samples["arena_turn_seconds_sum"] == pytest.approx(7.65)
    assert samples["process_open_fds"] > 0
    assert samples["process_resident_memory_bytes"] > 1e6


def test_every_metric_has_a_name_of_its_own_that_begins_alike() -> None:
    names = [metric.name for metric in METRICS]

    assert len(set(names)) == len(names) > 10
    assert all(name.startswith("arena_") for name in names)


def test_a_monitor_is_answered_over_http() -> None:
    with serve_metrics("127.0.0.1:0", tell) as where:
        assert ask(where, "/healthz") == (200, "well\n")
        status, text = ask(where, "/metrics")
        assert (status, parse(text)["arena_ticks_total"]) == (200, 42)
        assert ask(where, "/keys") == (404, "there are /healthz and /metrics\n")

    with pytest.raises(OSError, match="refused"):
        ask(where, "/healthz")


def test_a_process_that_is_not_well_says_why() -> None:
    monitor = PitMonitor(patience_s=0.01)  # no referee answers it

    with serve_metrics("127.0.0.1:0", monitor.read) as where:
        for path in ("/healthz", "/metrics"):
            assert ask(where, path) == (503, "the referee did not answer for 0.01 s: it is not open yet, or it hangs\n")


def test_one_that_leaves_in_the_middle_of_its_request_keeps_nobody_out() -> None:
    with serve_metrics("127.0.0.1:0", tell) as where:
        host, _, port = where.partition(":")
        with socket.create_connection((host, int(port))) as hasty:
            hasty.send(b"GET /met")
        assert ask(where, "/healthz")[0] == 200


@pytest.mark.parametrize(
    ("listen", "says"),
    [
        ("9100", "--metrics is '9100'; it must be HOST:PORT, as in 127.0.0.1:9100"),
        ("127.0.0.1:http", "it must be HOST:PORT"),
        ("127.0.0.1:70000", "--metrics cannot listen at 127.0.0.1:70000: .*; choose another address or port"),
        ("192.0.2.1:9100", "--metrics cannot listen at 192.0.2.1:9100: Cannot assign"),
    ],
)
def test_where_nobody_can_listen_is_said_in_a_sentence(listen: str, says: str) -> None:
    with pytest.raises(InputError, match=says), serve_metrics(listen, lambda: ()):
        pass
