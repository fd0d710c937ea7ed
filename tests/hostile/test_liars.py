"""Clients that lie, shout, stop or hang, spoken to the referee by raw Zenoh."""

import json
import os
import signal
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import msgpack
import pytest
import zenoh

from arena.game.types import RULES_VERSION, Team
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.messages import Closed, Ended, JoinRequest, Orders, Ready, Refusal, Ticket, Turn, Wait
from arena.records.journal import Mark, load_journal
from arena.referee.replay import verify

PATIENCE_S = 60.0
Start = Callable[..., Any]


def test_junk_is_counted_and_the_match_ends(serve: Start, join: Start, stranger: Callable[[], Stranger], tmp_path: Path) -> None:
    pit = serve("--matches", 1, "--seed", 7, "--set", "tick_limit=12", "--turn-time", 20)
    eve = stranger()
    honest = join("--team", "blue", "--policy", "patrol")
    honest.wait_for("patrol waits for an opponent")
    eve.sit(team="red")
    eve.say(Ready(known_ticks=-(2**63)))
    garbled = [
        b"",
        b"junk",
        os.urandom(300),
        bytes(70_000),
        os.urandom(3_000_000),
        msgpack.packb([99, 0]),
        encode(Closed(reason="no")),
    ]
    eve.next(Turn)
    for junk in garbled:
        eve.say(junk)
    for orders in (Orders(tick=-1, actions=b""), Orders(tick=2**63, actions=b"x" * 50_000), Orders(tick=5, actions=bytes(6))):
        eve.say(orders)
    eve.say(Ready(known_ticks=2**63))
    for key in ("arena/pit/match/other/red/action", "arena/pit/match/*/*/action", f"arena/pit/match/{eve.match}/green/action"):
        eve.say(Orders(tick=0, actions=bytes(6)), key=key)
    for tick, actions in enumerate([b"", b"\x01", bytes(50_000), b"\x09" * 6, b"\xff" * 6, *[b"\x02" * 6] * 7]):
        eve.say(Orders(tick=tick, actions=actions))
        eve.say(Orders(tick=tick, actions=b"\x01" * 6))
        if tick < 11:
            while eve.next(Turn).tick != tick + 1:
                pass

    assert [process.finish() for process in (honest, pit)] == [0, 0]
    (path,) = (tmp_path / "journals").glob("*.journal")
    journal = load_journal(path)
    assert verify(journal) == 12
    assert [tick.marks[Team.RED] for tick in journal.ticks] == [Mark.UNREADABLE] * 5 + [Mark(0)] * 7
    assert [list(tick.orders[6:]) for tick in journal.ticks[:6]] == [[0] * 6, [1, *[0] * 5], [0] * 6, [0] * 6, [0] * 6, [2] * 6]
    assert "red 5 unreadable" in pit.said
    assert f"red {len(garbled)} garbled" in pit.said
    assert "stale" in pit.said
    assert "Traceback" not in pit.said + honest.said


def test_no_request_brings_the_pit_down(serve: Start, stranger: Callable[[], Stranger]) -> None:
    serve("--matches", 1)
    eve = stranger()

    for raw in (b"", b"junk", os.urandom(100), bytes(100_000), encode(Ready(known_ticks=0)), msgpack.packb([99, 0])):
        assert isinstance(eve.ask_raw(raw), Refusal), raw
    for changes, reason in (
        ({"version": 99}, "the client speaks version 99 of the protocol, the pit 1; install the same"),
        ({"rules_version": 99}, "the client knows version 99 of the rules, the pit 1; install the same"),
        ({"rules_hash": "0" * 64}, "the pit plays ruleset paper"),
        ({"team": "green"}, "there is no team 'green'; red, blue or any"),
        ({"name": "../../etc"}, "a name is 1 to 64 letters"),
        ({"name": ""}, "a name is 1 to 64 letters"),
        ({"name": "é\0"}, "a name is 1 to 64 letters"),
        ({"client": "**"}, "a name is 1 to 64 letters"),
        ({"slot": -1}, "there is no slot -1"),
        ({"slot": 2**63}, "there is no slot"),
    ):
        answer = eve.ask(**changes)
        assert isinstance(answer, Refusal), answer
        assert reason in answer.reason

    assert isinstance(eve.ask(match="m" * 50_000), Wait)
    assert isinstance(eve.ask(), Wait)


def test_a_seat_is_not_given_to_another_of_the_same_name_while_its_holder_is_there(
    serve: Start, stranger: Callable[[], Stranger]
) -> None:
    serve("--matches", 1, "--grace", 30)
    holder, enemy, thief = stranger(), stranger(), stranger()
    token = holder.session.liveliness().declare_token(topics.presence("pit", "ann", holder.client))
    blue = threading.Thread(target=lambda: holder.sit(name="ann", team="blue"))
    blue.start()
    ticket = enemy.sit(name="bob", team="red")
    blue.join(PATIENCE_S)

    assert isinstance(thief.ask(name="ann", team="blue"), Closed), "not even before its holder was ready"
    holder.say(Ready(known_ticks=0))
    enemy.say(Ready(known_ticks=0))
    assert holder.next(Turn).tick == 0
    assert isinstance(thief.ask(name="ann", team="blue", match=ticket.match), Wait)
    token.undeclare()

    seated = thief.ask(name="ann")
    while not isinstance(seated, Ticket):
        seated = thief.ask(name="ann")
    assert (seated.match, seated.team) == (ticket.match, Team.BLUE)


LISTENER = """
import json, sys, threading, zenoh
config = zenoh.Config()
config.insert_json5("mode", json.dumps("client"))
config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{sys.argv[1]}"]))
session = zenoh.open(config)
subscriber = session.declare_subscriber("**", lambda sample: None)
print("listening", flush=True)
threading.Event().wait()
"""


def test_a_stopped_listener_and_a_stopped_seat_make_no_other_match_late(
    serve: Start, join: Start, start: Start, port: int, tmp_path: Path
) -> None:
    pit = serve("--matches", 3, "--seed", 7, "--turn-time", 0.5, "--bank", 0, "--missed", 60, "--grace", 60)
    listener = start(port, code=LISTENER).wait_for("listening")
    stopped = [join("--team", "red", "--policy", "patrol"), join("--team", "blue", "--policy", "patrol", "--name", "held")]
    bot = tmp_path / "paced.py"
    bot.write_text(
        "import threading\n\ndef act(observation):\n    threading.Event().wait(0.02)\n    return [0] * len(observation.units)\n"
    )
    for process in stopped:
        process.wait_for("rules paper")
    listener.send(signal.SIGSTOP)
    stopped[1].send(signal.SIGSTOP)

    players = [join("--policy", bot, "--name", name, "--matches", 2) for name in ("ann", "bob")]

    assert [process.finish() for process in players] == [0, 0]
    assert "held" not in pit.said, "its match runs all the while"
    listener.send(signal.SIGCONT)
    stopped[1].send(signal.SIGCONT)
    assert pit.finish() == 0
    journals = [load_journal(path) for path in (tmp_path / "journals").glob("*.journal")]
    others = [journal for journal in journals if journal.header.blue in ("ann", "bob")]
    assert len(others) == 2
    for journal in others:
        assert verify(journal) > 0
        assert not any(mark & Mark.LATE for tick in journal.ticks for mark in tick.marks)
