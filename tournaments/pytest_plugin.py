"""The test kit as fixtures of pytest, which finds this module by its entry point; a test that asks for none imports nothing."""

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

    from arena.game.observation import Observation
    from arena.testing import DrawnMatch
    from tournaments.testing import Score


@pytest.fixture(scope="session")
def play_pairs() -> "Callable[..., Score]":
    """Play a bot against any fighter: `tournaments.testing.play_pairs`."""
    from tournaments.testing import play_pairs

    return play_pairs


@pytest.fixture(scope="session")
def drawn_match() -> "type[DrawnMatch]":
    """Step a match on a drawn board by hand: `arena.testing.DrawnMatch`."""
    from arena.testing import DrawnMatch

    return DrawnMatch


@pytest.fixture(scope="session")
def observation_from_board() -> "Callable[..., Observation]":
    """Make what a team is shown on a drawn board: `arena.Observation.from_board`."""
    from arena import Observation

    return Observation.from_board


@pytest.fixture(scope="session")
def assert_never_slower_than() -> "Callable[..., float]":
    """Fail if a bot thinks too long in real matches: `arena.testing.assert_never_slower_than`."""
    from arena.testing import assert_never_slower_than

    return assert_never_slower_than
