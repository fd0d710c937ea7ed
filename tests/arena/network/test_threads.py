"""Which threads Zenoh has, by the processes that have them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from arena.network.threads import chosen_threads

LOOK = """
import sys
from pathlib import Path
from queue import SimpleQueue

from arena.network.address import free_port
from arena.network.session import open_client, open_router, read_payload

endpoint, heard = f"tcp/127.0.0.1:{free_port()}", SimpleQueue()
workers = f"unixsock-stream/{sys.argv[1]}/workers" if len(sys.argv) > 1 else ""
with open_router(endpoint, "p", workers_endpoint=workers) as router, open_client(endpoint) as client:
    router.subscribe("arena/p/lane/1/blue/action", heard.put)
    put, _ = client.publisher("arena/p/lane/1/blue/action")
    put(b"orders")
    assert read_payload(heard.get(timeout=20)) == b"orders"
    print(*sorted({(task / "comm").read_text().partition("-")[0] for task in Path("/proc/self/task").iterdir()}))
"""
ALL = {"acc", "app", "net", "rx", "tx"}
where_proc_tells = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="threads are told by /proc")


def zenohs_threads(workers: Path | None = None, **environment: str) -> set[str]:
    """Return what the threads of a process with a router and a client are called; `workers` is the folder where those connect."""
    inherited = {name: value for name, value in os.environ.items() if name != "ZENOH_RUNTIME"}
    command = [sys.executable, "-c", LOOK, *([] if workers is None else [str(workers)])]
    said = subprocess.run(command, env=inherited | environment, capture_output=True, text=True, timeout=60, check=True).stdout
    return set(said.split()) & ALL


@where_proc_tells
def test_one_thread_of_zenohs_sends_and_one_does_all_else() -> None:
    assert zenohs_threads() == {"rx", "tx"}


@where_proc_tells
def test_whoever_starts_a_process_may_choose_its_threads() -> None:
    assert "net" in zenohs_threads(ZENOH_RUNTIME="(rx: (worker_threads: 2))")


@where_proc_tells
def test_a_router_with_workers_keeps_zenohs_own_choice(tmp_path: Path) -> None:
    assert zenohs_threads(tmp_path) == ALL


@pytest.mark.parametrize(("is_encrypted", "shares"), [(True, False), (False, True)])
def test_who_connects_by_tls_is_met_by_a_thread_of_its_own(
    monkeypatch: pytest.MonkeyPatch, is_encrypted: bool, shares: bool
) -> None:
    environment: dict[str, str] = {}
    monkeypatch.setattr(os, "environ", environment)

    with chosen_threads(is_encrypted=is_encrypted):
        assert ("acc: (handover: rx)" in environment["ZENOH_RUNTIME"]) is shares

    assert environment == {}, "a process that this one starts chooses for itself"
