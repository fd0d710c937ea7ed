"""The databases that the store is tested on: SQLite in a file, and a real PostgreSQL, in a cluster of our own.

PostgreSQL is Debian's package `postgresql`; its service may run or not, it is not used. Where the package is not installed, the
tests that need it are skipped, and fail where ARENA_REQUIRE_ALL=1 promises that nothing is skipped.
"""

import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NoReturn

import pytest

from arena.errors import ArenaError
from benchmarks.measuring.postgres import Cluster, open_cluster


def lack(what: str) -> NoReturn:
    """Skip a test that this machine cannot run, or fail it where every test must run."""
    if os.environ.get("ARENA_REQUIRE_ALL") == "1":
        pytest.fail(f"{what}, and ARENA_REQUIRE_ALL=1 allows no test to be skipped")
    pytest.skip(what)


@pytest.fixture(scope="session")
def lone_cluster() -> Iterator[Cluster]:
    """Start one cluster for all tests of this process; a test asks for `cluster`."""
    with ExitStack() as opened:
        try:
            cluster = opened.enter_context(open_cluster())
        except ArenaError as error:
            lack(str(error))
        yield cluster


@pytest.fixture
def cluster(lone_cluster: Cluster) -> Iterator[Cluster]:
    """Lend a PostgreSQL that runs, and may be killed."""
    yield lone_cluster
    lone_cluster.start()


@pytest.fixture(params=["sqlite", "postgresql"])
def store_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Return where a store can be made: once on each database."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'arena.db'}"
    url: str = request.getfixturevalue("cluster").make_database()
    return url
