"""Load for a benchmark of the pit: many entries, each a real `arena join` with a key of its own, killed and started at random."""

import os
import random
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from threading import Event, Thread

from arena.jit import cache_root
from arena.network.address import Address


class LoadGenerator:
    """Processes that end with the `with` block."""

    def __init__(self, address: Address, folder: Path, entries: Mapping[str, str], *, kill_every_s: float, most_away_s: float):
        self.entries = entries
        """The fighter behind each entry."""
        self.n_kills = self.n_restarts = 0
        self._address, self._folder = address, folder
        self._kill_every_s, self._most_away_s = kill_every_s, most_away_s
        self._random = random.Random(0)
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._is_over = Event()
        self._thread = Thread(target=self._run, name="load generator")

    def __enter__(self) -> "LoadGenerator":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop_kills()
        for process in self._processes.values():
            process.kill()
            process.wait()

    def start(self) -> None:
        """Start every entry."""
        self._processes = {name: self._join(name) for name in self.entries}

    def start_kills(self) -> None:
        """Kill entries at random from now on, and start them again."""
        self._thread.start()

    def stop_kills(self) -> None:
        """Kill and start no more entries; those that run go on."""
        self._is_over.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        """Kill one at random, now and then; each comes back a random time later."""
        now_s, kill_at_s = 0.0, self._random.expovariate(1 / self._kill_every_s)
        back_at_s: dict[str, float] = {}
        while True:
            for name in [name for name, at_s in back_at_s.items() if at_s <= now_s]:
                del back_at_s[name]
                self._processes[name] = self._join(name)
                self.n_restarts += 1
            next_s = min([kill_at_s, *back_at_s.values()])
            if self._is_over.wait(next_s - now_s):
                return
            now_s = next_s
            here = [name for name in self.entries if name not in back_at_s]
            if now_s >= kill_at_s and here:
                victim = self._random.choice(here)
                self._processes[victim].kill()
                self._processes[victim].wait()
                self.n_kills += 1
                back_at_s[victim] = now_s + self._random.uniform(0, self._most_away_s)
            if now_s >= kill_at_s:
                kill_at_s = now_s + self._random.expovariate(1 / self._kill_every_s)

    def _join(self, name: str) -> "subprocess.Popen[bytes]":
        command = [
            sys.executable, "-P", "-c", "from tournaments.cli import main; main()", "join", str(self._address), "--name", name,
            "--policy", self.entries[name], "--forever", "--no-audit", "--no-transcripts", "--data", str(self._folder),
        ]  # fmt: skip
        config = {"ARENA_CONFIG": str(self._folder / "config" / name), "NUMBA_CACHE_DIR": str(cache_root())}
        with (self._folder / f"{name}.log").open("ab") as log:
            return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env={**os.environ, **config})
