"""A pit that goes on: entries and matches come while it plays, and whoever is killed in it, nothing is lost or counted twice."""

import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

import pytest
from family import PATIENCE_S, kill
from network_settings import make_setting, plan, sessions

import tournaments.venues.client_pool as client_pool
import tournaments.venues.network as network
import tournaments.venues.processes as tournament_processes
from arena.game.types import Termination
from arena.keyring.files import load_or_make
from arena.match.time_control import TimeControl
from arena.records.plan import MatchPlan
from tournaments.outcome import Outcome
from tournaments.venues.client_pool import choose
from tournaments.venues.local import play as play_local
from tournaments.venues.network import NetworkPit
from tournaments.venues.referee_process import MOST_PLANS, Addition, Done, Message, News
from tournaments.venues.setting import Fighter, VenueSetting

RUSH, PATROL, RANDOM = (Fighter(spec=name) for name in ("rush", "patrol", "random"))


def receive_until(pit: NetworkPit, is_so: Callable[[], bool]) -> list[Outcome]:
    """Receive what ends until something is so."""
    outcomes = pit.receive()
    give_up_at_s = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < give_up_at_s, outcomes
        outcomes += pit.receive()
    return outcomes


def receive_all(pit: NetworkPit) -> list[Outcome]:
    return receive_until(pit, lambda: pit.n_left == 0) + pit.receive()


def played_locally(setting: VenueSetting, plans: list[MatchPlan], folder: Path) -> dict[str, object]:
    entries = {"one": "rush", "two": "patrol", "three": "random"}
    setting = replace(setting, entries=entries, journals=folder)
    return {outcome.identity: outcome.result for outcome in play_local(setting, plans)}


def results(outcomes: list[Outcome]) -> dict[str, object]:
    found = {outcome.identity: outcome.result for outcome in outcomes}
    assert len(found) == len(outcomes), "a match counts once"
    return found


def clients_of(folder: Path) -> dict[str, set[int]]:
    return {name: found for name in ("one", "two", "three") if (found := sessions(f"--name {name} ", str(folder)))}


@pytest.mark.usefixtures("one_core")
def test_entries_and_matches_come_while_it_plays_and_whoever_is_killed_nothing_is_lost_or_counted_twice(tmp_path: Path) -> None:
    setting = replace(make_setting(tmp_path), most_clients=2)
    first, second, third = plan("one", "two", 2), plan("one", "three", 2), plan("three", "two")
    with NetworkPit(setting) as pit:
        pit.add({"one": RUSH, "two": PATROL}, first)
        outcomes = receive_until(pit, lambda: pit.n_left < len(first))
        [referee] = [child for child in multiprocessing.active_children() if child.name == "referee"]
        assert referee.pid is not None
        kill(referee.pid)
        pit.add({"three": RANDOM}, second)
        outcomes += receive_until(pit, lambda: "three" in clients_of(tmp_path) and pit.n_left < len(first) + len(second) - 1)
        assert len(clients_of(tmp_path)) <= 2, "two had nothing to play any more"
        for pid in clients_of(tmp_path)["three"]:
            kill(pid)
        pit.add({}, third)
        outcomes += receive_all(pit)
        clients = clients_of(tmp_path)

    assert len(clients) == 2, "who has nothing to play stays for a while"
    assert not clients_of(tmp_path)
    assert results(outcomes) == played_locally(setting, [*first, *second, *third], tmp_path / "local")


def test_who_joins_by_itself_stays_while_it_has_nothing_to_play_and_idle_clients_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client_pool, "IDLE_S", 0.1)
    key = tmp_path / "far.key"
    far = Fighter(spec="key:", public_key=load_or_make(key).public)
    setting = replace(make_setting(tmp_path, one="rush", far="key:"), remote={"far": far.public_key or b""})
    matches = plan("far", "one")
    with NetworkPit(setting) as pit:
        pit.add({}, matches[:1])
        pit.receive()
        assert not clients_of(tmp_path), "nobody waits for who has not joined"
        player = subprocess.Popen(
            [sys.executable, "-c", "from tournaments.cli import main; main()", "join", str(pit.address), "--name", "far", "--key",
             str(key), "--forever", "--policy", "patrol", "--no-transcripts", "--no-audit", "--slots", "2"],
            stderr=subprocess.PIPE, text=True, env={**os.environ, "ARENA_CONFIG": str(tmp_path / "config")},
        )  # fmt: skip
        try:
            outcomes = receive_all(pit)
            receive_until(pit, lambda: not clients_of(tmp_path))
            assert pit.present == {"far"}
            pit.add({}, matches[1:])
            outcomes += receive_all(pit)
            assert player.poll() is None
            pit.finish()
            receive_until(pit, lambda: player.poll() is not None)
            for _ in range(tournament_processes.MOST_DEATHS + 2):
                assert not pit.receive(), "a referee that is done has not died"
        finally:
            player.kill()
            said = player.communicate()[1]

    assert player.returncode == 0, said
    assert set(results(outcomes)) == {match.identity for match in matches}
    assert {outcome.result.ending for outcome in outcomes}.isdisjoint((Termination.FORFEIT, Termination.VOID))


