"""The network venue: a referee and every entry a process of its own; who dies is started anew, and none outlives the league."""

import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from family import PATIENCE_S, LeagueProcess, kill, marked, processes, wait_for_the_end_of
from network_settings import make_setting, plan, sessions

import tournaments.venues.processes as tournament_processes
from arena.errors import ArenaError, InputError
from arena.game.types import Team, Termination
from arena.match.time_control import TimeControl
from arena.network.address import Address
from arena.sandbox.limits import NO_LIMITS
from arena.sandbox.process import Sandbox
from tournaments.outcome import Outcome
from tournaments.venues import referee_process
from tournaments.venues.bundle import freeze
from tournaments.venues.local import play as play_local
from tournaments.venues.network import play as play_network
from tournaments.venues.processes import MOST_DEATHS
from tournaments.venues.setting import Fighter

ENTRIES = {"one": "rush", "two": "patrol", "three": "random"}
SLOW = """
import time
from pathlib import Path
def act(observation):
    if observation.tick == 5:
        Path({thinks!r}).touch()
        while not Path({may_answer!r}).exists():
            time.sleep(0.01)
    return [0 for unit in observation.units]
"""
FATAL = "import os, signal\ndef act(observation):\n    os.kill(os.getppid(), signal.SIGKILL)\n"
STUCK = """
import subprocess, sys
def act(observation):
    subprocess.run([sys.executable, "-c", "import time; time.sleep(1000)"])
"""


@pytest.fixture
def few_deaths(monkeypatch: pytest.MonkeyPatch) -> int:
    """Give up sooner on who dies again and again; return how often that is."""
    monkeypatch.setattr(tournament_processes, "MOST_DEATHS", 1)
    return 2


def test_the_referee_and_every_entry_have_a_process_of_their_own(tmp_path: Path) -> None:
    setting = replace(make_setting(tmp_path, **ENTRIES), slots=2)
    pairs = [("one", "two"), ("one", "three"), ("two", "three")]
    plans = [match for one, other in pairs for match in plan(one, other, 2)]
    outcomes = play_network(setting, plans)

    first = next(outcomes)
    referees = {child.pid for child in multiprocessing.active_children() if child.name == "referee"}
    clients = {name: sessions(f"--name {name} ", str(tmp_path)) for name in ENTRIES}
    rest = list(outcomes)

    assert len(referees) == 1
    assert all(len(pids) == 1 for pids in clients.values()), clients
    assert len(referees.union(*clients.values())) == 1 + len(ENTRIES)
    assert {first.identity, *(outcome.identity for outcome in rest)} == {match.identity for match in plans}
    assert not any(f"--name {name} " in command for _, command in processes() for name in ENTRIES if str(tmp_path) in command), (
        "a client outlived its league"
    )


def test_a_client_that_is_killed_comes_back_and_that_it_vanished_is_recorded(tmp_path: Path) -> None:
    thinks, may_answer = tmp_path / "thinks", tmp_path / "may-answer"
    setting = make_setting(tmp_path, one="rush", slow=SLOW.format(thinks=str(thinks), may_answer=str(may_answer)))
    plans = plan("one", "slow", 2)

    def strike() -> None:
        while not thinks.exists():
            assert not is_over.wait(0.05)
        for pid, command in processes():
            if "--name slow " in command:
                kill(pid)
        may_answer.touch()

    is_over = threading.Event()
    striker = threading.Thread(target=strike)
    striker.start()
    try:
        played = list(play_network(setting, plans))
    finally:
        is_over.set()
        striker.join()

    assert {outcome.identity for outcome in played} == {match.identity for match in plans}
    assert not {outcome.result.ending for outcome in played} & {Termination.FORFEIT, Termination.VOID}
    assert sum(outcome.seats[team_of(outcome, "slow")].faults.get("vanished", 0) for outcome in played) == 1
    assert not any(outcome.seats[team_of(outcome, "one")].faults for outcome in played)


def team_of(outcome: Outcome, name: str) -> Team:
    return Team.BLUE if outcome.blue == name else Team.RED


def test_a_client_that_stays_away_forfeits_and_it_is_recorded_whose_and_why(tmp_path: Path) -> None:
    setting = replace(make_setting(tmp_path, one="rush", fatal=FATAL), time_control=TimeControl(turn_time_s=None, grace_s=0.1))
    outcomes = play_network(setting, plan("one", "fatal"))

    with closing(outcomes):
        first = next(outcomes)

    assert first.result.ending is Termination.FORFEIT
    assert first.winner == "one"
    assert first.result.reason == f"{team_of(first, 'fatal').name.lower()} did not come back in time"
    assert first.seats[team_of(first, "fatal")].faults == {"vanished": 1}


