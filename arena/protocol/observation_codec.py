"""An observation as bytes of one length per ruleset: every field has a fixed width, so that a length tells nothing.

    seed uint64 | tick int32 | clock uint32, milliseconds, all bits set where none runs | own score int16 | own living,
    enemy living int16 | own cells int16 | enemy cells int16 | enemy types int8 | own alive uint8 | ground int8 per cell

Integers are little-endian, each at a multiple of its width, so that a reader's arrays are views of the bytes. Enemies out of
sight are -1 and -1, after those in sight.
"""

from struct import Struct
from typing import Any

import numpy as np

from arena.errors import UnreadableError
from arena.game.observation import NO_CLOCK_MS, Observations
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, HALVES, Code, Team

_CLOCK_AT, _CLOCK = 12, NO_CLOCK_MS.to_bytes(4, "little")
_CODES = bytes(code & 0xFF for code in (Code.HIDDEN, *HALVES, *FLAGS, Code.OBSTACLE))


def pack(observations: Observations, seat: int) -> bytes:
    """Return the bytes of one seat's observation; who writes many keeps a `Writer`."""
    return Writer(observations, seat).write()


def unpack(data: bytes, ruleset: Ruleset, team: Team) -> Observations:
    """Return the observation that `pack` wrote, as a batch of one; who reads many keeps a `Reader`.

    Raises
    ------
    UnreadableError
        The bytes are no observation under this ruleset.
    """
    return Reader(ruleset, team).read(data)


def timeless(data: bytes) -> bytes:
    """Return an observation's bytes as if no clock ran, which anybody can compute from the journal alone."""
    return data[:_CLOCK_AT] + _CLOCK + data[_CLOCK_AT + len(_CLOCK) :]


class Writer:
    """Writes the observations of one seat, which its venue lays out in the same memory at every tick."""

    def __init__(self, observations: Observations, seat: int) -> None:
        seen = observations.select(slice(seat, seat + 1))
        self._clock_ms = seen.clock_ms
        fields = (
            seen.seed, seen.tick, seen.clock_ms, seen.score, seen.living, seen.cell, seen.enemy_cell, seen.enemy_type, seen.alive,
            seen.ground[:, : seen.side**2],
        )  # fmt: skip
        self._fields = [field.data.cast("B") for field in fields if field.size]

    def set_clock(self, bank_s: float) -> None:
        """Say how much extra time the seat has left."""
        self._clock_ms[0] = min(max(int(bank_s * 1000), 0), NO_CLOCK_MS - 1)

    def write(self) -> bytes:
        """Return the bytes of what the seat sees now."""
        return b"".join(self._fields)


class Reader:
    """Reads the observations of one seat, each into the memory of the one before."""

    def __init__(self, ruleset: Ruleset, team: Team) -> None:
        n_own, n_enemy, self._n_cells = len(ruleset.team(team)), len(ruleset.team(team.other)), ruleset.side**2
        layout: dict[str, tuple[Any, tuple[int, ...]]] = {
            "seed": (np.uint64, (1,)),
            "tick": (np.int32, (1,)),
            "clock_ms": (np.uint32, (1,)),
            "score": (np.int16, (1,)),
            "living": (np.int16, (1, 2)),
            "cell": (np.int16, (1, n_own)),
            "enemy_cell": (np.int16, (1, n_enemy)),
            "enemy_type": (np.int8, (1, n_enemy)),
            "alive": (np.uint8, (1, n_own)),
            "ground": (np.int8, (1, self._n_cells)),
        }
        counts = [int(np.prod(shape)) * np.dtype(kind).itemsize for kind, shape in layout.values()]
        memory = np.zeros(sum(counts), np.uint8)
        parts = np.split(memory, np.cumsum(counts)[:-1])
        arrays = {name: part.view(kind).reshape(shape) for (name, (kind, shape)), part in zip(layout.items(), parts, strict=True)}
        flies = np.zeros((1, n_enemy), np.uint8)
        self._seen = Observations(team=team, side=ruleset.side, enemy_flies=flies, **arrays)
        self._memory, self._enemy_flies = memory.data, flies[0].data
        numbers = list(layout.values())[:-1]  # all but the ground
        self._head = Struct("".join(f"{np.prod(shape)}{np.dtype(kind).char}" for kind, shape in numbers))
        self._n_own, self._nobody, self._n_kinds = n_own, [-1] * n_enemy, len(ruleset.units)
        self._flies = [*(unit.flies for unit in ruleset.units), False]
        """By type; -1, which is no unit, finds the last, which does not fly."""

    def blank(self) -> Observations:
        """Return the memory as it is before anything was read: a board that shows nothing."""
        return self._seen

    def read(self, data: bytes) -> Observations:
        """Return what `pack` wrote, in memory that the next call overwrites; see `unpack`."""
        if len(data) != len(self._memory):
            raise UnreadableError(f"an observation has {len(self._memory)} bytes under these rules, not {len(data)}")
        if data[-self._n_cells :].translate(None, _CODES):
            raise UnreadableError("an observation has a cell that no game has")
        enemy_type = self._check(data)
        self._memory[:] = data
        self._enemy_flies[:] = bytes(map(self._flies.__getitem__, enemy_type))
        return self._seen

    def _check(self, data: bytes) -> list[int]:
        """Return the types of the enemies; refuse units where no unit can be, since fighters index boards by them."""
        _, tick, _, _, _, _, *units = self._head.unpack_from(data)
        n_own, n_enemy = self._n_own, len(self._nobody)
        cell, alive = units[:n_own], units[n_own + 2 * n_enemy :]
        enemy_cell, enemy_type = units[n_own : n_own + n_enemy], units[n_own + n_enemy : n_own + 2 * n_enemy]
        if (
            tick < 0
            or min(cell, default=0) < 0
            or max(cell, default=0) >= self._n_cells
            or max(alive, default=0) > 1
            or ((enemy_cell != self._nobody or enemy_type != self._nobody) and not self._can_be(enemy_cell, enemy_type))
        ):
            raise UnreadableError("an observation has a tick or a unit that no game has")
        return enemy_type

    def _can_be(self, cells: list[int], kinds: list[int]) -> bool:
        """Whether enemies have a type and a place on the board, or neither."""
        places = range(self._n_cells)
        return all(
            (at == kind == -1) or (at in places and 0 <= kind < self._n_kinds) for at, kind in zip(cells, kinds, strict=True)
        )
