"""In processes of their own, since a limit that was lowered stays."""

import subprocess
import sys

import pytest

from arena.network.capacity import LEAST_FILES, MOST_SESSIONS

LIMITED = """
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, ({soft}, {hard}))
from arena.errors import InputError
from arena.network.capacity import find_capacity
try:
    print(find_capacity().sessions, *resource.getrlimit(resource.RLIMIT_NOFILE))
except InputError as error:
    print(error)
"""


def ask(soft: int, hard: int) -> str:
    code = LIMITED.format(soft=soft, hard=hard)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.parametrize("hard", [LEAST_FILES, 1_024, 4_096])
def test_the_limit_is_raised_and_sessions_leave_room_for_a_journal_for_every_four_files(hard: int) -> None:
    n_sessions, soft, _ = map(int, ask(LEAST_FILES // 2, hard).split())

    assert soft == hard
    assert 0 < n_sessions <= min(hard - min(hard // 4, 256), MOST_SESSIONS)


def test_a_limit_that_is_too_low_for_a_pit_is_refused() -> None:
    assert ask(100, LEAST_FILES - 1) == (
        f"a pit needs {LEAST_FILES} open files at least, and may have {LEAST_FILES - 1}; raise the limit: ulimit -n 1024"
    )
