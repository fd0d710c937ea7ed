"""A season whose desk is open on a router, and authors who are connected to it."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from authors import SEASON, Author, Season

from arena.network.session import open_router
from arena.protocol.identity import Identity
from arena.sandbox.bubblewrap import why_no_wall
from tournaments.league.season import SeasonTerms
from tournaments.season.desk import Desk


@pytest.fixture
def open_season(tmp_path: Path) -> Iterator[Callable[..., Season]]:
    """Open the desk of a season under some terms."""
    with ExitStack() as parts:

        def make(*, invites: list[str] | None = None, **terms: Any) -> Season:
            season = Season(tmp_path, SeasonTerms(**{"most_kb": 200, **terms}), invites)
            parts.enter_context(season.store)
            session = parts.enter_context(open_router(season.address.endpoint, SEASON))
            parts.enter_context(Desk(session, SEASON, season.identity, season.owners))
            return season

        yield make


@pytest.fixture
def author() -> Iterator[Callable[..., Author]]:
    """Connect an author to a season."""
    with ExitStack() as sessions:

        def make(season: Season, name: str = "ann", identity: Identity | None = None) -> Author:
            one = Author(season, name, identity)
            sessions.enter_context(one.session)
            return one

        yield make


@pytest.fixture
def wall() -> None:
    """Skip where no wall can be built."""
    why = why_no_wall()
    if why is not None and not os.environ.get("ARENA_REQUIRE_ALL"):
        pytest.skip(why)
