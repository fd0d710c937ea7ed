"""The network venue: a referee and every entry a process of its own."""

import multiprocessing
from collections.abc import Iterator
from pathlib import Path

from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.referee.match import Terms
from tournaments.fixture import plan_fixture
from tournaments.venues import Setting, play_network

ENTRIES = {"one": "rush", "two": "patrol", "three": "random"}


def processes() -> Iterator[tuple[int, str]]:
    """Yield the process id and the command line of all that runs."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                yield int(folder.name), (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            except (FileNotFoundError, ProcessLookupError):
                continue


def test_the_referee_and_every_entry_have_a_process_of_their_own(tmp_path: Path) -> None:
    setting = Setting(
        ruleset=load("paper"),
        entries=ENTRIES,
        terms=Terms(),
        slots=2,
        journals=tmp_path,
        keys=tmp_path / "keys",
        homes=tmp_path / "homes",
    )
    pairs = [("one", "two"), ("one", "three"), ("two", "three")]
    plans = [plan for one, other in pairs for plan in plan_fixture("processes", one, other, 2, secret_from_seed(1))]
    outcomes = play_network(setting, plans)

    first = next(outcomes)
    referees = {child.pid for child in multiprocessing.active_children() if child.name == "referee"}
    clients = {name: {pid for pid, command in processes() if f"--name {name} " in command} for name in ENTRIES}
    rest = list(outcomes)

    assert len(referees) == 1
    assert all(len(pids) == 1 for pids in clients.values()), clients
    assert len(referees.union(*clients.values())) == 1 + len(ENTRIES)
    assert {first.identity, *(outcome.identity for outcome in rest)} == {plan.identity for plan in plans}
    assert not any(f"--name {name} " in command for _, command in processes() for name in ENTRIES), "a client outlived its league"
