"""A relay for spectators, over real sessions: what the pit says comes through, once it is asked; what a player does, does not."""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from queue import SimpleQueue
from typing import Any

import pytest

import clients.relay
from arena.network.address import Address, free_port
from arena.network.asking import ask
from arena.network.session import Broadcast, Query, Session, open_client, open_router, read_payload
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import sign_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import JournalRequest, Refusal
from clients.relay import Relay

WAIT_S = 30.0
PIT = Identity.make()


class World:
    """A pit's router that answers, a relay of it, and whoever comes to the relay."""

    def __init__(self, stack: ExitStack) -> None:
        at_pit, self.at_relay = (Address(endpoint=f"tcp/127.0.0.1:{free_port()}", pit="p") for _ in range(2))
        self.asked: SimpleQueue[str] = SimpleQueue()
        self.may_answer = threading.Event()
        self.pit = stack.enter_context(open_router(at_pit.endpoint, "p"))
        for key in (topics.join("p"), topics.lobby("p"), topics.all_journals("p")):
            self.pit.answer(key, self._answer)
        self.public = self.pit.broadcast(topics.public("p", "m"))
        self.truth = self.pit.broadcast(topics.truth("p", "m"))
        router = stack.enter_context(open_router(self.at_relay.endpoint, "p", for_players=False))
        heard = threading.Event()
        relay = Relay(at_pit, None, router, lambda key: None, lambda words: heard.set())
        thread = threading.Thread(target=relay.run)
        thread.start()
        stack.callback(thread.join)
        stack.callback(relay.stop)
        assert heard.wait(WAIT_S)
        self._stack = stack

    def _answer(self, query: Query) -> None:
        self.asked.put(query.key)
        if query.key == topics.join("p"):
            query.answer(encode(sign_challenge("p", PIT, bytes(32), bytes(16))))
            return
        threading.Thread(target=lambda: self.may_answer.wait(WAIT_S) and query.answer(b"facts")).start()

    def come(self) -> Session:
        return self._stack.enter_context(open_client(self.at_relay.endpoint))


@pytest.fixture
def world() -> Iterator[World]:
    with ExitStack() as stack:
        yield World(stack)


def wait_until(is_so: Callable[[], bool]) -> None:
    tick = threading.Event()
    for _ in range(int(WAIT_S / 0.01)):
        if is_so():
            return
        tick.wait(0.01)
    pytest.fail("it does not come to be so")


def test_spectators_hear_through_it_what_the_pit_says_and_it_wants_boards_only_for_those_who_do(world: World) -> None:
    heard: list[SimpleQueue[bytes]] = [SimpleQueue() for _ in range(3)]
    watchers = [world.come() for _ in heard]
    ends = [
        watcher.subscribe(key, lambda sample, at=at: at.put(read_payload(sample)))  # type: ignore[misc]  # mypy knows no defaults of lambdas
        for watcher, at, key in zip(watchers, heard, [topics.all_public("p")] * 2 + [topics.truth("p", "m")], strict=True)
    ]

    def tell(what: Broadcast, said: bytes, to: SimpleQueue[bytes]) -> None:
        wait_until(lambda: what.put(said) is None and not to.empty())
        assert to.get() == said

    for at in heard[:2]:
        tell(world.public, b"facts", at)
    tell(world.truth, b"sealed", heard[2])
    ends[2]()
    wait_until(lambda: not world.truth.has_subscribers)
    assert world.public.has_subscribers


def test_what_many_ask_the_pit_is_asked_once(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients.relay, "_FRESH_S", 10 * WAIT_S)
    answers: SimpleQueue[bytes] = SimpleQueue()
    question = topics.journal("p", "m"), encode(JournalRequest(offset=0))
    assert world.asked.get(timeout=WAIT_S) == topics.join("p")
    n = 20
    for watcher in (world.come(), world.come()):
        for _ in range(n // 2):
            watcher.ask(*question, answers.put, WAIT_S)
    assert world.asked.get(timeout=WAIT_S) == question[0]
    world.may_answer.set()

    assert [answers.get(timeout=WAIT_S) for _ in range(n)] == [b"facts"] * n
    assert world.asked.empty()


def test_those_who_wait_for_one_answer_are_not_without_bound(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients.relay, "_MOST_WHO_WAIT", 5, raising=False)
    answers: SimpleQueue[bytes] = SimpleQueue()
    watcher = world.come()
    for _ in range(20):
        watcher.ask(topics.lobby("p"), b"", answers.put, WAIT_S)

    refused = [answers.get(timeout=WAIT_S) for _ in range(15)]
    world.may_answer.set()

    assert refused == [b""] * 15
    assert [answers.get(timeout=WAIT_S) for _ in range(5)] == [b"facts"] * 5


def test_nobody_plays_through_it(world: World) -> None:
    actions: SimpleQueue[Any] = SimpleQueue()
    world.pit.subscribe(topics.all_actions("p"), actions.put)
    player = world.come()
    put, _ = player.publisher("arena/p/lane/0/blue/action")
    put(b"orders")

    answer = decode(ask(player, world.at_relay, topics.join("p"), b"a sealed request"))

    assert answer == Refusal(reason="this is a relay for spectators; join at the pit itself")
    assert actions.empty()
    assert world.asked.get(timeout=WAIT_S) == topics.join("p")  # for the relay itself
    assert world.asked.empty()
