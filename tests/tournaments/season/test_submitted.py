"""The folder of what was submitted, where something goes wrong."""

import resource
from pathlib import Path

import pytest

from tournaments.season.submitted import SubmittedFolder


def test_a_disk_that_is_full_keeps_no_part_of_what_was_submitted(tmp_path: Path) -> None:
    folder = SubmittedFolder(tmp_path)

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            folder.keep("one", bytes(1_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)

    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
