"""What follows from journals is held back here until they stand: on the disk of another machine, or safe from a power cut.

It leaves in its order. Meanwhile the loop goes on with other matches, so that the records of many matches wait together.
"""

from collections import deque
from collections.abc import Callable


class Gate:
    """Used by the thread of a loop, but for `n_standing`, which another sets.

    Attributes
    ----------
    n_written, n_standing
        How many records were written so far, and how many of them, from the first on, stand.
    """

    def __init__(self) -> None:
        self.n_written = self.n_standing = 0
        self._held: deque[tuple[int, Callable[[], None]]] = deque()

    @property
    def is_open(self) -> bool:
        """Whether all that was written stands, and nothing is held."""
        return self.n_written == self.n_standing and not self._held

    def hold(self, action: Callable[[], None]) -> None:
        """Have something done as soon as all that has been written so far stands."""
        self._held.append((self.n_written, action))

    def release(self) -> None:
        """Do what waited for records that stand now."""
        while self._held and self._held[0][0] <= self.n_standing:
            self._held.popleft()[1]()
