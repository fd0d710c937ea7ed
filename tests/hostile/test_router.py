"""Against whoever speaks Zenoh itself: what our router lets through, and that those who play notice nothing.

That nothing arrives is shown by what arrives later over the same link, which keeps the order.
"""

import json
from collections.abc import Callable, Iterator
from queue import SimpleQueue
from threading import Event
from typing import Any

import pytest
import zenoh

from arena.game.types import Team
from arena.network.address import free_port
from arena.network.session import Session, open_client, open_router, read_key, read_payload
from arena.protocol import topics
from arena.protocol.codec import MOST_BYTES

WAIT_S = 10.0
OBSERVATION, ACTION = topics.observation("p", 7, Team.BLUE), topics.action("p", 7, Team.BLUE)
PUBLIC, TRUTH = topics.public("p", "m"), topics.truth("p", "m")
MARK = topics.action("p", 9, Team.RED)
ELSEWHERE = "arena/q/join"
Heard = SimpleQueue[tuple[str, bytes]]


def note(heard: Heard) -> Callable[[Any], None]:
    return lambda sample: heard.put((read_key(sample), read_payload(sample)))


def shout(enemy: zenoh.Session, key: str, payload: bytes) -> None:
    """Publish to others alone, and lose nothing on the way."""
    enemy.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK, allowed_destination=zenoh.Locality.REMOTE)


class Pit:
    """A router with what a referee has on it, and a player."""

    def __init__(self, endpoint: str, router: Session, player: Session) -> None:
        self.endpoint, self.router, self.player = endpoint, router, player
        self.referee_heard: Heard = SimpleQueue()
        self.player_heard: Heard = SimpleQueue()
        self.answers: SimpleQueue[bytes] = SimpleQueue()
        router.subscribe("**", note(self.referee_heard))
        router.subscribe(topics.all_actions("p"), lambda sample: None)  # what a client may know of, and sends to
        for key in (topics.join("p"), topics.lobby("p"), topics.submissions("p"), ELSEWHERE):
            router.answer(key, lambda question: question.answer(b"the pit's"))
        for key in (OBSERVATION, PUBLIC, TRUTH):
            player.subscribe(key, note(self.player_heard))
        self.act, _ = player.publisher(ACTION)

    def play(self) -> None:
        """Play a turn and ask for a seat: nobody hears anything but that."""
        self.act(b"orders")
        assert self.referee_heard.get(timeout=WAIT_S) == (ACTION, b"orders")
        for key in (TRUTH, PUBLIC, OBSERVATION):
            tell, end = self.router.publisher(key)
            tell(b"sight")
            end()
            assert self.referee_heard.get(timeout=WAIT_S) == (key, b"sight")  # it hears itself
            assert self.player_heard.get(timeout=WAIT_S) == (key, b"sight")
        assert self.ask(self.player, topics.join("p")) == b"the pit's"

    def ask(self, session: Session, key: str) -> bytes:
        """Return the answer, the only one; b"" if there is none."""
        session.ask(key, b"", self.answers.put, WAIT_S)
        answer = self.answers.get(timeout=WAIT_S)
        assert self.answers.empty()
        return answer

    def await_mark(self, enemy: zenoh.Session) -> None:
        """Wait until the router has dealt with all that an enemy sent: what is heard next is the mark that it put last."""
        shout(enemy, MARK, b"mark")
        assert self.referee_heard.get(timeout=WAIT_S) == (MARK, b"mark")


@pytest.fixture
def pit() -> Iterator[Pit]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with open_router(endpoint, "p") as router, open_client(endpoint) as player:
        pit = Pit(endpoint, router, player)
        pit.play()
        yield pit
        pit.play()
        assert pit.player_heard.empty()
        assert pit.referee_heard.empty()


