"""Try every entry once before a league begins: who cannot start is named before anything is played or stored.

A fighter that is not ours is tried in a process of its own, at home and under its limits, as it will be in a match: it is loaded,
made for one seat and told that a match begins. A program is asked for its first orders too, since it has no other way to say that
it is there. Under limits, a Zenoh session is opened beside it, since that takes its share of them. What a fighter answers is not
judged; that is counted in the matches.
"""

import json
import sys
import tempfile
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from subprocess import TimeoutExpired
from threading import Event

import numpy as np

from arena.errors import ArenaError, InputError, PolicyError
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import Ruleset, from_dict, to_dict
from arena.game.types import Team
from policies.program import PREFIX as PROGRAM
from policies.registry import OWN, load
from tournaments.league.entries import public_key_of
from tournaments.league.limits import NO_LIMITS, Limits
from tournaments.venues.sandbox import SandboxedProcess

PATIENCE_S = 60.0
"""What is not ready to play by then is taken not to be at all; a large network is loaded in it."""
_AT_ONCE = 4
"""Processes; most of a start is waiting for the disk."""
_POLL_S = 0.1
_MOST_LETTERS = 300
_SAYS = "arena: "
"""Begins the line in which the process says how it went; whatever else it says is the fighter's."""
_READY = "ready"


def check_entries(
    entries: Mapping[str, str], ruleset: Ruleset, homes: Path, limits: Limits = NO_LIMITS, *, patience_s: float = PATIENCE_S
) -> None:
    """Return if every entry can start.

    Parameters
    ----------
    homes
        Folder for the homes of the entries' processes.
    limits
        For each process. If there are any, our own fighters are tried in one too.

    Raises
    ------
    InputError
        Some cannot; the text has a line for each.
    """
    names_of: dict[str, list[str]] = {}
    for name, spec in sorted(entries.items()):
        if public_key_of(spec) is None:
            names_of.setdefault(spec, []).append(name)
    strangers = [spec for spec in names_of if spec not in OWN or limits != NO_LIMITS]
    is_over = Event()
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        try:
            whys = pool.map(lambda spec: _try(spec, ruleset, homes / names_of[spec][0], limits, patience_s, is_over), strangers)
            failures = [
                f"{name} cannot start: {why}" for spec, why in zip(strangers, whys, strict=True) if why for name in names_of[spec]
            ]
        finally:
            is_over.set()  # whoever interrupts it waits for nobody
    if failures:
        raise InputError(*sorted(failures))


def _try(spec: str, ruleset: Ruleset, home: Path, limits: Limits, patience_s: float, is_over: Event) -> str:
    """Return why a fighter cannot start, or nothing; nothing is worth waiting for once `is_over`."""
    if is_over.is_set():
        return ""
    rules = [ruleset.name, json.dumps(to_dict(ruleset))]
    command = [
        sys.executable,
        "-P",
        "-m",
        "tournaments.running.preflight",
        spec,
        *rules,
        *(["limited"] if limits != NO_LIMITS else []),
    ]
    with tempfile.TemporaryFile() as log:
        sandboxed = SandboxedProcess(command, limits, home, log)
        code, give_up_at_s = None, time.monotonic() + patience_s
        try:
            while code is None and not is_over.is_set() and time.monotonic() < give_up_at_s:
                with suppress(TimeoutExpired):
                    code = sandboxed.process.wait(_POLL_S)
        finally:
            sandboxed.end(0)
        log.seek(0)
        lines = [line.strip() for line in log.read().decode("utf-8", "replace").splitlines() if line.strip()]
    said = [line.removeprefix(_SAYS) for line in lines if line.startswith(_SAYS)]
    if said:
        return "" if said[-1] == _READY else said[-1][:_MOST_LETTERS]
    if code is None:
        return f"it was not ready after {patience_s:g} s"
    last = f"; the last it said: {lines[-1][:_MOST_LETTERS]}" if lines else ""
    return f"its process ended before it was ready, with exit code {code}{last}"


def main() -> None:
    """Start a fighter, and say how it went; in the new process."""
    spec, name, rules, *is_limited = sys.argv[1:]
    try:
        if is_limited:
            _open_session()
        _start(spec, from_dict(name, json.loads(rules)))
    except ArenaError as error:
        words = " ".join(str(error).split())
    except MemoryError:
        words = "it takes more memory than its limits leave"
    except Exception as error:  # noqa: BLE001 - a stranger's code may raise anything
        words = " ".join(f"{type(error).__name__}: {error}".split())
    else:
        words = _READY
    raise SystemExit(f"\n{_SAYS}{words}")


def _open_session() -> None:
    """Load what a client loads, and open a session until the process ends."""
    import clients.runner  # noqa: F401
    from arena.network.session import free_port, open_router

    open_router(f"tcp/127.0.0.1:{free_port()}", "preflight")


def _start(spec: str, ruleset: Ruleset) -> None:
    fighter = load(spec)(ruleset, Team.BLUE, 1)
    fighter.start(np.arange(1))
    first = fighter.take_faults(0).first_traceback
    if first is None and spec.startswith(PROGRAM):
        games = BatchedGame(ruleset, 1)
        games.start([0], [MatchKeys(map_key=bytes(32), match_key=bytes(32))])
        fighter.act(games.observe()[Team.BLUE], np.zeros((1, games.n_units[Team.BLUE]), np.int8))
        first = fighter.take_faults(0).first_traceback
    if first is not None:
        raise PolicyError(first.strip().splitlines()[-1])


if __name__ == "__main__":
    main()
