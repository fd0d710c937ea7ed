"""The journals of many matches that are played at once, a row each: the bytes that `arena.records.journal` writes one by one."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from arena.game.ruleset import Ruleset
from arena.game.sha256 import hash_messages, pad_messages
from arena.game.types import Team
from arena.policy import MatchResult
from arena.records.journal import CHAIN_BYTES, pack_around, pack_header, write_ending, write_packed_start
from arena.records.plan import MatchPlan

_MOST_TICKS = 64
"""Of a match, in the memory that all rows share; earlier ones are put aside."""


class JournalBatch:
    """The canonical journals of the matches in the rows of a batch, as far as they were played."""

    def __init__(self, ruleset: Ruleset, n_rows: int, n_state_bytes: int) -> None:
        self._ruleset = ruleset
        n_orders = sum(len(ruleset.team(team)) for team in Team)
        marks = CHAIN_BYTES + 1 + n_orders
        states = marks + len(Team)
        linked = pad_messages(n_rows, states + n_state_bytes)
        linked[:, CHAIN_BYTES] = ord("T")
        self._linked = linked
        """What the next link is the hash of: the last one, the record of the tick, and the state after it."""
        self._chains, self._records = linked[:, :CHAIN_BYTES], linked[:, CHAIN_BYTES:states]
        self._orders, self._marks = linked[:, CHAIN_BYTES + 1 : marks], linked[:, marks:states]
        self._states = linked[:, states : states + n_state_bytes]
        self._ticks = np.zeros((n_rows, _MOST_TICKS, states), np.uint8)
        self._n_ticks = np.zeros(n_rows, np.intp)
        self._before: list[list[bytes]] = [[] for _ in range(n_rows)]
        """All of each journal that stands before `_ticks`."""

    def start(
        self, rows: Sequence[int], plans: Sequence[MatchPlan], grounds: NDArray[np.int8], states: NDArray[np.uint8]
    ) -> None:
        """Begin journals in some rows; `grounds` and `states` are of their drawn boards."""
        chains = []
        around = {names: pack_around(self._ruleset, *names) for names in {(plan.blue, plan.red) for plan in plans}}
        for row, plan, ground, state in zip(rows, plans, _split(grounds), _split(states), strict=True):
            header = pack_header(around[plan.blue, plan.red], plan.identity, plan.keys)
            data, chain = write_packed_start(header, ground, state)
            self._before[row] = [data]
            chains.append(chain)
        self._chains[rows] = np.frombuffer(b"".join(chains), np.uint8).reshape(-1, CHAIN_BYTES)
        self._n_ticks[rows] = 0

    def add_tick(
        self, rows: NDArray[np.intp], orders: NDArray[np.int8], marks: NDArray[np.uint8] | int, states: NDArray[np.uint8]
    ) -> None:
        """Add what was ordered in a tick, and the state after it, to the journals of `rows`; the arrays are of all rows."""
        self._orders[:] = orders.view(np.uint8)
        self._marks[:] = marks
        self._states[:] = states
        self._chains[:] = links = hash_messages(self._linked)
        n_ticks, n_record = self._n_ticks[rows], self._records.shape[1]
        self._ticks[rows, n_ticks, :n_record] = self._records[rows]
        self._ticks[rows, n_ticks, n_record:] = links[rows]
        self._n_ticks[rows] += 1
        full = rows[n_ticks + 1 == _MOST_TICKS]
        for row in full.tolist():
            self._before[row].append(self._ticks[row].tobytes())
        self._n_ticks[full] = 0

    def finish(self, rows: Sequence[int], results: Sequence[MatchResult]) -> Iterator[bytes]:
        """Yield the whole journals of matches that have ended."""
        chains, lengths = _split(self._chains[rows]), self._n_ticks[rows].tolist()
        for row, chain, n_ticks, result in zip(rows, chains, lengths, results, strict=True):
            yield b"".join((*self._before[row], self._ticks[row, :n_ticks].tobytes(), write_ending(chain, result)))


def _split(facts: NDArray[np.generic]) -> list[bytes]:
    """Return the bytes of each row."""
    data, n_bytes = facts.tobytes(), facts[0].nbytes
    return [data[at : at + n_bytes] for at in range(0, len(data), n_bytes)]
