"""No key and counter ever seal two messages, whoever is killed and comes back; every process writes down all that it seals."""

import json
import signal
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh

from arena.game.types import Team
from arena.protocol import topics
from arena.protocol.codec import decode
from arena.protocol.messages import History, Orders, Ready, Signed, Turn
from arena.records.journal_folder import load_journal
from arena.records.replay import verify

PATIENCE_S = 60.0
SALT_BYTES = 32
HEAD_BYTES = 12
Start = Callable[..., Any]
RECORDER = """
import json, os
from pathlib import Path
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from arena.protocol import sealing

class Recorder:
    def __init__(self, key):
        self._key, self._cipher, self.decrypt = key, ChaCha20Poly1305(key), ChaCha20Poly1305(key).decrypt

    def encrypt(self, nonce, data, associated):
        sealed = self._cipher.encrypt(nonce, data, associated)
        with (Path({folder!r}) / str(os.getpid())).open("a") as file:
            file.write(json.dumps([part.hex() for part in (self._key, nonce, data, associated, sealed)]) + "\\n")
        return sealed

sealing.ChaCha20Poly1305 = Recorder
from tournaments.cli import main
main()
"""
BOT = '''
"""Thinks at some ticks until there is a file to go on."""

import threading
from pathlib import Path


def act(observation):
    go = Path({folder!r}) / f"go-{{observation.tick}}"
    if observation.tick in {stops!r} and not go.exists():
        print(f"thinking at {{observation.tick}}", flush=True)
        while not go.exists():
            threading.Event().wait(0.05)
    return [observation.tick % 5] * len(observation.units)
'''


@dataclass(frozen=True)
class Sealed:
    """One message as a process sealed it."""

    key: bytes
    nonce: bytes
    data: bytes
    associated: bytes
    sealed: bytes


def read_records(path: Path) -> list[Sealed]:
    return [Sealed(*(bytes.fromhex(part) for part in json.loads(line))) for line in path.read_text().splitlines()]


class Listener:
    """All that can be heard of a pit, as it came."""

    def __init__(self, stranger: Any) -> None:
        self._heard: SimpleQueue[tuple[str, bytes]] = SimpleQueue()
        for shape in (topics.all_observations("pit"), topics.all_truths("pit"), topics.all_public("pit")):
            # On the thread that receives: each other callback has a thread of its own, and the order would be lost.
            stranger.session.declare_subscriber(shape, zenoh.handlers.Callback(self._hear, indirect=False))
        stranger.challenge()  # once it is answered, the router knows what we listen to

    def _hear(self, sample: zenoh.Sample) -> None:
        self._heard.put((str(sample.key_expr).split("/", 4)[-1], sample.payload.to_bytes()))

    def take(self, until: Callable[[str, bytes], bool]) -> dict[str, list[bytes]]:
        """Return the sealed messages by the rest of their keys, up to one."""
        heard: dict[str, list[bytes]] = defaultdict(list)
        while True:
            kind, payload = self._heard.get(timeout=PATIENCE_S)
            if kind != "public":
                heard[kind].append(payload[SALT_BYTES:] if kind == "truth" else payload)
            if until(kind, payload):
                return heard


def is_ending(kind: str, payload: bytes) -> bool:
    return kind == "public" and isinstance(decode(payload), Signed)


def count_of(message: bytes) -> int:
    return int.from_bytes(message[:8], "big")


def tick_of(message: bytes) -> int:
    return int.from_bytes(message[8:HEAD_BYTES], "big")