@pytest.fixture(params=["client", "peer", "router"])
def enemy(pit: Pit, request: pytest.FixtureRequest) -> Iterator[zenoh.Session]:
    """A Zenoh session that is not ours; it may as well call itself a router."""
    config = zenoh.Config()
    settings = {
        "mode": request.param,
        "connect/endpoints": [pit.endpoint],
        "connect/timeout_ms": int(WAIT_S * 1000),
        "connect/exit_on_failure": True,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        tick = Event()
        for _ in range(int(WAIT_S / 0.01)):  # one that is no client is open before it is connected
            if list(session.info.routers_zid()):
                break
            tick.wait(0.01)
        pit.await_mark(session)
        yield session


def test_a_client_publishes_actions_and_nothing_else(pit: Pit, enemy: zenoh.Session) -> None:
    foreign = (topics.action("q", 7, Team.BLUE), f"{ACTION}/more", "arena/p/else", "elsewhere")
    for key in (OBSERVATION, PUBLIC, TRUTH, topics.join("p"), "arena/p/*/*/*/*", "arena/p/**", "**", *foreign):
        shout(enemy, key, b"forged")
        enemy.declare_publisher(key, allowed_destination=zenoh.Locality.REMOTE).put(b"forged")

    pit.await_mark(enemy)
    pit.play()


def test_a_client_deletes_nothing(pit: Pit, enemy: zenoh.Session) -> None:
    for key in (ACTION, OBSERVATION, PUBLIC, "**"):
        enemy.delete(key, congestion_control=zenoh.CongestionControl.BLOCK)

    pit.await_mark(enemy)
    pit.play()


def test_a_client_answers_nobody_in_place_of_the_pit(pit: Pit, enemy: zenoh.Session) -> None:
    asked: list[str] = []

    def answer(query: zenoh.Query) -> None:
        asked.append(str(query.key_expr))
        query.reply(query.key_expr, b"the rival's")

    for key in (topics.join("p"), topics.lobby("p"), topics.submissions("p"), topics.journal("p", "m"), "arena/p/*", "**"):
        enemy.declare_queryable(key, answer, complete=True)
    pit.await_mark(enemy)

    for session in (pit.player, pit.router):
        assert pit.ask(session, topics.lobby("p")) == b"the pit's"
        assert pit.ask(session, topics.join("p")) == b"the pit's"
        assert pit.ask(session, topics.journal("p", "m")) == b""
    assert asked == []


def test_a_client_asks_the_pit_and_nobody_else(pit: Pit, enemy: zenoh.Session) -> None:
    def ask(key: str) -> list[bytes]:
        replies = enemy.get(key, target=zenoh.QueryTarget.ALL, timeout=WAIT_S)
        return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]

    for key in (ELSEWHERE, "arena/p/*", "arena/*/join"):
        assert ask(key) == []
    assert ask(topics.join("p")) == [b"the pit's"]
    assert ask(topics.submissions("p")) == [b"the pit's"]
    assert pit.ask(pit.router, ELSEWHERE) == b"the pit's"  # for those who may


def test_what_is_too_long_is_dropped_and_nobody_waits(pit: Pit, enemy: zenoh.Session) -> None:
    for n_bytes in (100_000, 1_000_000, 10_000_000):
        shout(enemy, ACTION, bytes(n_bytes))
        pit.play()

        pit.await_mark(enemy)


def test_the_longest_message_is_not_too_long(pit: Pit, enemy: zenoh.Session) -> None:
    shout(enemy, ACTION, bytes(MOST_BYTES))

    assert pit.referee_heard.get(timeout=WAIT_S) == (ACTION, bytes(MOST_BYTES))


def test_a_client_subscribes_to_what_it_may_hear_or_to_nothing(pit: Pit, enemy: zenoh.Session) -> None:
    wide: Heard = SimpleQueue()
    sealed: Heard = SimpleQueue()
    for key in (
        "**",
        "arena/**",
        "arena/p/**",
        "arena/p/match/**",
        "arena/p/lane/**",
        "arena/*/lane/*/*/observation",
        "arena/p/lane/*/*/*",
    ):
        enemy.declare_subscriber(key, note(wide))
    for key in (ACTION, topics.all_actions("p")):
        enemy.declare_subscriber(key, note(wide))
    pit.await_mark(enemy)
    pit.play()

    enemy.declare_subscriber(topics.all_observations("p"), note(sealed))
    pit.await_mark(enemy)
    pit.play()

    assert sealed.get(timeout=WAIT_S) == (OBSERVATION, b"sight")
    assert sealed.empty()
    pit.await_mark(enemy)
    told = [wide.get() for _ in range(wide.qsize())]  # within the enemy's session, from what it was handed anyway
    assert len(told) <= 6
    assert set(told) <= {(OBSERVATION, b"sight")}


def test_a_client_does_not_learn_who_is_there(pit: Pit, enemy: zenoh.Session) -> None:
    came: SimpleQueue[str] = SimpleQueue()
    snooped: list[str] = []
    player, later, own = (topics.presence("p", name, "1") for name in ("player", "later", "enemy"))
    pit.router.watch_presence("**", lambda key, is_there: came.put(key))
    pit.player.declare_presence(player)
    assert came.get(timeout=WAIT_S) == player

    for key in ("**", topics.all_presence("p"), player):
        enemy.liveliness().declare_subscriber(key, lambda sample: snooped.append(str(sample.key_expr)), history=True)
        assert [str(reply.ok.key_expr) for reply in enemy.liveliness().get(key, timeout=WAIT_S) if reply.ok] == []
    sealed: Heard = SimpleQueue()
    enemy.declare_subscriber(topics.all_observations("p"), note(sealed))
    pit.await_mark(enemy)
    pit.player.declare_presence(later)
    assert came.get(timeout=WAIT_S) == later
    pit.play()

    assert sealed.get(timeout=WAIT_S) == (OBSERVATION, b"sight")
    assert snooped == []
    tokens = [enemy.liveliness().declare_token(key) for key in ("arena/p/else", topics.presence("q", "enemy", "1"), own)]
    assert came.get(timeout=WAIT_S) == own
    assert came.empty()
    del tokens  # one that nobody holds is withdrawn
    assert came.get(timeout=WAIT_S) == own