def test_a_client_that_lives_through_no_match_forfeits_them_all_and_the_league_ends(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, few_deaths: int
) -> None:
    bots = make_setting(tmp_path, one="rush", two="patrol", fatal=FATAL)
    setting = replace(bots, time_control=TimeControl(turn_time_s=None, grace_s=2.0))
    plans = [match for pair in (("one", "fatal"), ("one", "two")) for match in plan(*pair)]

    played = {outcome.identity: outcome for outcome in play_network(setting, plans)}

    assert set(played) == {match.identity for match in plans}
    for outcome in played.values():
        if "fatal" in (outcome.blue, outcome.red):
            assert (outcome.result.ending, outcome.winner) == (Termination.FORFEIT, "one")
            assert outcome.seats[team_of(outcome, "fatal")].faults["vanished"] >= 1
        else:
            assert outcome.result.ending is not Termination.FORFEIT
    warnings = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert f"the client of fatal died {few_deaths} times in a row; {setting.journals / 'fatal.log'} says why" in warnings[0]
    assert (setting.journals / "fatal.log").is_file()


def test_a_client_that_never_sits_down_ends_the_league_in_one_sentence_that_names_its_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, few_deaths: int
) -> None:
    setting = replace(
        make_setting(tmp_path, one="rush", two="no-such-fighter"), time_control=TimeControl(turn_time_s=None, grace_s=0.1)
    )
    monkeypatch.setattr(tournament_processes, "_PATIENCE_S", 1)

    with pytest.raises(ArenaError, match=rf"the client of two died {few_deaths} times in a row; .*/two.log says why$"):
        list(play_network(setting, plan("one", "two")))

    assert "no-such-fighter" in (setting.journals / "two.log").read_text()


@contextmanager
def signalled_referees(number: signal.Signals) -> Iterator[None]:
    """Send a signal to every referee that this process starts, at once."""
    is_over = threading.Event()

    def signal_every_referee() -> None:
        while not is_over.wait(0.05):
            for pid, command in processes():
                if "spawn_main" in command and Path(f"/proc/{pid}/stat").read_text().split(") ")[-1].split()[1] == str(
                    os.getpid()
                ):
                    os.kill(pid, number)

    signaller = threading.Thread(target=signal_every_referee)
    signaller.start()
    try:
        yield
    finally:
        is_over.set()
        signaller.join()


def test_a_referee_that_dies_again_and_again_ends_the_league_in_one_sentence_that_names_its_log(tmp_path: Path) -> None:
    setting = make_setting(tmp_path, one="rush", two="patrol")
    sentence = rf"the referee died {MOST_DEATHS + 1} times in a row; .*/pit.referee.log says why$"

    with signalled_referees(signal.SIGKILL), pytest.raises(ArenaError, match=sentence):
        list(play_network(setting, plan("one", "two")))


def test_a_referee_that_hangs_before_its_pit_is_open_counts_as_dead(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, few_deaths: int
) -> None:
    monkeypatch.setattr(referee_process, "OPEN_WITHIN_S", 1.0)
    setting = make_setting(tmp_path, one="rush", two="patrol")

    with (
        signalled_referees(signal.SIGSTOP),
        pytest.raises(ArenaError, match=f"the referee died {few_deaths} times in a row: it was not ready within 1 s"),
    ):
        list(play_network(setting, plan("one", "two")))


def test_a_referee_that_hangs_as_it_ends_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(referee_process, "GOODBYE_S", 0.1)
    hanging = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(1_000,), daemon=True)
    hanging.start()
    referee = referee_process.RefereeProcess(make_setting(tmp_path, one="rush"), Address())
    referee._process, referee._pipe = hanging, multiprocessing.Pipe()[0]

    referee.reap()

    assert hanging.exitcode == -signal.SIGKILL


def test_a_referee_that_cannot_listen_says_so_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tournament_processes, "MOST_DEATHS", 0)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        setting = replace(make_setting(tmp_path, one="rush", two="patrol"), listen=f"tcp/127.0.0.1:{other.getsockname()[1]}")

        with pytest.raises(InputError, match=r"^cannot listen at tcp/.*: the port is in use$"):
            list(play_network(setting, plan("one", "two")))


FULL = """
import resource, sys
from pathlib import Path
from network_settings import make_setting, plan
from arena.errors import ArenaError, InputError
from tournaments.venues.table import find_venue
def main():
    folder, n_bytes = Path(sys.argv[2]), int(sys.argv[3])
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))
    setting = make_setting(folder, one="rush", two="patrol")
    try:
        for outcome in find_venue(sys.argv[1])(setting, plan("one", "two", 2)):
            print(outcome.identity)
    except ArenaError as error:
        print("says:", error)
if __name__ == "__main__":
    main()
"""


@pytest.mark.usefixtures("one_core")  # to go on; the program has all that there are
@pytest.mark.parametrize("venue", ["local", "network"])
def test_a_disk_that_takes_no_journal_is_one_sentence_and_what_was_stored_can_go_on(venue: str, tmp_path: Path) -> None:
    program = tmp_path / "full.py"
    program.write_text(FULL)
    command = [sys.executable, str(program), venue, str(tmp_path), "1000"]  # no file is to be longer
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, Path(__file__).parents[:2]))}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python would cut that short as well, and not notice
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False)

    assert done.returncode == 0, done.stderr
    assert [line.partition(":")[0] for line in done.stdout.splitlines()] == ["says"]
    assert "cannot write " in done.stdout
    assert "journal" in done.stdout
    assert "Traceback" not in done.stdout + done.stderr

    setting = make_setting(tmp_path, one="rush", two="patrol")
    assert len(list(play_local(setting, plan("one", "two", 2)))) == 4


