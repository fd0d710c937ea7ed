"""The store in trouble: a server that is killed or not there, a disk that is full or read-only. One sentence, nothing lost."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Semaphore
from typing import Any

import psycopg
import pytest
from outcomes import ended

from arena.metrics.definitions import STORE_FAILURES
from tournaments.outcome import Outcome
from tournaments.store.store import Store, StoreError, TakenError

Arena = Callable[..., subprocess.CompletedProcess[str]]
FACTS = {"ruleset": "paper", "rules": "1", "entries": {"a": "rush", "b": "patrol"}, "clock": {}}
WAIT_S = 60.0


def end(identity: str) -> Outcome:
    return ended(identity, "a", "b", seats={})


def test_a_server_that_is_killed_again_and_again_keeps_every_match_once(cluster: Any) -> None:
    url = cluster.make_database()
    stored, is_enough = Semaphore(0), Event()

    def add(store: Store, writer: int) -> list[str]:
        league, added = store.get("friday"), []
        while not is_enough.is_set():
            identity = f"friday/{writer}/{len(added)}"
            assert store.add(league, end(identity))
            added.append(identity)
            stored.release()
        return added

    with Store(url) as one, Store(url) as other, ThreadPoolExecutor(4) as pool:
        one.enter("friday", FACTS, 1)
        with one.lock("friday"):  # two write as a scheduler does, through its lock, and two without
            writers = [pool.submit(add, store, writer) for writer, store in enumerate((one, one, other, other))]
            try:
                for _ in range(4):
                    for _ in range(50):
                        assert stored.acquire(timeout=WAIT_S)
                    cluster.kill()
                    cluster.start()
            finally:
                is_enough.set()
            added = [identity for writer in writers for identity in writer.result()]

    assert len(added) >= 200
    with Store(url, make=False) as store:
        assert [outcome.identity for outcome in store.outcomes(store.get("friday"))] == sorted(added)


def test_a_match_whose_server_died_before_it_answered_is_stored_once(cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    with Store(cluster.make_database()) as store, store.lock("friday"):
        league, deaths = store.enter("friday", FACTS, 1), []

        commit = store._engine.dialect.do_commit

        def commit_and_die(connection: Any) -> None:
            commit(connection)
            if not deaths:
                deaths.append(1)
                cluster.kill()
                cluster.start()
                raise psycopg.OperationalError("server closed the connection unexpectedly")

        monkeypatch.setattr(store._engine.dialect, "do_commit", commit_and_die)
        assert store.add(league, end("friday/0"))
        assert deaths
        assert not store.add(league, end("friday/0"))
        assert store.outcomes(league) == [end("friday/0")]
        assert any(reading.metric is STORE_FAILURES and reading.values for reading in store.readings())


def test_a_lock_is_taken_again_from_a_server_that_came_back(cluster: Any) -> None:
    url = cluster.make_database()
    with Store(url) as store, store.lock("friday"):
        league = store.enter("friday", FACTS, 1)
        cluster.kill()
        cluster.start()
        assert store.add(league, end("friday/0"))

        with Store(url) as second, pytest.raises(TakenError), second.lock("friday"):
            pass


def test_who_lost_the_lock_while_the_server_was_away_does_not_write(cluster: Any) -> None:
    url = cluster.make_database()
    with Store(url, patience_s=0.5) as store, Store(url) as second, store.lock("friday"):
        league = store.enter("friday", FACTS, 1)
        cluster.kill()
        cluster.start()

        with second.lock("friday"), pytest.raises(TakenError, match="another scheduler runs league friday"):
            store.add(league, end("friday/0"))
        assert second.count(league) == 0


def test_a_lock_is_let_go_though_its_server_is_gone(cluster: Any) -> None:
    with Store(cluster.make_database(), patience_s=0) as store:
        with store.lock("friday"):
            league = store.enter("friday", FACTS, 1)
            cluster.kill()
        cluster.start()
        with store.lock("friday"):
            assert store.add(league, end("friday/0"))


def test_a_server_that_stays_away_is_one_sentence(cluster: Any, caplog: pytest.LogCaptureFixture) -> None:
    with Store(cluster.make_database(), patience_s=0.5) as store:
        league = store.enter("friday", FACTS, 1)
        store.add(league, end("friday/0"))
        cluster.kill()

        with pytest.raises(StoreError, match=r"cannot write to the store postgresql://.*; its server must run"):
            store.add(league, end("friday/1"))
        assert len([record for record in caplog.records if "trying again for" in record.message]) == 1

        cluster.start()
        assert store.identities(league) == {"friday/0"}


def test_a_user_who_may_not_write_is_told_so(cluster: Any) -> None:
    url = cluster.make_database()
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("DROP ROLE IF EXISTS guest")
        connection.execute("CREATE ROLE guest LOGIN PASSWORD 'guest'")

    with pytest.raises(StoreError, match=r"permission denied .*; its owner must let this user in"):
        Store(cluster.url(url.rpartition("/")[2], user="guest", password="guest"))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"password": "wrong"}, "password authentication failed .*; correct the user or the password"),
        ({"user": "nobody"}, "password authentication failed .*; correct the user or the password"),
        ({"database": "gone"}, 'database "gone" does not exist; make it with createdb'),
    ],
)
def test_a_door_that_does_not_open_says_why_and_no_password(cluster: Any, wrong: dict[str, str], said: str) -> None:
    url = cluster.url(**{"database": "postgres"} | wrong)

    with pytest.raises(StoreError, match=said) as caught:
        Store(url)
    assert "\n" not in str(caught.value)
    assert all(word not in str(caught.value) for word in ("wrong", "secret"))


def test_the_commands_read_a_store_in_postgresql_and_refuse_in_one_sentence(cluster: Any, arena: Arena) -> None:
    url = cluster.make_database()
    with Store(url) as store:
        store.add(store.enter("friday", FACTS, 1), end("friday/0"))

    told = arena("tournament", "status", "--db", url, "--json")
    refused = arena("tournament", "status", "--db", url.replace("arena:", "stranger:"))

    assert (told.returncode, '"played": 1' in told.stdout) == (0, True)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)


@pytest.mark.parametrize("url", ["postgresql://a:hush@127.0.0.1:1/arena", "postgresql://a:hush@/arena?host=/nowhere"])
def test_a_server_that_is_not_there_is_one_sentence(url: str) -> None:
    with pytest.raises(StoreError, match="its server must run, and let itself be reached") as caught:
        Store(url)

    assert "hush" not in str(caught.value)


def test_a_missing_driver_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)

    with pytest.raises(StoreError, match=r"needs psycopg, .*pip install 'arena-pit\[postgres\]'"):
        Store("postgresql://here/arena")


@pytest.mark.parametrize("url", ["mysql://a:hush@here/arena", "postgresql://a:hush@here:port/arena", "://a:hush@here"])
def test_a_place_that_is_none_is_refused_without_its_password(url: str) -> None:
    with pytest.raises(StoreError, match=r"name a file, or a URL|must be a file, or a URL") as caught:
        Store(url)

    assert "hush" not in str(caught.value)


@pytest.mark.parametrize("name", ["2027-01-31T18:00", "what?now", "a%20b", "100%"])
def test_a_store_lies_in_its_file_whatever_that_is_called(name: str, tmp_path: Path) -> None:
    file = tmp_path / name / "arena.db"
    file.parent.mkdir()

    with Store(str(file)) as store, store.lock("friday"):
        store.enter("friday", FACTS, 1)
        assert {path.name for path in file.parent.iterdir()} >= {"arena.db", "arena.db.friday.lock"}

    assert [path.name for path in tmp_path.iterdir()] == [name]
    with Store(str(file), make=False) as store:
        assert store.latest().name == "friday"


FILL_THE_DISK = """
import resource, sys
from pathlib import Path
from test_store_troubles import FACTS, end
from tournaments.store.store import Store, StoreError
file = Path(sys.argv[1])
with Store(str(file)) as store:
    league = store.enter("friday", FACTS, 1)
    for number in range(1_000_000):
        try:
            store.add(league, end(f"friday/{number}"))
        except StoreError as error:
            print(number, error)
            break
        if number == 20:  # from here on, no file grows
            largest = max(path.stat().st_size for path in file.parent.iterdir())
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    print(store.count(league))
"""


def test_a_disk_that_takes_no_more_is_one_sentence_and_keeps_what_it_has(tmp_path: Path) -> None:
    command = [sys.executable, "-c", FILL_THE_DISK, str(tmp_path / "arena.db")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, Path(__file__).parents[:2]))}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python would cut that short as well, and not notice
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=WAIT_S, check=False)

    assert done.returncode == 0, done.stderr
    said, n_stored = done.stdout.splitlines()
    assert said.partition(" ")[0] == n_stored
    assert "make room on its disk and run this again; nothing that was stored is lost" in said
    with Store(str(tmp_path / "arena.db"), make=False) as store:
        assert store.identities(store.latest()) == {f"friday/{number}" for number in range(int(n_stored))}
        assert store.add(store.latest(), end("friday/more"))


@contextmanager
def read_only(folder: Path) -> Iterator[list[str]]:
    """Take the right to write from a folder and its files, and return what starts a program that root's powers do not save."""
    is_mighty = os.geteuid() == 0 and shutil.which("setpriv")
    paths = [folder, *folder.iterdir()]
    for path in paths:
        path.chmod(0o555)
    try:
        yield ["setpriv", "--bounding-set=-dac_override,-dac_read_search"] if is_mighty else []
    finally:
        for path in paths:
            path.chmod(0o755)


def test_a_read_only_store_is_read_and_a_league_in_it_refused_in_one_sentence(tmp_path: Path) -> None:
    folder, league = tmp_path / "data", tmp_path / "friday.toml"
    league.write_text('pairs = 1\nseed = 1\nentries = ["rush", "patrol"]')
    folder.mkdir()
    with Store(str(folder / "arena.db")) as store:
        store.add(store.enter("friday", FACTS, 1), end("friday/0"))

    def arena(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [*prefix, sys.executable, "-c", "from tournaments.cli import main; main()", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=WAIT_S, check=False)

    with read_only(folder) as prefix:
        told = arena("tournament", "status", "--data", folder, "--json")
        ran = arena("tournament", "run", league, "--data", folder)

    assert (told.returncode, '"played": 1' in told.stdout) == (0, True), told.stderr
    assert (ran.returncode, ran.stderr.count("\n")) == (2, 1), ran.stderr
    assert ran.stderr.startswith("arena: ")
