"""Try every entry once before a league begins: who cannot start is named before anything is played or stored.

A fighter that is not a script of ours is tried as it will play: in a process of its own, under its limits, behind its wall. It is
loaded, told that a match begins, and asked for some turns, which are timed. What it answers is not judged; that is counted in the
matches.
"""

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from statistics import median
from threading import Lock

from arena.errors import ArenaError, InputError, PolicyError
from arena.game.keys import KEY_BYTES, MatchKeys
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.sandbox.limits import NO_LIMITS
from arena.sandbox.process import Sandbox
from policies.program import PREFIX as PROGRAM
from policies.registry import OWN
from policies.workers.policy import WorkerFactory
from tournaments.league.entries import public_key_of
from tournaments.running.trial import Trial

PATIENCE_S = 60.0
"""What is not ready to play by then is taken not to be at all; a large network is loaded in it."""
_AT_ONCE = 4
"""Fighters that are loaded; most of a start is waiting for the disk."""
_MOST_TURNS, _MOST_S = 12, 2.0
"""Of a trial, after its first turn."""
_MOST_TURN_S = 5.0
"""A turn that takes longer says nothing of the others."""
_TRUSTED = Sandbox(has_wall=False, limits=NO_LIMITS)


def check_entries(
    entries: Mapping[str, str], ruleset: Ruleset, sandboxes: Mapping[str, Sandbox], *, patience_s: float = PATIENCE_S
) -> dict[str, float]:
    """Return how long each entry thinks, in seconds a turn, if all can start; scripts of ours take none that matters.

    Parameters
    ----------
    sandboxes
        Where fighters run that are files or programs, by entry.

    Raises
    ------
    InputError
        Some cannot start, and the text has a line for each; or no sandbox can be made on this machine.
    """
    for sandbox in set(sandboxes.values()):
        sandbox.check()
    tried: dict[tuple[str, Sandbox], list[str]] = {}
    for name, spec in sorted(entries.items()):
        if public_key_of(spec) is None and spec not in OWN:
            tried.setdefault((spec, sandboxes.get(name, _TRUSTED)), []).append(name)
    trials = [_Attempt(spec, sandbox, ruleset, patience_s) for spec, sandbox in tried]
    turn = Lock()
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        try:
            list(pool.map(lambda trial: trial.run(turn), trials))
        finally:
            for trial in trials:
                trial.stop()  # whoever interrupts it waits for nobody
    named = list(zip(trials, tried.values(), strict=True))
    failures = [f"{name} cannot start: {trial.why_not}" for trial, names in named if trial.why_not for name in names]
    if failures:
        raise InputError(*sorted(failures))
    return {name: trial.think_s for trial, names in named for name in names}


class _Attempt:
    """Loads a fighter, and times its turns."""

    def __init__(self, spec: str, sandbox: Sandbox, ruleset: Ruleset, patience_s: float) -> None:
        self._spec, self._ruleset = spec, ruleset
        self._factory = WorkerFactory(spec, has_wall=sandbox.has_wall, limits=sandbox.limits, patience_s=_MOST_TURN_S)
        self._patience_s = patience_s
        self._is_stopped = False
        self.why_not = ""
        """Why it cannot start."""
        self.think_s = 0.0

    def stop(self) -> None:
        """End it, however far it is; from another thread."""
        self._is_stopped = True
        self._factory.close()

    def run(self, turn: Lock) -> None:
        """Try the fighter; its turns are timed while no other's are."""
        if self._is_stopped:
            return
        try:
            self._factory.prepare(self._patience_s)
            with turn:
                self.think_s = self._time()
        except ArenaError as error:
            self.why_not = str(error).partition(" cannot start: ")[2] or str(error)
        finally:
            self._factory.close()

    def _time(self) -> float:
        trial = Trial(self._factory, self._ruleset, Team.BLUE, MatchKeys(map_key=bytes(KEY_BYTES), match_key=bytes(KEY_BYTES)))
        self._raise_if_it_failed(trial.start().first_traceback)
        took_s: list[float] = []
        until_s = time.monotonic() + _MOST_S
        while len(took_s) <= _MOST_TURNS and not trial.is_over and (len(took_s) < 2 or time.monotonic() < until_s):
            turn = trial.play_turn()
            took_s.append(turn.took_s)
            failure = turn.faults.first_traceback
            if failure is not None:
                if self._spec.startswith(PROGRAM) and len(took_s) == 1:  # which has no other way to say that it is there
                    self._raise_if_it_failed(failure)
                break
        return median(took_s[1:-1] or took_s[:1])

    def _raise_if_it_failed(self, traceback: str | None) -> None:
        if traceback is not None:
            raise PolicyError((traceback.strip().splitlines() or ["it failed, and says nothing of it"])[-1])
