"""More than anybody means to say: junk on every key that a client may write to, and joins by thousands."""

import json
import random
import runpy
import statistics
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh

from arena.errors import ForgedError
from arena.game.types import RULES_VERSION, Team
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import Attempt
from arena.protocol.identity import Identity
from arena.protocol.messages import Challenge, Hello, JoinRequest, Knock, Lobby, Orders, Ready, Refusal, Signed, Ticket, Turn, Wait
from arena.protocol.facts import read_fact
from arena.referee.reception import MOST_GUESTS

Start = Callable[..., Any]
Enter = Callable[..., Any]
JOINS_A_SECOND = 2_000
N_FLOODERS = 2
RETRY_S = 0.25
"""As `clients.runner` does."""
PAUSE_S = 0.005
"""Of both players before each turn: a match of people and networks, not a benchmark."""
FLOODER = f"import runpy; runpy.run_path({__file__!r}, run_name='__main__')"


def flood(port: str, rate: str, n_joins: str) -> None:
    """Ask for seats, as a process of its own: signed requests of entries that nobody knows, the same again, junk, and Hello."""
    config = zenoh.Config()
    for key, value in (("mode", "client"), ("connect/endpoints", [f"tcp/127.0.0.1:{port}"]), ("scouting/multicast/enabled", False)):
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    import os
    os.nice(int(os.environ.get("NICE","0")))
    ((reply),) = session.get(topics.join("pit"), payload=encode(Hello()), timeout=30.0)
    challenge = decode(reply.ok.payload.to_bytes())
    assert isinstance(challenge, Challenge)
    chance = random.Random(port)

    def signed() -> bytes:
        name, client = f"n{uuid.uuid4().hex[:8]}", uuid.uuid4().hex
        request = JoinRequest(rules_version=RULES_VERSION, name=name, team="any", client=client, slot=0, invite="guessed")
        return Attempt(Identity.make(), "pit", challenge, request).knock

    joins: list[bytes] = []
    while len(joins) < int(n_joins):
        fresh = [signed() for _ in range(5)]
        junk = [encode(Knock(sealed=chance.randbytes(chance.randrange(500)))), chance.randbytes(300), encode(Hello())]
        joins += [*fresh, fresh[0], chance.choice(joins or fresh), *junk]
    n_answered = n_ended = 0

    def heard(reply: Any) -> None:
        nonlocal n_answered
        n_answered += 1

    def ended() -> None:
        nonlocal n_ended
        n_ended += 1

    begun_s = time.monotonic()
    print("flooding", flush=True)
    pause = threading.Event()
    for number, payload in enumerate(joins):
        ahead_s = begun_s + number / float(rate) - time.monotonic()
        if ahead_s > 0.002:
            pause.wait(ahead_s)
        session.get(topics.join("pit"), zenoh.handlers.Callback(heard, ended), payload=payload, timeout=10.0)
    took_s = time.monotonic() - begun_s
    print("sent", json.dumps({"rate": round(len(joins) / took_s), "answered": n_answered, "ended": n_ended}), flush=True)
    session.close()


if __name__ == "__main__":
    flood(*sys.argv[1:])


class Duel:
    """Two strangers of one match who play it in a thread, and time every turn."""

    def __init__(self, eve: Any, bob: Any) -> None:
        self.players = (eve, bob)
        self.turns_s: list[float] = []
        self.tick = 0
        for player in self.players:
            player.say(Ready(known_ticks=0))
        for player in self.players:
            player.next(Turn)

    def play(self, is_over: Callable[[], bool]) -> list[float]:
        """Play until told; return how long each turn took, from the last order to the next observation."""
        turns_s = []
        pause = threading.Event()
        while not is_over():
            pause.wait(PAUSE_S)
            for player in self.players:
                asked_s = time.perf_counter()
                player.say(Orders(tick=self.tick, actions=bytes(6)))
            self.tick += 1
            assert self.players[1].next(Turn).tick == self.tick
            turns_s.append(time.perf_counter() - asked_s)
            assert self.players[0].next(Turn).tick == self.tick
        return turns_s


