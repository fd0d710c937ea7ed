"""Clients that are forked from one process: each as a process of its own, and none outlives whom it was started for."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from family import PATIENCE_S, kill, processes, wait_for_the_end_of
from network_settings import make_setting, plan

import tournaments.venues.fork_server as fork_server
import tournaments.venues.network as network
import tournaments.venues.processes as tournament_processes
from arena.errors import ArenaError
from arena.game.types import Termination
from arena.keyring.files import load_or_make
from arena.sandbox.limits import NO_LIMITS
from arena.sandbox.process import Sandbox
from tournaments.venues.fork_server import ForkedProcess, ForkServer, can_fork
from tournaments.venues.network import play
from tournaments.venues.processes import may_fork
from tournaments.venues.setting import Fighter

pytestmark = pytest.mark.skipif(not can_fork(), reason="nothing can be forked here")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ForkServer]:
    setting = make_setting(tmp_path)
    setting.journals.mkdir()
    with ForkServer(setting) as opened:
        yield opened


def start(server: ForkServer, folder: Path, name: str) -> ForkedProcess:
    """Start a client that looks for a pit which is not there."""
    load_or_make(folder / f"{name}.key")
    home = folder / name
    home.mkdir()
    words = ["join", "arena://127.0.0.1:1/none", "--key", str(folder / f"{name}.key"), "--name", name, "--policy", "rush"]
    with (folder / f"{name}.log").open("ab") as log:
        return server.fork([*words, "--no-transcripts", "--alive", str(home / "alive")], home, log)


def status(pid: int, line: str) -> int:
    """Return a number that the system tells of a process."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(words[1]) for words in map(str.split, lines) if words[0] == f"{line}:")


def test_each_fork_is_a_process_of_its_own_that_shows_its_command_and_starts_at_home(server: ForkServer, tmp_path: Path) -> None:
    forks = {name: start(server, tmp_path, name) for name in ("one", "two")}

    commands = dict(processes())
    for name, fork in forks.items():
        found = Path(f"/proc/{fork.pid}")
        assert f" join arena://127.0.0.1:1/none --key {tmp_path / name}.key --name {name} --policy rush " in commands[fork.pid]
        assert os.getsid(fork.pid) == fork.pid
        assert [(found / link).readlink() for link in ("cwd", "fd/0", "fd/1", "fd/2")] == [
            tmp_path / name, Path(os.devnull), *[tmp_path / f"{name}.log"] * 2
        ]  # fmt: skip
    forks["one"].end()
    assert forks["two"].is_running
    forks["two"].terminate()
    forks["two"].end(PATIENCE_S)
    assert "Traceback" not in (tmp_path / "two.log").read_text()


def test_what_is_forked_has_one_thread_one_connection_and_no_children_that_have_ended(server: ForkServer, tmp_path: Path) -> None:
    start(server, tmp_path, "one").end()
    two = start(server, tmp_path, "two")
    forked = status(two.pid, "PPid")

    assert status(forked, "Threads") == 1, "only the thread that forks is there in the fork"
    links = [file.readlink().name for file in Path(f"/proc/{forked}/fd").iterdir()]
    assert len({link for link in links if link.startswith("socket:")}) == 1
    assert Path(f"/proc/{forked}/task/{forked}/children").read_text().split() == [str(two.pid)]
    two.end()


def test_forks_end_with_what_they_are_forked_from_and_the_next_comes_from_another(server: ForkServer, tmp_path: Path) -> None:
    one = start(server, tmp_path, "one")
    forked = status(one.pid, "PPid")

    os.kill(forked, signal.SIGKILL)

    wait_for_the_end_of([one.pid])
    two = start(server, tmp_path, "two")
    assert two.is_running
    assert status(two.pid, "PPid") != forked
    one.end()
    two.end()


def test_what_cannot_be_forked_again_and_again_is_one_sentence_that_names_a_log(
    server: ForkServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tournament_processes, "MOST_DEATHS", 1)
    monkeypatch.setattr(fork_server, "_SERVER", "raise SystemExit('it is broken')")

    with pytest.raises(
        ArenaError, match=r"^the process that clients are forked from died 2 times in a row; (.*) says why$"
    ) as said:
        start(server, tmp_path, "one")

    log = str(said.value).split("; ")[1].removesuffix(" says why")
    assert Path(log).read_text() == "it is broken\n" * 2


def test_an_error_before_a_fork_begins_is_in_its_log(server: ForkServer, tmp_path: Path) -> None:
    with (tmp_path / "log").open("ab") as log:
        fork = server.fork(["rules"], tmp_path / "nowhere", log)

    fork.end(PATIENCE_S)
    assert "nowhere" in (tmp_path / "log").read_text()


def test_a_league_goes_on_whose_clients_are_killed_with_what_they_are_forked_from(tmp_path: Path) -> None:
    setting, plans = make_setting(tmp_path, one="rush", two="patrol"), plan("one", "two", 3)
    outcomes = play(setting, plans)

    played = [next(outcomes)]
    [forked] = [pid for pid, command in processes() if f"arena: clients in {setting.homes} are forked" in command]
    kill(forked)
    played += outcomes

    assert {outcome.identity for outcome in played} == {match.identity for match in plans}
    assert not {outcome.result.ending for outcome in played} & {Termination.FORFEIT, Termination.VOID}


def test_where_nothing_can_be_forked_each_client_has_an_interpreter_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(network, "can_fork", lambda: False)
    setting = make_setting(tmp_path, one="rush", two="patrol")

    assert len(list(play(setting, plan("one", "two")))) == 2
    assert not list(setting.journals.glob("pit.clients.log"))


def test_only_our_own_fighters_that_play_in_the_client_itself_are_forked() -> None:
    assert may_fork(Fighter(spec="rush"))
    wall = Sandbox(has_wall=True, limits=NO_LIMITS)
    for other in (Fighter(spec="rush", sandbox=wall), Fighter(spec="bot.py", sandbox=wall), Fighter(spec="planner:budget=20")):
        assert not may_fork(other)
