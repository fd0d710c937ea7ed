"""An observation as bytes of one length per ruleset: every field has a fixed width, so that a length tells nothing.

    tick uint32 | clock uint32, milliseconds, all bits set where none runs | seed uint64 | own score int16 | own living,
    enemy living int16 | ground int8 per cell | own cells int16 | own alive uint8 | enemy cells int16 | enemy types int8

Integers are little-endian. Enemies out of sight are -1 and -1, after those in sight.
"""

import struct
from typing import NamedTuple

import numpy as np

from arena.errors import UnreadableError
from arena.game.ruleset import Ruleset
from arena.game.types import FLAGS, HALVES, Code, Team
from arena.observation import Observations

_HEAD = struct.Struct("<IIQhhh")
_NO_CLOCK = 0xFFFFFFFF
_MOST_TICKS = 0x7FFFFFFF
_CODES = bytes(code & 0xFF for code in (Code.HIDDEN, *HALVES, *FLAGS, Code.OBSTACLE))


class _Layout(NamedTuple):
    n_cells: int
    n_own: int
    n_enemy: int

    @property
    def n_bytes(self) -> int:
        return _HEAD.size + self.n_cells + 3 * self.n_own + 3 * self.n_enemy


def pack(observations: Observations, seat: int, clock_s: float | None, n_cells: int) -> bytes:
    """Return the bytes of one seat's observation."""
    clock = _NO_CLOCK if clock_s is None else min(max(int(clock_s * 1000), 0), _NO_CLOCK - 1)
    own, enemy = observations.living[seat].tolist()
    head = _HEAD.pack(
        int(observations.tick[seat]), clock, int(observations.seed[seat]), int(observations.score[seat]), own, enemy
    )
    return b"".join(
        (
            head,
            observations.ground[seat, :n_cells].tobytes(),
            observations.cell[seat].tobytes(),
            observations.alive[seat].tobytes(),
            observations.enemy_cell[seat].tobytes(),
            observations.enemy_type[seat].tobytes(),
        )
    )


def unpack(data: bytes, ruleset: Ruleset, team: Team) -> tuple[Observations, float | None]:
    """Return the observation that `pack` wrote, as a batch of one, and the clock; who reads many keeps a `Reader`.

    Raises
    ------
    UnreadableError
        The bytes are no observation under this ruleset.
    """
    return Reader(ruleset, team).read(data)


class Reader:
    """Reads the observations of one seat."""

    def __init__(self, ruleset: Ruleset, team: Team) -> None:
        self._team, self._side = team, ruleset.side
        self._layout = _Layout(ruleset.side**2, len(ruleset.team(team)), len(ruleset.team(team.other)))
        # Type -1, which is no unit, finds the last, which does not fly.
        self._flies = np.array([*(unit.flies for unit in ruleset.units), False], np.uint8)

    def read(self, data: bytes) -> tuple[Observations, float | None]:
        """Return what `pack` wrote; see `unpack`."""
        layout = self._layout
        if len(data) != layout.n_bytes:
            raise UnreadableError(f"an observation has {layout.n_bytes} bytes under these rules, not {len(data)}")
        tick, clock, seed, score, own, enemy = _HEAD.unpack_from(data)
        at = _HEAD.size
        if tick > _MOST_TICKS or data[at : at + layout.n_cells].translate(None, _CODES):
            raise UnreadableError("an observation has a tick or a cell that no game has")
        memory = bytearray(data)  # arrays that can be written to, as the local venue's: kernels are compiled for such
        ground = np.frombuffer(memory, np.int8, layout.n_cells, at)
        at += layout.n_cells
        cell = np.frombuffer(memory, "<i2", layout.n_own, at)
        at += 2 * layout.n_own
        alive = np.frombuffer(memory, np.uint8, layout.n_own, at)
        at += layout.n_own
        enemy_cell = np.frombuffer(memory, "<i2", layout.n_enemy, at)
        at += 2 * layout.n_enemy
        enemy_type = np.frombuffer(memory, np.int8, layout.n_enemy, at)
        self._check(cell.tolist(), alive.tolist(), enemy_cell.tolist(), enemy_type.tolist())
        seen = Observations(
            team=self._team,
            side=self._side,
            tick=np.array([tick], np.int32),
            ground=ground[None],
            cell=cell[None],
            alive=alive[None],
            enemy_cell=enemy_cell[None],
            enemy_flies=self._flies[enemy_type][None],
            enemy_type=enemy_type[None],
            living=np.array([[own, enemy]], np.int16),
            score=np.array([score], np.int16),
            seed=np.array([seed], np.uint64),
        )
        return seen, None if clock == _NO_CLOCK else clock / 1000

    def _check(self, cell: list[int], alive: list[int], enemy_cell: list[int], enemy_type: list[int]) -> None:
        """Refuse units where no unit can be: fighters index boards by them."""
        n_cells, n_kinds = self._layout.n_cells, len(self._flies) - 1
        if (
            min(cell, default=0) < 0
            or max(cell, default=0) >= n_cells
            or max(alive, default=0) > 1
            or max(enemy_cell, default=0) >= n_cells
            or max(enemy_type, default=-1) >= n_kinds
            or any(at < -1 or kind < -1 or (at < 0) != (kind < 0) for at, kind in zip(enemy_cell, enemy_type, strict=True))
        ):
            raise UnreadableError("an observation has a unit that no game has")