def sit_both(eve: Any, bob: Any, **changes: Any) -> Duel:
    """Seat two strangers in one match."""
    thread = threading.Thread(target=lambda: eve.sit(name="eve", team="blue", **changes))
    thread.start()
    bob.sit(name="bob", team="red", **changes)
    thread.join()
    assert eve.match == bob.match
    return Duel(eve, bob)


def knock_until_answered(one: Any, **changes: Any) -> tuple[float, Any]:
    """Ask for a seat as a client does; return how long it took, and what was answered."""
    begun_s = time.monotonic()
    pause = threading.Event()
    while True:
        challenge = one.query(topics.join("pit"), encode(Hello()))
        if challenge:
            values = {"rules_version": RULES_VERSION, "team": "any", "client": one.client, "slot": 0, **changes}
            attempt = Attempt(one.identity, "pit", decode(challenge), JoinRequest(**values))
            answer = one.query(topics.join("pit"), attempt.knock)
            if answer:
                message = attempt.open(answer)
                if isinstance(message, Ticket):
                    one.take(attempt, message)
                return time.monotonic() - begun_s, message
        pause.wait(RETRY_S)


def resident_mb(process: Any) -> float:
    """Return how much memory a process has, in MB."""
    return int(Path(f"/proc/{process.process.pid}/statm").read_text().split()[1]) * 4096 / 1e6


@pytest.mark.parametrize("invites", [False, True], ids=["open", "invited"])
def test_a_flood_of_joins_slows_no_match_and_keeps_nobody_out(
    invites: bool, serve: Start, start: Start, stranger: Enter, port: int, size: Callable[[int, int], int], tmp_path: Path,
) -> None:
    seconds = size(2, 10)
    options: list[object] = []
    codes = [f"code-{number}" for number in range(9)]
    if invites:
        (tmp_path / "invites").write_text("\n".join(codes))
        options = ["--invite", tmp_path / "invites"]
    pit = serve("--seed", 7, "--turn-time", 60, "--grace", 3, "--set", "tick_limit=5000", *options)
    duel = sit_both(stranger(), stranger()) if not invites else None
    if duel is None:
        eve, bob = stranger(), stranger()
        thread = threading.Thread(target=lambda: eve.sit(name="eve", team="blue", invite=codes[0]))
        thread.start()
        bob.sit(name="bob", team="red", invite=codes[1])
        thread.join()
        duel = Duel(eve, bob)
    honest = stranger()

    end_s = time.monotonic() + 2
    quiet = duel.play(lambda: time.monotonic() > end_s)
    before = resident_mb(pit)
    rate = JOINS_A_SECOND / N_FLOODERS
    flooders = [start(port, rate, int(rate * seconds), code=FLOODER) for _ in range(N_FLOODERS)]
    for flooder in flooders:
        flooder.wait_for("flooding")
    import subprocess
    spy = 0 and subprocess.Popen(["/work/main/.venv/bin/py-spy","record","-r","500","-d",str(seconds),"-t","-f","raw","-o",f"/tmp/fl/spy-{invites}.txt","-p",str(pit.process.pid)])
    cpu0 = sum(map(int, Path(f"/proc/{pit.process.pid}/stat").read_text().split()[13:15]))
    t0=time.monotonic()
    answers = []
    thread = threading.Thread(target=lambda: answers.append(knock_until_answered(honest, name="honest", invite=codes[2])))
    thread.start()
    mems = []
    def over():
        if time.monotonic() - t0 > len(mems): mems.append(resident_mb(pit))
        return all("sent" in flooder.said for flooder in flooders)
    busy = duel.play(lambda: over() and all("sent" in flooder.said for flooder in flooders))
    cpu1 = sum(map(int, Path(f"/proc/{pit.process.pid}/stat").read_text().split()[13:15]))
    t1=time.monotonic()
    after = resident_mb(pit)
    thread.join()
    print([f.said for f in flooders])
    print("quiet", statistics.median(quiet)*1e3, len(quiet), "busy", statistics.median(busy)*1e3, max(busy)*1e3, len(busy), "mem", before, after, mems, answers, "pit cpu", (cpu1-cpu0)/100/(t1-t0))
    lobby = read_fact(decode(stranger().query(topics.lobby("pit"), b"")), duel.players[0].pit_key)
    print(len(lobby.running), len(lobby.waiting), lobby.n_begun)
