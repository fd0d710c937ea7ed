"""What a benchmark says that a turn costs."""

import os
import subprocess
import sys

import pytest

from arena.network.address import free_port
from benchmarks.measuring.processor_time import children_of, spent_by

_AT_WORK = """
import os, sys, time
from arena.network.session import open_client, open_router
from benchmarks.measuring.processor_time import spent_by
before, begun_s = spent_by([os.getpid()]), time.process_time()
with open_router(sys.argv[1], "pit"):
    while time.process_time() - begun_s < 0.1 or spent_by([os.getpid()]).since(before).zenoh_s <= 0.0:
        with open_client(sys.argv[1]):
            sum(range(100_000))
    spent = spent_by([os.getpid()]).since(before)
print(spent.own_s, spent.zenoh_s, spent.total_s)
"""


def test_the_time_of_a_process_is_its_own_and_that_of_zenoh_s_threads() -> None:
    told = subprocess.run(
        [sys.executable, "-c", _AT_WORK, f"tcp/127.0.0.1:{free_port()}"], capture_output=True, text=True, check=True, timeout=60
    )

    own_s, zenoh_s, total_s = map(float, told.stdout.split())
    assert own_s > 0.0
    assert 0.0 < zenoh_s < total_s
    assert own_s + zenoh_s == pytest.approx(total_s)


def test_a_child_is_known_while_it_runs_and_has_spent_nothing_once_it_is_gone() -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        assert child.pid in children_of(os.getpid())
        child.communicate()

    assert child.pid not in children_of(os.getpid())
    assert spent_by([child.pid]).total_s == 0.0
