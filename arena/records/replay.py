"""Play a journal again, tick by tick, and compare every state with the chain."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from arena.errors import ArenaError, BoardError
from arena.game.engine import BatchedGame
from arena.game.state import StateField
from arena.game.types import Team, Termination
from arena.policy import MatchResult
from arena.records.journal import CHAIN_BYTES, Journal, write_ending, write_start, write_tick

_FACTS = [int(fact) for fact in (StateField.ENDING, StateField.WINNER, StateField.SCORE, StateField.TICK)]
_RESULTS_KNOWN = 4096
"""Most matches end like one before."""


class BrokenChainError(ArenaError):
    """A journal does not say what its match was; `tick` is the first at which it differs, 0 for the start."""

    def __init__(self, tick: int, what: str) -> None:
        super().__init__(f"the journal does not verify: {what}")
        self.tick = tick


def match_result(games: BatchedGame, game: int) -> MatchResult:
    """Return how a finished game ended; `score` is blue's."""
    [result] = match_results(games, [game])
    return result


def match_results(games: BatchedGame, ended: Sequence[int]) -> list[MatchResult]:
    """Return how each of some finished games ended."""
    facts = games.state.field[np.asarray(ended, np.intp)[:, None], _FACTS]
    return [make_result(*values) for values in facts.tolist()]


@lru_cache(maxsize=_RESULTS_KNOWN)
def make_result(ending: int, winner: int, score: int, ticks: int) -> MatchResult:
    """Return a result from the numbers that the state of a game has for it; a `winner` of -1 is none."""
    return MatchResult(ending=Termination(ending), winner=None if winner < 0 else Team(winner), score=score, ticks=ticks)


def replay(journal: Journal) -> Iterator[BatchedGame]:
    """Yield the one game of a journal at its start and after every tick; the same object each time, moved on.

    Raises
    ------
    BrokenChainError
        A state differs from what the journal says, or the match does not end as it says.
    """
    games = BatchedGame(journal.header.ruleset, 1)
    try:
        games.start([0], [journal.header.keys])
    except BoardError as error:
        raise BrokenChainError(0, f"its header was changed: {error}") from error
    _, chain = write_start(journal.header, games.state.ground[0].tobytes(), games.digestible()[0].tobytes())
    if chain != journal.start_chain:
        raise BrokenChainError(0, "its header was changed, or its board")
    yield games
    for number, tick in enumerate(journal.ticks, start=1):
        if games.is_over[0]:
            raise BrokenChainError(number, f"the match was over after tick {number - 1}, and it goes on")
        games.step(np.frombuffer(tick.orders, np.int8)[None])
        _, chain = write_tick(chain, tick.orders, bytes(tick.marks), games.digestible()[0].tobytes())
        if chain != tick.chain:
            raise BrokenChainError(number, f"at tick {number} its orders or its state were changed")
        yield games
    _check_ending(journal, games, chain)


def _check_ending(journal: Journal, games: BatchedGame, chain: bytes) -> None:
    n_ticks = len(journal.ticks)
    if journal.ending is None:
        raise BrokenChainError(n_ticks, f"the match is unfinished: it stops after tick {n_ticks}, without an ending")
    is_ruled = journal.ending.ending in (Termination.FORFEIT, Termination.VOID) and not games.is_over[0]
    if not is_ruled and not games.is_over[0]:
        raise BrokenChainError(n_ticks, f"it claims an ending at tick {n_ticks}, and the match goes on there")
    result = replace(journal.ending, ticks=n_ticks) if is_ruled else match_result(games, 0)
    record = write_ending(chain, result)
    if journal.ending != result or journal.ending_chain != record[-CHAIN_BYTES:]:
        raise BrokenChainError(n_ticks, f"its ending was changed: the match ended by {result.ending.name.lower()}")


def verify(journal: Journal) -> int:
    """Play a whole journal again and return its ticks; raises as `replay` does."""
    return sum(1 for _ in replay(journal)) - 1