def test_the_matches_of_a_client_that_never_sits_down_and_what_is_withdrawn_are_void_and_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tournament_processes, "MOST_DEATHS", 0)
    monkeypatch.setattr(tournament_processes, "_PATIENCE_S", 1)
    setting = replace(make_setting(tmp_path), time_control=TimeControl(turn_time_s=None, grace_s=0.1))
    far, near = (Fighter(spec="key:", public_key=load_or_make(tmp_path / f"{name}.key").public) for name in ("far", "near"))
    entries = {"one": RUSH, "two": PATROL, "three": Fighter(spec="no-such-fighter"), "far": far, "near": near}
    withdrawn = plan("far", "near", MOST_PLANS)
    with NetworkPit(setting) as pit:
        pit.add(entries, [*withdrawn, *plan("one", "three"), *plan("one", "two")])
        pit.withdraw(["far"], "it has not come")
        outcomes = receive_all(pit)
        assert pit.failing == {"three"}

    gone = [outcome for outcome in outcomes if "far" in (outcome.blue, outcome.red)]
    outcomes = [outcome for outcome in outcomes if outcome not in gone]
    assert {outcome.identity for outcome in gone} == {match.identity for match in withdrawn}
    assert {(outcome.result.ending, outcome.result.reason) for outcome in gone} == {(Termination.VOID, "it has not come")}
    void = [outcome for outcome in outcomes if "three" in (outcome.blue, outcome.red)]
    played = [outcome for outcome in outcomes if outcome not in void]
    assert [outcome.result.ending for outcome in void] == [Termination.VOID] * 2
    assert f"the client of three died 1 times in a row; {setting.journals / 'three.log'} says why" == void[0].result.reason
    assert len(played) == 2
    assert Termination.VOID not in {outcome.result.ending for outcome in played}


def test_an_entry_that_is_another_and_a_match_that_cannot_be_played_are_refused(tmp_path: Path) -> None:
    pit = NetworkPit(make_setting(tmp_path))
    matches = plan("one", "two")

    with pytest.raises(ValueError, match=r"is played by two, which is no entry of this pit"):
        pit.add({"one": RUSH}, matches)
    pit.add({"one": RUSH, "two": PATROL}, matches[:1])
    with pytest.raises(ValueError, match=r"the entry one is another than it was"):
        pit.add({"one": PATROL}, matches[1:])
    with pytest.raises(ValueError, match=r"is on the plan already"):
        pit.add({}, matches)
    assert pit.n_left == 1


def test_those_who_play_have_a_process_then_those_of_the_first_matches_whose_opponents_are_there() -> None:
    matches = [plan(*names)[0] for names in (("a", "far"), ("b", "c"), ("c", "d"), ("a", "b"))]

    def chosen(most: int, *, is_there: bool = False) -> list[str]:
        return list(choose(plan("b", "x")[:1], matches, "abcdx", lambda _: is_there, most))

    assert chosen(5) == ["b", "x", "c", "d", "a"]
    assert chosen(3) == ["b", "x", "c"]
    assert chosen(3, is_there=True) == ["b", "x", "a"]


class ReplacedReferee:
    """A referee that dies once it has said that the first match has begun, and is replaced by one that finds no journal of it."""

    def __init__(self, *_: object) -> None:
        self._identities: list[str] = []
        self._n_received = 0

    def __enter__(self) -> "ReplacedReferee":
        return self

    def __exit__(self, *_: object) -> None:
        """No process is there."""

    def start(self, known: Addition, dismissed: Collection[str], *, is_finished: bool) -> None:
        """Be there."""

    def tell(self, message: Message) -> None:
        if isinstance(message, Addition):
            self._identities += [one.identity for one in message.plans]

    def reap(self) -> None:
        """Be gone."""

    def receive(self, wait_s: float) -> list[Outcome | News | Done]:
        self._n_received += 1
        if self._n_received == 1:
            return [News(begun=self._identities[:1], waiting=frozenset())]
        raise EOFError


def test_a_match_that_its_referee_took_along_before_the_first_tick_waits_for_its_entries_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(network, "RefereeProcess", ReplacedReferee)
    keys = {name: load_or_make(tmp_path / f"{name}.key").public for name in ("far", "near")}
    with NetworkPit(make_setting(tmp_path)) as pit:
        pit.add({name: Fighter(spec="key:", public_key=key) for name, key in keys.items()}, plan("far", "near")[:1])
        assert not pit.receive()
        assert pit.present == {"far", "near"}

        assert not pit.receive()

        assert not pit.present
        assert pit.awaited == {"far", "near"}
