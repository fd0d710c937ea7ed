"""Pages that watch one match by one server: what one of them brings along changes nothing for the others."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from arena.game.keys import MatchKeys
from arena.game.ruleset import load, rules_values
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.network.address import Address
from arena.protocol import topics
from arena.protocol.codec import MOST_LISTED, encode
from arena.protocol.identity import Identity
from arena.protocol.messages import Challenge, Lobby, PublicState, Truth
from arena.protocol.sealing import truth_sealer
from arena.records.journal import Header
from clients.spectator import MOST_CLOSED, SALT_BYTES
from clients.web import pit as pit_module
from clients.web.pit import PitClient

RULES = load("paper").with_({"side": 10, "tick_limit": 12})
MATCH, KEY, SALT = "0123456789abcdef", b"k" * 32, b"s" * SALT_BYTES
PIT = Identity.make()
N_TRUTHS = MOST_CLOSED + 3
PATIENCE_S = 60.0


class Payload(bytes):
    """A payload as Zenoh has it."""

    def to_bytes(self) -> bytes:
        return bytes(self)


class Sample:
    def __init__(self, key: str, payload: bytes) -> None:
        self.key_expr, self.payload = key, Payload(payload)


class Connection:
    """A session with a pit that says what the test says."""

    def __init__(self) -> None:
        self.heard: dict[str, Callable[[Any], None]] = {}

    def __enter__(self) -> "Connection":
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open."""

    def is_connected(self) -> bool:
        return True

    def subscribe(self, key: str, on_sample: Callable[[Any], None]) -> Callable[[], None]:
        self.heard[key] = on_sample
        return lambda: None


@pytest.fixture
def connection(monkeypatch: pytest.MonkeyPatch) -> Connection:
    made = Connection()
    challenge = Challenge(pit_key=PIT.public, sealing_key=b"", number=b"", signature=b"")
    monkeypatch.setattr(pit_module, "open_client", lambda *_: made)
    monkeypatch.setattr(pit_module, "ask_challenge", lambda *_: challenge)
    monkeypatch.setattr(pit_module, "ask_lobby", lambda *_: make_lobby(MATCH))
    return made


def make_lobby(*matches: str) -> Lobby:
    return Lobby(
        pit="pit", rules=RULES.name, rules_hash=RULES.hash, ruleset=rules_values(RULES), needs_invite=False, n_begun=1,
        running=[{"match": match, "blue": "ann", "red": "bob", "tick": 0} for match in matches], waiting=[],
    )  # fmt: skip


def truths() -> list[bytes]:
    keys = MatchKeys(map_key=bytes(32), match_key=bytes(32))
    header = Header(identity="pit/0/ann/bob", blue="ann", red="bob", ruleset=RULES, keys=keys)
    board, seen = Match(header, TimeControl(), 0.0).truth()
    sealer = truth_sealer(KEY, SALT, "pit", MATCH)
    return [SALT + sealer.close(encode(Truth(tick=tick, board=board, seen=seen)), tick) for tick in range(N_TRUTHS)]


def test_a_page_with_a_wrong_key_takes_no_board_from_one_with_the_right_key(connection: Connection) -> None:
    failures: list[dict[str, Any]] = []

    async def watch() -> list[str]:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, context: failures.append(context))
        client = PitClient(Address(pit="pit"), None, lambda _: None)
        serving = asyncio.create_task(client.run())
        with client.watch(MATCH, b"o" * 32), client.watch(MATCH, KEY) as right:
            while topics.truth("pit", MATCH) not in connection.heard:
                await asyncio.sleep(0)
            for truth in truths():
                connection.heard[topics.truth("pit", MATCH)](Sample(topics.truth("pit", MATCH), truth))
            kinds: list[str] = []
            async with asyncio.timeout(PATIENCE_S):
                while kinds.count("frame") < N_TRUTHS and not failures:
                    kinds.append((await right.messages.get())["kind"])
        serving.cancel()
        return kinds

    kinds = asyncio.run(watch())

    assert not failures
    assert kinds.count("frame") == N_TRUTHS


@pytest.mark.parametrize(("n_others", "runs"), [(MOST_LISTED, True), (MOST_LISTED - 1, False)])
def test_a_match_that_is_heard_runs_though_the_lobby_has_no_room_to_name_it(
    connection: Connection, monkeypatch: pytest.MonkeyPatch, n_others: int, *, runs: bool
) -> None:
    monkeypatch.setattr(pit_module, "ask_lobby", lambda *_: make_lobby(*(f"other-{number}" for number in range(n_others))))
    said = PublicState(tick=3, names=["ann", "bob"], living=[6, 6], score=0, commitment=bytes(32))

    async def look() -> tuple[bool, bool]:
        client = PitClient(Address(pit="pit"), None, lambda _: None)
        serving = asyncio.create_task(client.run())
        while topics.all_public("pit") not in connection.heard:
            await asyncio.sleep(0)
        connection.heard[topics.all_public("pit")](Sample(topics.public("pit", MATCH), encode(said)))
        await asyncio.sleep(0.1)
        found = await client.runs(MATCH), await client.runs("unheard")
        serving.cancel()
        return found

    assert asyncio.run(look()) == (runs, False)