def test_no_key_and_counter_seal_two_messages_whoever_is_killed_and_comes_back(
    serve: Start, join: Start, stranger: Start, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    records = tmp_path_factory.mktemp("records")
    code = {"code": RECORDER.format(folder=str(records))}
    options = ("--matches", 1, "--turn-time", 60, "--grace", 60, "--set", "tick_limit=16")
    bot = tmp_path / "slow.py"
    bot.write_text(BOT.format(folder=str(tmp_path), stops=(4, 8)))
    pits = [serve(*options, **code)]
    before = Listener(stranger())
    own = ("--data", tmp_path / "transcripts")
    red = join("--team", "red", "--policy", "patrol", *own, **code)
    blues = [join("--team", "blue", "--policy", bot, "--name", "bot", *own, **code).wait_for("thinking at 4")]
    early = before.take(lambda kind, payload: kind == "truth" and tick_of(payload[SALT_BYTES:]) == 4)

    pits[0].kill()
    pits.append(serve(*options, **code).wait_for("1 unfinished matches wait for their seats to come back"))
    after = Listener(stranger())
    (tmp_path / "go-4").touch()
    blues[0].wait_for("thinking at 8")
    blues[0].kill()
    (tmp_path / "go-8").touch()
    blues.append(join("--team", "blue", "--policy", bot, "--name", "bot", *own, **code))
    late = after.take(is_ending)
    pits[1].send(signal.SIGTERM)

    assert [process.finish() for process in (blues[1], red, pits[1])] == [0, 0, 0], pits[1].said
    by_process = {process: read_records(records / str(process.process.pid)) for process in (*pits, red, *blues)}
    every = [record for of_process in by_process.values() for record in of_process]
    uses: dict[tuple[bytes, bytes], set[tuple[bytes, bytes]]] = defaultdict(set)
    for record in every:
        uses[record.key, record.nonce].add((record.data, record.associated))
    assert len(every) > 5 * 16
    assert all(len(messages) == 1 for messages in uses.values())

    owners: dict[bytes, set[Any]] = defaultdict(set)
    for process, of_process in by_process.items():
        for record in of_process:
            owners[record.key].add(process)
    assert all(len(processes) == 1 for processes in owners.values()), "a key seals in one process and one direction"
    assert all(len({record.key for record in by_process[process]}) >= n for process, n in ((pits[0], 3), (pits[1], 4), (red, 2)))

    known = {record.sealed: record for record in every}
    for heard in (early, late):
        for messages in heard.values():
            for message in messages:
                assert known[message[HEAD_BYTES:]].nonce == bytes(4) + message[:8]
    for kind in ("blue/observation", "red/observation", "truth"):
        again = [next(message for message in heard[kind] if tick_of(message) == 4) for heard in (early, late)]
        first, second = (known[message[HEAD_BYTES:]] for message in again)
        assert first.sealed != second.sealed
        assert first.key != second.key
        if kind == "truth":
            assert first.data == second.data
        starts = [message for heard in (early, late) for message in dict.fromkeys(heard[kind]) if count_of(message) == 0]
        assert len(starts) >= (3 if kind == "blue/observation" else 2)
        assert len({known[message[HEAD_BYTES:]].key for message in starts}) == len(starts)
        assert len({message[HEAD_BYTES:] for message in starts}) == len(starts)

    (path,) = (tmp_path / "journals").glob("*.journal")
    assert verify(load_journal(path)) == 16
    written = b"\0".join(file.read_bytes() for file in tmp_path.rglob("*") if file.is_file())
    assert not any(key in written or key.hex().encode() in written for key in owners), "no key is written down"


def test_a_turn_that_is_asked_for_again_is_the_very_bytes_that_it_was_or_stands_behind_all_that_was_sent(
    serve: Start, play_here: Start, stranger: Start
) -> None:
    serve("--matches", 1, "--turn-time", 60, "--set", "tick_limit=12")
    play_here("patrol", team="blue")
    eve = stranger()
    eve.sit(team="red")
    for _ in range(3):
        eve.say(Ready(known_ticks=0))
        assert eve.next(Turn).tick == 0
    assert len({data for _, data in eve.raw}) == 1

    eve.say(Orders(tick=0, actions=bytes(6)))
    assert eve.next(Turn).tick == 1
    eve.say(Ready(known_ticks=0))
    assert eve.next(History).first_tick == 0
    for _ in range(2):
        eve.say(Ready(known_ticks=1))
        assert eve.next(Turn).tick == 1
    sent = list(dict.fromkeys(data for _, data in eve.raw))
    assert [count_of(data) for data in sent] == list(range(len(sent)))
    assert len({data[HEAD_BYTES:] for data in sent}) == len(sent)
    assert eve.team is Team.RED
