"""An observation as bytes of one length per ruleset: every field has a fixed width, so that a length tells nothing.

The fields, their widths and their order are those of `arena.game.observation.FIELDS`; the clock is in milliseconds, all bits set
where none runs. Integers are little-endian, each at a multiple of its width, so that a reader's arrays are views of the
bytes. Enemies out of sight are -1 and -1, after those in sight.
"""

from itertools import accumulate, takewhile
from math import prod
from struct import Struct

import numpy as np

from arena.errors import UnreadableError
from arena.game.observation import FIELDS, NO_CLOCK_MS, Observations
from arena.game.observation_fields import GROUND_CODES
from arena.game.ruleset import Ruleset
from arena.game.types import Team

_WIRE = {name: spec for name, spec in FIELDS.items() if spec.is_on_wire}
_WIDTHS = {name: np.dtype(spec.dtype).itemsize for name, spec in _WIRE.items()}
_CLOCK_AT = sum(_WIDTHS[name] for name in takewhile("clock_ms".__ne__, _WIRE))
"""In bytes; only single numbers stand before the clock, so that no ruleset moves it."""
_NO_CLOCK = NO_CLOCK_MS.to_bytes(_WIDTHS["clock_ms"], "little")
_CODES = bytes(code & 0xFF for code in GROUND_CODES)


def without_clock(data: bytes) -> bytes:
    """Return an observation's bytes as if no clock ran, which anybody can compute from the journal alone."""
    return data[:_CLOCK_AT] + _NO_CLOCK + data[_CLOCK_AT + len(_NO_CLOCK) :]


class ObservationWriter:
    """Writes the observations of one seat, which its venue lays out in the same memory at every tick."""

    def __init__(self, observations: Observations, seat: int) -> None:
        row, n_cells = slice(seat, seat + 1), observations.side**2
        fields = {name: getattr(observations, name)[row] for name in _WIRE}
        fields["ground"] = fields["ground"][:, :n_cells]
        self._clock_ms, self._bank_s = fields["clock_ms"], -1.0
        self._fields = [field.data.cast("B") for field in fields.values() if field.size]

    def set_clock(self, bank_s: float) -> None:
        """Say how much extra time the seat has left."""
        if bank_s != self._bank_s:  # as it seldom is
            self._bank_s = bank_s
            self._clock_ms[0] = int(min(max(bank_s * 1000, 0), NO_CLOCK_MS - 1))

    def write(self) -> bytes:
        """Return the bytes of what the seat sees now."""
        return b"".join(self._fields)


class ObservationReader:
    """Reads the observations of one seat, each into the memory of the one before."""

    def __init__(self, ruleset: Ruleset, team: Team) -> None:
        shapes = {name: spec.shape_of(ruleset, team) for name, spec in _WIRE.items()}
        counts = {name: prod(shape) for name, shape in shapes.items()}
        ends = dict(zip(_WIRE, accumulate(counts[name] * _WIDTHS[name] for name in _WIRE), strict=True))
        self.n_bytes = ends["ground"]
        """Length of an observation."""
        memory = np.zeros(self.n_bytes, np.uint8)
        arrays = {
            name: memory[ends[name] - counts[name] * _WIDTHS[name] : ends[name]].view(spec.dtype).reshape(1, *shapes[name])
            for name, spec in _WIRE.items()
        }
        self._seen = Observations.blank(ruleset, team, 1, **arrays)
        self._memory, self._enemy_flies = memory.data, self._seen.enemy_flies[0].data
        self._flies = [*(unit.flies for unit in ruleset.units), False]
        """By type; -1, which is no unit, finds the last, which does not fly."""

        self._n_cells = counts.pop("ground")  # the last field, which is checked by its bytes; the others are unpacked
        self._numbers = Struct("".join(f"{count}{np.dtype(_WIRE[name].dtype).char}" for name, count in counts.items()))
        parts = {name: slice(end - counts[name], end) for name, end in zip(counts, accumulate(counts.values()), strict=True)}
        self._enemy_cell, self._enemy_type = parts["enemy_cell"], parts["enemy_type"]
        self._nobody = (-1,) * counts["enemy_type"]
        bounds = {name: _WIRE[name].values_of(ruleset, team) for name in parts}
        self._single = [(name, parts[name].start, values) for name, values in bounds.items() if values and not shapes[name]]
        self._several = [(name, parts[name], frozenset(values)) for name, values in bounds.items() if values and shapes[name]]

    def blank(self) -> Observations:
        """Return the memory as it is before anything was read: a board that shows nothing."""
        return self._seen

    def read(self, data: bytes) -> Observations:
        """Return what an `ObservationWriter` wrote, as a batch of one, in memory that the next call overwrites.

        Raises
        ------
        UnreadableError
            The bytes are no observation under this ruleset.
        """
        if len(data) != self.n_bytes:
            raise UnreadableError(f"an observation has {self.n_bytes} bytes under these rules, not {len(data)}")
        if data[-self._n_cells :].translate(None, _CODES):
            raise UnreadableError("an observation has a cell that no game has")
        numbers = self._numbers.unpack_from(data)
        self._check(numbers)
        self._memory[:] = data
        self._enemy_flies[:] = bytes(map(self._flies.__getitem__, numbers[self._enemy_type]))
        return self._seen

    def _check(self, numbers: tuple[int, ...]) -> None:
        """Refuse what no game can hold, since fighters index boards by it."""
        for name, at, values in self._single:
            if numbers[at] not in values:
                raise UnreadableError(f"an observation has {numbers[at]} as its {name}, which no game has")
        for name, part, allowed in self._several:
            if not allowed.issuperset(numbers[part]):
                raise UnreadableError(f"an observation has {numbers[part]} as its {name}, which no game has")
        kinds = numbers[self._enemy_type]
        if kinds != self._nobody or numbers[self._enemy_cell] != self._nobody:
            for cell, kind in zip(numbers[self._enemy_cell], kinds, strict=True):
                if (cell < 0) != (kind < 0):
                    raise UnreadableError("an observation has an enemy with a type and no place, or a place and no type")
