"""Clients that lie, shout, stop or hang, spoken to the referee by raw Zenoh."""

import os
import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgpack
import pytest

from arena.errors import ForgedError
from arena.game.types import RULES_VERSION, Team
from arena.protocol import topics
from arena.protocol.codec import MOST_BYTES, decode, encode
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    PROTOCOL_VERSION,
    Closed,
    Ended,
    JoinRequest,
    Orders,
    Ready,
    Refusal,
    SealedRequest,
    Signed,
    Ticket,
    Turn,
    Wait,
)
from arena.protocol.signed import read_statement
from arena.records.journal import Mark
from arena.records.journal_folder import load_journal
from arena.records.replay import verify
from clients.seat_session import SeatSession

Start = Callable[..., Any]
PATIENCE_S = 60.0


def sit_down(blue: Any, red: Any) -> Ticket:
    """Begin a match of two strangers, ann's and bob's, and hear its first turn; return blue's ticket."""
    with ThreadPoolExecutor() as pool:
        tickets = [pool.submit(blue.sit, name="ann", team="blue"), pool.submit(red.sit, name="bob", team="red")]
        for ticket in tickets:
            ticket.result(PATIENCE_S)
    for seat in (blue, red):
        seat.say(Ready(known_ticks=0))
    for seat in (blue, red):
        assert seat.next(Turn).tick == 0
    return tickets[0].result()


def settle(one: Any) -> None:
    """Wait until the referee has dealt with all that came over a session's link: it then answers a second question."""
    for _ in range(2):
        assert one.query(topics.lobby("pit"), b"")


def test_junk_is_counted_and_the_match_ends(serve: Start, play_here: Start, stranger: Start, tmp_path: Path) -> None:
    pit = serve("--matches", 1, "--set", "tick_limit=12", "--turn-time", 20)
    eve = stranger()
    honest = play_here("patrol", team="blue")
    while b"patrol" not in eve.query(topics.lobby("pit"), b""):
        pass  # it is on its way
    eve.sit(team="red")
    eve.say(Ready(known_ticks=-(2**63)))
    eve.next(Turn)
    forged = [b"", b"junk", os.urandom(300), bytes(MOST_BYTES), bytes(MOST_BYTES + 1), encode(Orders(tick=0, actions=bytes(6)))]
    for junk in forged:
        eve.put(junk)
    for junk in (bytes(100_000), os.urandom(3_000_000)):
        eve.put(junk)  # goes no further than the router
    garbled = [b"", b"junk", os.urandom(300), os.urandom(50_000), msgpack.packb([99, 0]), encode(Closed(reason="no"))]
    for junk in garbled:
        eve.say(junk)
    stale = [Orders(tick=-1, actions=b""), Orders(tick=2**63, actions=b"x" * 50_000), Orders(tick=5, actions=bytes(6))]
    for orders in stale:
        eve.say(orders)
    eve.say(Ready(known_ticks=2**63))
    for key in ("arena/pit/lane/other/red/action", "arena/pit/lane/*/*/action", f"arena/pit/lane/{eve.lane}/green/action"):
        eve.say(Orders(tick=0, actions=bytes(6)), key=key)
    for tick, actions in enumerate([b"", b"\x01", bytes(50_000), b"\x09" * 6, b"\xff" * 6, *[b"\x02" * 6] * 7]):
        eve.say(Orders(tick=tick, actions=actions), 2**32 - 1 - tick)  # where it says that it belongs is of no matter
        if tick < 11:
            eve.say(second := Orders(tick=tick, actions=b"\x01" * 6))
            stale.append(second)
            while eve.next(Turn).tick != tick + 1:
                pass

    ended = eve.next(Ended)
    assert (honest.result(PATIENCE_S), pit.finish()) == (1, 0)
    (path,) = (tmp_path / "journals").glob("*.journal")
    journal = load_journal(path)
    assert verify(journal) == 12
    assert [tick.marks[Team.RED] for tick in journal.ticks] == [Mark.UNREADABLE] * 5 + [Mark(0)] * 7
    assert [list(tick.orders[6:]) for tick in journal.ticks[:6]] == [[0] * 6, [1, *[0] * 5], [0] * 6, [0] * 6, [0] * 6, [2] * 6]
    counts = {"late": 0, "unreadable": 5, "stale": len(stale), "garbled": len(garbled), "forged": len(forged), "vanished": 0}
    assert ended.faults == {"red": counts, "blue": dict.fromkeys(counts, 0)}
    assert ", ".join(f"red {n} {what}" for what, n in counts.items() if n) in pit.said
    assert "Traceback" not in pit.said


