"""A pit with a ladder, by real processes: who comes is matched and rated, and a pit that is killed goes on where it was."""

import json
import signal
import subprocess
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from commands import Command

from arena.game.types import Team, Termination
from arena.network.address import Address
from arena.network.session import open_client
from arena.policy import MatchResult
from arena.records.journal_folder import load_journal
from arena.records.replay import verify
from clients.lobby import ask_challenge, ask_lobby
from tournaments.ladder.ladder_store import LadderStore
from tournaments.ladder.skill import LadderEntry, rank, rate
from tournaments.store.schema import LADDER_MATCHES

Run = Callable[..., subprocess.CompletedProcess[str]]
ENTRIES = {"strong": "rush", "middle": "fighter", "weak": "random"}


@pytest.fixture
def enter(join: Callable[..., Command]) -> Callable[[str], Command]:
    """Have an entry play for ever."""
    return lambda name: join(
        "--forever", "--policy", ENTRIES[name], "--name", name, "--no-audit", "--no-transcripts", "--patience", 60
    )


def read_rows(data: Path) -> list[Any]:
    with LadderStore(str(data / "arena.db"), make=False) as store:
        query = LADDER_MATCHES.select().order_by(LADDER_MATCHES.c.id)
        return store._do("read", lambda connection: list(connection.execute(query)))


def read_standings(data: Path) -> list[dict[str, Any]]:
    with LadderStore(str(data / "arena.db"), make=False) as store:
        return rank(store.entries("pit"))


def rate_anew(rows: list[Any]) -> list[dict[str, Any]]:
    """Rate the stored matches from the first on."""
    players: dict[str, LadderEntry] = {}
    for row in rows:
        winner = None if row.winner is None else Team[row.winner.upper()]
        result = MatchResult(ending=Termination[row.ending.upper()], winner=winner, score=0, ticks=0, reason="")
        if result.ending is not Termination.VOID:
            seated = {
                Team.BLUE: players.get(row.blue, LadderEntry(key=row.blue_key, name=row.blue)),
                Team.RED: players.get(row.red, LadderEntry(key=row.red_key, name=row.red)),
            }
            players |= {player.name: player for player in rate(seated, result).values()}
    return rank(list(players.values()))


def test_a_killed_pit_goes_on_with_the_same_ratings_and_counts_no_result_twice(
    serve: Callable[..., Command], enter: Callable[[str], Command], arena: Run, port: int, tmp_path: Path
) -> None:
    pit = serve("--ladder", "--grace", 60)
    clients = [enter(name) for name in ENTRIES]
    pit.wait_for("pit/ladder/000004/")
    pit.kill()
    before = read_rows(tmp_path)

    pit = serve("--ladder", "--grace", 60)
    pit.wait_for("pit/ladder/000010/")
    for client in clients:
        client.wait_for("match ")
    with open_client(f"tcp/127.0.0.1:{port}") as session:
        address = Address(endpoint=f"tcp/127.0.0.1:{port}")
        lobby = ask_lobby(session, address, ask_challenge(session, address).pit_key)
    pit.send(signal.SIGTERM)
    assert pit.finish() == 0

    rows = read_rows(tmp_path)
    assert rows[: len(before)] == before
    identities = [row.identity for row in rows]
    ended = {
        journal.header.identity for path in (tmp_path / "journals").glob("*.journal") if (journal := load_journal(path)).ending
    }
    assert sorted(identities) == sorted(ended), "a result was lost, or counted twice"
    assert read_standings(tmp_path) == rate_anew(rows)
    assert {standing["name"] for standing in lobby.standings} == set(ENTRIES)
    shown = arena("leaderboard", "--ladder", "--data", tmp_path, "--json")
    assert json.loads(shown.stdout) == {"ladder": "pit", "standings": read_standings(tmp_path)}


def test_every_match_has_a_map_of_its_own_and_nobody_meets_the_same_opponent_for_ever(
    serve: Callable[..., Command], enter: Callable[[str], Command], tmp_path: Path
) -> None:
    pit = serve("--ladder", "--matches", 10)
    for name in ENTRIES:
        enter(name)
    assert pit.finish() == 0

    journals = [load_journal(path) for path in sorted((tmp_path / "journals").glob("pit+ladder+*.journal"))]
    for journal in journals:
        verify(journal)
    maps = {journal.header.keys.map_key for journal in journals}
    fixtures = [frozenset((journal.header.blue, journal.header.red)) for journal in journals]
    assert len(maps) == len(journals) == 10
    assert len(set(fixtures)) == 3
    assert sum(one == other for one, other in pairwise(fixtures)) < 9


def test_two_seats_of_one_entry_do_not_meet(
    serve: Callable[..., Command], join: Callable[..., Command], enter: Callable[[str], Command], tmp_path: Path
) -> None:
    pit = serve("--ladder", "--matches", 4)
    join("--forever", "--slots", 3, "--policy", "rush", "--name", "many", "--no-audit", "--no-transcripts")
    enter("weak")
    assert pit.finish() == 0

    assert [{row.blue, row.red} for row in read_rows(tmp_path)] == [{"many", "weak"}] * 4


def test_a_result_that_was_lost_with_the_pit_is_read_from_its_journal(
    serve: Callable[..., Command], enter: Callable[[str], Command], tmp_path: Path
) -> None:
    pit = serve("--ladder", "--matches", 3)
    clients = [enter(name) for name in ("strong", "weak")]
    assert pit.finish() == 0
    for client in clients:
        client.close()
    rows, standings = read_rows(tmp_path), read_standings(tmp_path)
    for name in ("arena.db", "arena.db-wal", "arena.db-shm"):  # all results are lost, not only the last ones
        (tmp_path / name).unlink(missing_ok=True)

    pit = serve("--ladder")
    pit.send(signal.SIGTERM)
    assert pit.finish() == 0

    found = read_rows(tmp_path)
    assert sorted(row.identity for row in found) == sorted(row.identity for row in rows)
    assert read_standings(tmp_path) == rate_anew(found)
    assert {row["name"]: row["wins"] for row in read_standings(tmp_path)} == {row["name"]: row["wins"] for row in standings}


def test_what_a_ladder_refuses_is_one_sentence(serve: Callable[..., Command], arena: Run, port: int, tmp_path: Path) -> None:
    pit = serve("--ladder")
    address, elsewhere = f"arena://127.0.0.1:{port}/pit", tmp_path / "elsewhere"

    red = arena("join", address, "--team", "red", "--policy", "rush", "--data", elsewhere)
    second = arena("serve", "--ladder", "--data", elsewhere, "--db", tmp_path / "arena.db", "--listen", "tcp/127.0.0.1:0")
    without = arena("serve", "--db", "x.db", "--data", elsewhere)
    nothing = arena("leaderboard", "--ladder", "--data", tmp_path)

    assert (red.returncode, red.stderr.splitlines()[-1]) == (
        1, "arena: the pit says no: on a ladder the pit gives out the teams; join with --team any",
    )  # fmt: skip
    assert (second.returncode, second.stderr.splitlines()[-1]) == (
        1, "arena: another pit of the name pit keeps its ladder in this store; choose another name with --pit",
    )  # fmt: skip
    assert (without.returncode, without.stderr) == (2, "arena: --db is where a ladder is kept; give --ladder as well\n")
    assert (nothing.returncode, nothing.stderr) == (2, "arena: the store holds no ladder yet; arena serve --ladder begins one\n")
    pit.send(signal.SIGTERM)
    assert pit.finish() == 0
