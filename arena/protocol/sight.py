"""An observation as bytes of one length per ruleset: every field has a fixed width, so that a length tells nothing.

    tick uint32 | clock uint32, milliseconds, all bits set where none runs | seed uint64 | own score int16 | own living,
    enemy living int16 | ground int8 per cell | own cells int16 | own alive uint8 | enemy cells int16 | enemy types int8

Integers are little-endian. Enemies out of sight are -1 and -1, after those in sight.
"""

import struct
from functools import lru_cache
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


@lru_cache(maxsize=256)
def _layout(ruleset: Ruleset, team: Team) -> _Layout:
    return _Layout(ruleset.side**2, len(ruleset.team(team)), len(ruleset.team(team.other)))


@lru_cache(maxsize=256)
def _flies(ruleset: Ruleset) -> np.ndarray:
    """Return for each unit type whether it flies; type -1, which is no unit, does not."""
    return np.array([*(unit.flies for unit in ruleset.units), False], np.uint8)


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
    """Return the observation that `pack` wrote, as a batch of one, and the clock.

    Raises
    ------
    UnreadableError
        The bytes are no observation under this ruleset.
    """
    layout = _layout(ruleset, team)
    if len(data) != layout.n_bytes:
        raise UnreadableError(f"an observation has {layout.n_bytes} bytes under these rules, not {len(data)}")
    tick, clock, seed, score, own, enemy = _HEAD.unpack_from(data)
    at = _HEAD.size
    if tick > _MOST_TICKS or data[at : at + layout.n_cells].translate(None, _CODES):
        raise UnreadableError("an observation has a tick or a cell that no game has")
    memory = bytearray(data)  # arrays that can be written to, as the local venue's: kernels are compiled for such
    ground = np.frombuffer(memory, np.int8, layout.n_cells, at)[None]
    at += layout.n_cells
    cell = np.frombuffer(memory, "<i2", layout.n_own, at)[None]
    at += 2 * layout.n_own
    alive = np.frombuffer(memory, np.uint8, layout.n_own, at)[None]
    at += layout.n_own
    enemy_cell = np.frombuffer(memory, "<i2", layout.n_enemy, at)[None]
    at += 2 * layout.n_enemy
    enemy_type = np.frombuffer(memory, np.int8, layout.n_enemy, at)[None]
    _check(ruleset, layout, cell.tolist()[0], alive.tolist()[0], enemy_cell.tolist()[0], enemy_type.tolist()[0])
    seen = Observations(
        team=team,
        side=ruleset.side,
        tick=np.array([tick], np.int32),
        ground=ground,
        cell=cell,
        alive=alive,
        enemy_cell=enemy_cell,
        enemy_flies=_flies(ruleset)[enemy_type],
        enemy_type=enemy_type,
        living=np.array([[own, enemy]], np.int16),
        score=np.array([score], np.int16),
        seed=np.array([seed], np.uint64),
    )
    return seen, None if clock == _NO_CLOCK else clock / 1000


def _check(
    ruleset: Ruleset, layout: _Layout, cell: list[int], alive: list[int], enemy_cell: list[int], enemy_type: list[int]
) -> None:
    """Refuse units where no unit can be: fighters index boards by them."""
    own_fit = all(0 <= at < layout.n_cells for at in cell) and all(is_alive in (0, 1) for is_alive in alive)
    kinds = len(ruleset.units)
    enemies_fit = all(
        (at == kind == -1) or (0 <= at < layout.n_cells and 0 <= kind < kinds)
        for at, kind in zip(enemy_cell, enemy_type, strict=True)
    )
    if not own_fit or not enemies_fit:
        raise UnreadableError("an observation has a unit that no game has")
