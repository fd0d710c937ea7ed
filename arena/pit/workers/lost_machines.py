"""Which machines of a pit were lost, and whether they answer again."""

import logging
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from arena.pit.workers.machines import Machine, ask

logger = logging.getLogger(__name__)

_REST_S = 10.0
"""How long a machine that was lost, or did not answer, is left alone before it is asked."""


@dataclass(slots=True)
class _State:
    """What is known of a machine."""

    is_lost: bool = False
    since_s: float = 0.0
    """When it was lost, or did not answer, last."""
    is_asked: bool = False
    """Whether an answer is waited for."""
    refused: bytes = b""
    """What it said last that was not right."""


class LostMachines:
    """Machines by whether they answer, as far as is known.

    Parameters
    ----------
    machines
        All of a pit.
    is_right
        Whether a worker that says this first, on this machine, could be used; it is not asked twice of the same.
    """

    def __init__(self, machines: Iterable[Machine], is_right: Callable[[Machine, bytes], bool]) -> None:
        self._states = {machine: _State() for machine in machines}
        self._is_right = is_right

    @property
    def answering(self) -> list[Machine]:
        """Those that were not lost, or answer again."""
        return [machine for machine, state in self._states.items() if not state.is_lost]

    @property
    def longest_lost(self) -> Machine:
        """The one that was lost first, or did not answer longest ago."""
        return min(self._states, key=lambda machine: self._states[machine].since_s)

    def note_lost(self, machine: Machine) -> None:
        """Take note that a machine was not reached."""
        state = self._states[machine]
        state.is_lost, state.since_s = True, time.monotonic()

    def note_answer(self, machine: Machine) -> None:
        """Take note that a worker there takes matches, or would."""
        self._states[machine].is_lost = False

    def ask(self) -> None:
        """Ask those that are lost, each from time to time; nobody waits for their answers."""
        now_s = time.monotonic()
        for machine, state in self._states.items():
            if state.is_lost and not state.is_asked and now_s - state.since_s > _REST_S:
                state.is_asked = True
                threading.Thread(target=self._ask, args=(machine, state), name=f"asks {machine}", daemon=True).start()

    def _ask(self, machine: Machine, state: _State) -> None:
        asked_at_s = time.monotonic()
        said = ask(machine)
        is_right = bool(said) and said != state.refused and self._is_right(machine, said)
        if is_right and state.since_s < asked_at_s:
            logger.warning("%s answers again", machine)
            self.note_answer(machine)
        elif state.is_lost:
            self.note_lost(machine)
        state.refused = b"" if is_right else said
        state.is_asked = False
