"""What a benchmark says that a turn costs."""

import os
import subprocess
import sys
import time

from arena.network.address import free_port
from arena.network.session import open_router
from benchmarks.measuring.processor_time import children_of, spent_by


def test_the_time_of_a_process_is_its_own_and_that_of_zenoh_s_threads() -> None:
    before, begun_s = spent_by([os.getpid()]), time.process_time()

    with open_router(f"tcp/127.0.0.1:{free_port()}", "pit"):
        while time.process_time() - begun_s < 0.1:
            sum(range(1_000))
        spent = spent_by([os.getpid()]).since(before)

    assert spent.own_s > 0.05
    assert 0.0 < spent.zenoh_s < spent.total_s


def test_a_child_is_known_while_it_runs_and_has_spent_nothing_once_it_is_gone() -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        assert child.pid in children_of(os.getpid())
        child.communicate()

    assert child.pid not in children_of(os.getpid())
    assert spent_by([child.pid]).total_s == 0.0