def check_whose_a_seat_is(holder: Any, stranger: Start) -> None:
    """A seat is given to its own key alone, and not while its holder is there."""
    enemy, thief = stranger(), stranger()
    second = stranger(identity=holder.identity)
    token = holder.session.liveliness().declare_token(topics.presence("pit", "ann", holder.client))
    blue = ThreadPoolExecutor().submit(holder.sit, name="ann", team="blue")
    enemy.sit(name="bob", team="red")
    ticket = blue.result(PATIENCE_S)

    for other in (thief, second):
        assert isinstance(other.ask(name="ann", team="blue"), Closed), "not even before its holder was ready"
    holder.say(Ready(known_ticks=0))
    enemy.say(Ready(known_ticks=0))
    assert holder.next(Turn).tick == 0
    for other in (thief, second):
        assert isinstance(other.ask(name="ann", team="blue", match=ticket.match), Wait)
    token.undeclare()

    seated = second.ask(name="ann")
    while not isinstance(seated, Ticket):
        seated = second.ask(name="ann")
    assert (seated.match, seated.team) == (ticket.match, Team.BLUE)
    assert isinstance(thief.ask(name="ann"), Closed)


def test_no_request_brings_the_pit_down_and_a_seat_is_its_own_keys_alone(serve: Start, stranger: Start) -> None:
    serve("--matches", 1, "--grace", 30, "--turn-time", 60)
    eve = stranger()
    known = JoinRequest(rules_version=RULES_VERSION, name="eve", team="any", client="eve", slot=0)
    of_another_version = msgpack.packb([99, *msgpack.unpackb(eve.attempt().sealed)[1:]])

    for raw, reason in (
        (b"", "the request cannot be read"),
        (b"junk", "the request cannot be read"),
        (os.urandom(100), "the request cannot be read"),
        (bytes(MOST_BYTES), "the request cannot be read"),
        (bytes(MOST_BYTES + 1), "the request cannot be read"),
        (msgpack.packb([99, 0]), f"the other side speaks version 99 of the protocol; this is version {PROTOCOL_VERSION}"),
        (of_another_version, f"the other side speaks version 99 of the protocol; this is version {PROTOCOL_VERSION}"),
        (encode(Ready(known_ticks=0)), "this is no request for a seat"),
        (encode(known), "this is no request for a seat"),
        (encode(SealedRequest(sealed=b"")), "a request does not open"),
        (encode(SealedRequest(sealed=os.urandom(300))), "a request does not open"),
        (encode(SealedRequest(sealed=encode(known))), "a request does not open"),
    ):
        answer = decode(eve.query(topics.join("pit"), raw))
        assert isinstance(answer, Refusal), raw
        assert reason in answer.reason
    for changes, reason in (
        ({"rules_version": 99}, "the client knows version 99 of the rules, the pit 1; install the same"),
        ({"rules_hash": "0" * 64}, "the pit plays ruleset paper"),
        ({"team": "green"}, "there is no team 'green'; red, blue or any"),
        ({"name": "../../etc"}, "a name is 1 to 64 letters"),
        ({"name": ""}, "a name is 1 to 64 letters"),
        ({"name": "é\0"}, "a name is 1 to 64 letters"),
        ({"name": Identity.make().fingerprint}, "a name must not look like a public key"),
        ({"client": "**"}, "a name is 1 to 64 letters"),
        ({"slot": -1}, "there is no slot -1"),
        ({"slot": 2**63}, "there is no slot"),
    ):
        answer = eve.ask(**changes)
        assert isinstance(answer, Refusal), answer
        assert reason in answer.reason

    assert isinstance(eve.ask(match="m" * 50_000), Wait)
    check_whose_a_seat_is(eve, stranger)


