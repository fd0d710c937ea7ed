"""Raw Zenoh sessions that know the protocol and need not keep to it, against real pits."""

import json
import subprocess
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh
from commands import join, port, serve, start

from arena.errors import ForgedError
from arena.game.types import RULES_VERSION, Team
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt
from arena.protocol.identity import Identity
from arena.protocol.messages import Challenge, ChallengeRequest, Ended, JoinRequest, Signed, Ticket, Wait
from arena.protocol.sealing import Opener, Sealer
from arena.protocol.signed import read_statement
from clients.runner import Runner
from clients.settings import ClientSettings
from policies import registry

__all__ = ["join", "port", "serve", "start"]

PATIENCE_S = 60.0


class Stranger:
    """A raw Zenoh session with an entry's key."""

    def __init__(self, port: int, identity: Identity | None = None, pit: str = "pit") -> None:
        config = zenoh.Config()
        for key, value in (
            ("mode", "client"),
            ("connect/endpoints", [f"tcp/127.0.0.1:{port}"]),
            ("scouting/multicast/enabled", False),
        ):
            config.insert_json5(key, json.dumps(value))
        self.session = zenoh.open(config)
        self.identity = identity or Identity.make()
        self.pit = pit
        self.client = uuid.uuid4().hex
        self.heard: SimpleQueue[Any] = SimpleQueue()
        """Messages that opened; signed facts as what they hold."""
        self.raw: list[tuple[str, bytes]] = []
        """All that came on the seat's key, as it came."""
        self.match = ""
        self.lane = 0
        self.team = Team.BLUE
        self.sealer: Sealer | None = None
        self.opener: Opener | None = None
        self.pit_key = b""

    def close(self) -> None:
        self.session.close()

    def query(self, key: str, payload: bytes) -> bytes:
        """Return the first answer to a query; b"" if there is none."""
        answers: SimpleQueue[bytes] = SimpleQueue()
        self.session.get(
            key,
            zenoh.handlers.Callback(
                lambda reply: answers.put(reply.ok.payload.to_bytes() if reply.ok else b""), lambda: answers.put(b"")
            ),
            payload=payload,
            timeout=30.0,
        )
        return answers.get(timeout=PATIENCE_S)

    def challenge(self) -> Challenge:
        """Ask for a challenge, and once more if nobody answered, as every client does."""
        question = topics.join(self.pit), encode(ChallengeRequest())
        challenge = decode(self.query(*question) or self.query(*question))
        assert isinstance(challenge, Challenge), challenge
        self.pit_key = challenge.pit_key
        return challenge

    def attempt(self, **changes: Any) -> Attempt:
        """Return a request for a seat, ready to be sent."""
        values = {"rules_version": RULES_VERSION, "name": "eve", "team": "any", "client": self.client, "slot": 0, **changes}
        return Attempt(self.identity, self.pit, self.challenge(), JoinRequest(**values))

    def ask(self, **changes: Any) -> Any:
        """Return what the pit answers to a request for a seat."""
        attempt = self.attempt(**changes)
        answer = attempt.open(self.query(topics.join(self.pit), attempt.sealed))
        if isinstance(answer, Ticket):
            self.take(attempt, answer)
        return answer

    def take(self, attempt: Attempt, ticket: Ticket) -> None:
        """Take the keys of a seat."""
        self.sealer, self.opener = attempt.sit(ticket.match, Team(ticket.team), ticket.secret)

    def sit(self, **changes: Any) -> Ticket:
        """Ask until there is a seat, and listen there."""
        answer = self.ask(**changes)
        while isinstance(answer, Wait):
            answer = self.ask(**changes)
        assert isinstance(answer, Ticket), answer
        if self.match != answer.match:
            self.match, self.lane, self.team = answer.match, answer.lane, Team(answer.team)
            self.session.declare_subscriber(topics.observation(self.pit, answer.lane, self.team), self._hear)
        return answer

    def _hear(self, sample: zenoh.Sample) -> None:
        data = sample.payload.to_bytes()
        self.raw.append((str(sample.key_expr), data))
        try:
            assert self.opener is not None
            message = decode(self.opener.open(data))
        except ForgedError:
            return
        self.heard.put(read_statement(message, self.pit_key) if isinstance(message, Signed) else message)

    def seal(self, message: Any, tick: int = 0) -> bytes:
        assert self.sealer is not None
        return self.sealer.close(message if isinstance(message, bytes) else encode(message), tick)

    def put(self, data: bytes, key: str = "") -> None:
        """Put raw bytes on the seat's action key, or on another."""
        self.session.put(
            key or topics.action(self.pit, self.lane, self.team), data, congestion_control=zenoh.CongestionControl.BLOCK
        )

    def say(self, message: Any, tick: int = 0, key: str = "") -> None:
        """Seal and put."""
        self.put(self.seal(message, tick), key)

    def next(self, kind: type) -> Any:
        """Return the next message of a kind."""
        while True:
            message = self.heard.get(timeout=PATIENCE_S)
            if isinstance(message, kind | Ended):
                assert isinstance(message, kind), message
                return message


@pytest.fixture
def stranger(port: int) -> Iterator[Callable[..., Stranger]]:
    """Enter the pit's network as a stranger."""
    with ExitStack() as sessions:

        def enter(**options: Any) -> Stranger:
            one = Stranger(port, **options)
            sessions.callback(one.close)
            return one

        yield enter


@pytest.fixture
def arena_here(here: Callable[..., subprocess.CompletedProcess[str]]) -> Callable[..., tuple[int, str]]:
    """Run `arena` in this process until it ends; return its exit code and what it said."""

    def run(*arguments: object) -> tuple[int, str]:
        done = here(*arguments)
        return done.returncode, done.stdout + done.stderr

    return run


@pytest.fixture
def play_here(port: int) -> Iterator[Callable[..., Future[int]]]:
    """Begin to play in the pit as `arena join` does, on a thread; what is returned says in the end how many matches ended."""
    with ExitStack() as running:

        def begin(policy: str | Path, **options: Any) -> Future[int]:
            usual = {"name": Path(policy).stem, "team": "any", "make": registry.load(str(policy)), "n_matches": 1}
            settings = ClientSettings(endpoint=f"tcp/127.0.0.1:{port}", pit="pit", **{**usual, **options})
            runner = Runner(settings, on_seat=lambda _: None, on_end=lambda _: None, on_wait=lambda _: None)
            running.callback(runner.stop)
            return ThreadPoolExecutor().submit(runner.run)

        yield begin