def test_whoever_a_killed_scheduler_started_ends_with_it(tmp_path: Path) -> None:
    mark = f"stuck{os.getpid()}"
    (tmp_path / "stuck.py").write_text(STUCK.replace("1000)", f"1000)  # {mark}"))
    file = tmp_path / "friday.toml"
    clock = "turn_time_s = 0\ngrace_s = 600"  # so that no match ends, and no process ends by that
    file.write_text(f'pairs = 1\nseed = 1\n{clock}\n[entries]\none = "rush"\nstuck = "{tmp_path / "stuck.py"}"')
    with LeagueProcess(file, "network", tmp_path / "data", str(tmp_path / "arena.db")) as league:
        league.start()
        while len(family := {*league.family(), *marked(mark)}) < 7 or not marked(mark):
            # the scheduler, its referee, what one client is forked from, two clients, a fighter and what it started
            assert not league.ends_within(0.05), league.said

        assert league.process is not None
        kill(league.process.pid)  # it alone, and not its process group

        wait_for_the_end_of(family)


def test_the_workers_of_a_killed_scheduler_end_with_it(tmp_path: Path) -> None:
    (tmp_path / "stuck.py").write_text(STUCK)
    file = tmp_path / "friday.toml"
    file.write_text('pairs = 600\nseed = 1\ntrusted = ["stuck"]\nentries = ["rush", "stuck.py"]')
    with LeagueProcess(file, "local", tmp_path / "data", str(tmp_path / "arena.db")) as league:
        league.start()
        while league.find("spawn_main") is None:
            assert not league.ends_within(0.05), league.said
        workers = {pid for pid, command in league.family().items() if "spawn_main" in command}
        assert league.process is not None
        kill(league.process.pid)

        wait_for_the_end_of(workers)


def test_a_client_that_is_stopped_is_replaced_and_the_league_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(tournament_processes, "HUNG_S", 3.0)
    slow = "import time\ndef act(observation):\n    time.sleep(0.05)\n    return [0 for unit in observation.units]\n"
    setting = make_setting(tmp_path, one="patrol", slow=slow)
    outcomes = play_network(replace(setting, time_control=TimeControl(turn_time_s=0.5, bank_s=0.0)), plan("one", "slow", 2))

    played = [next(outcomes)]
    for pid in sessions("--name one ", str(tmp_path)):
        os.kill(pid, signal.SIGSTOP)
    played += outcomes

    assert len(played) == 4
    assert "the client of one gave no sign of life for 3 s; it is started anew" in caplog.messages


def test_a_program_is_found_where_the_league_was_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        "#!/usr/bin/env python3\nwhile True:\n    if 'observation' in input():\n        print([0] * 6, flush=True)\n"
    )
    program.chmod(0o755)
    monkeypatch.chdir(tmp_path)

    outcomes = list(play_network(make_setting(tmp_path, one="exec:./program.py", two="rush"), plan("one", "two")[:1]))

    assert [outcome.seats[Team.BLUE].faults for outcome in outcomes] == [{}]


def test_a_bot_file_that_is_edited_while_its_league_runs_plays_on_as_it_was(tmp_path: Path) -> None:
    bot, trusted = tmp_path / "bot.py", tmp_path / "trusted.py"
    for file in (bot, trusted):
        file.write_text("before")
    setting = replace(
        make_setting(tmp_path, one="rush", bot=str(bot), trusted=str(trusted)),
        sandboxes={name: Sandbox(has_wall=name == "bot", limits=NO_LIMITS) for name in ("bot", "trusted")},
    )

    frozen = {name: fighter.spec for name, fighter in freeze(setting.fighters).items()}
    bot.write_text("after")

    assert Path(frozen["bot"]).name == "bot.py"
    assert Path(frozen["bot"]).read_text() == "before"
    assert (frozen["one"], frozen["trusted"]) == ("rush", str(trusted)), "which finds its neighbours beside it"


def test_the_log_of_a_client_that_is_started_again_and_again_does_not_grow_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tournament_processes, "_MOST_LOG_BYTES", 100)
    monkeypatch.setattr(tournament_processes, "_KEPT_LOG_BYTES", 10)
    monkeypatch.setattr(tournament_processes, "SandboxedProcess", lambda *_, **__: None)
    setting = make_setting(tmp_path, one="rush")
    setting.journals.mkdir(exist_ok=True)
    log = setting.journals / "one.log"
    address = Address(endpoint="tcp/127.0.0.1:1", pit="pit")
    client = tournament_processes.ClientProcess(setting, address, "one", Fighter(spec="rush"))

    for printed, kept in ((b"x" * 100, b"x" * 100), (b"the last words", b"last words")):
        with log.open("ab") as file:
            file.write(printed)
        client.start()
        assert log.read_bytes() == kept