def test_who_says_that_a_holder_is_gone_takes_nothing_from_it(serve: Start, stranger: Start, tmp_path: Path) -> None:
    pit = serve("--matches", 1, "--set", "tick_limit=4", "--grace", 60, "--turn-time", 60)
    holder, enemy, thief = stranger(), stranger(), stranger()
    key = topics.presence("pit", "ann", holder.client)
    ticket = sit_down(holder, enemy)
    for tick in range(4):
        forged = thief.session.liveliness().declare_token(key)
        settle(thief)
        forged.undeclare()
        settle(thief)
        assert isinstance(thief.ask(name="ann", team="blue"), Closed)
        assert isinstance(thief.ask(name="ann", team="blue", match=ticket.match, client=holder.client), Wait)
        if tick == 2:
            assert holder.sit(name="ann", team="blue", match=ticket.match).match == ticket.match, "it may come back as well"
        holder.say(Orders(tick=tick, actions=b"\x01" * 6))
        enemy.say(Orders(tick=tick, actions=b"\x02" * 6))
        if tick < 3:
            assert enemy.next(Turn).tick == tick + 1

    assert enemy.next(Ended).ending == "tick_limit"
    assert pit.finish() == 0
    (path,) = (tmp_path / "journals").glob("*.journal")
    journal = load_journal(path)
    assert verify(journal) == 4
    assert [tick.orders for tick in journal.ticks] == [b"\x01" * 6 + b"\x02" * 6] * 4


LISTENER = """
import json, sys, threading, zenoh
config = zenoh.Config()
config.insert_json5("mode", json.dumps("client"))
config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{sys.argv[1]}"]))
session = zenoh.open(config)
subscriber = session.declare_subscriber("arena/pit/lane/*/*/observation", lambda sample: None)
print("listening", flush=True)
threading.Event().wait()
"""


def test_a_stopped_listener_and_a_stopped_seat_make_no_other_match_late(
    serve: Start, join: Start, start: Start, play_here: Start, port: int, tmp_path: Path
) -> None:
    pit = serve("--matches", 3, "--turn-time", 2, "--bank", 0, "--missed", 60, "--grace", 60)
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

    players = [play_here(bot, name=name, n_matches=2) for name in ("ann", "bob")]

    assert [player.result(PATIENCE_S) for player in players] == [2, 2]
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


def test_who_missed_the_ending_learns_it_before_the_pit_is_gone(
    serve: Start, play_here: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    pit = serve("--matches", 1, "--set", "tick_limit=3")
    receive = SeatSession.receive

    def miss_the_ending(session: SeatSession, payload: bytes) -> list[bytes]:
        said = receive(session, payload)
        if session.seat.ended is None:
            return said
        session.seat.ended = None
        raise ForgedError("it was lost")

    monkeypatch.setattr(SeatSession, "receive", miss_the_ending)
    players = [play_here("patrol", name=name) for name in ("ann", "bob")]
    pit.wait_for("after 3 ticks")
    pit.send(signal.SIGTERM)

    assert [player.result(PATIENCE_S) for player in players] == [1, 1]
    assert pit.finish() == 0


def test_who_was_away_when_the_match_ended_is_told_how(serve: Start, play_here: Start, stranger: Start) -> None:
    pit = serve("--set", "tick_limit=3", "--turn-time", 0.05, "--bank", 0)
    eve = stranger()
    honest = play_here("patrol", team="blue")
    ticket = eve.sit(team="red")
    eve.say(Ready(known_ticks=0))
    assert honest.result(PATIENCE_S) == 1  # eve answers nothing: her units stay

    answer = eve.ask(match=ticket.match)

    assert isinstance(answer, Signed)
    ended = read_statement(answer, eve.pit_key)
    assert isinstance(ended, Ended)
    assert (ended.match, ended.ticks, ended.faults["red"]["late"]) == (ticket.match, 3, 3)
    assert "tick limit after 3 ticks" in pit.said
