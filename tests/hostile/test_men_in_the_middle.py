"""Who stands between a client and its pit, or in the pit's place, or claims another's name: each is refused with a sentence."""

import json
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import zenoh

from arena.errors import ForgedError, LostPitError
from arena.game.types import Team
from arena.keyring.files import load_or_make
from arena.keyring.ring import entry_key_path
from arena.network.address import Address, free_port, parse_address
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.handshake import new_secret, sign_challenge
from arena.protocol.identity import Identity
from arena.protocol.messages import Challenge, Ended, Lobby, Orders, Ready, Refusal, SealedAnswer, Signed, Ticket, Turn, Wait
from arena.protocol.signed import STATEMENT_VERSION
from arena.records.journal_folder import load_journal
from arena.records.replay import verify
from clients.commands.connecting import trust
from clients.runner import Runner
from clients.settings import ClientSettings
from policies import registry

Start = Callable[..., Any]
Here = Callable[..., tuple[int, str]]
PATIENCE_S = 60.0
Change = Callable[[bytes, bytes], bytes]
"""What the one who asked is told, given the question and the pit's answer; nothing if it is b""."""


def open_session(**settings: Any) -> zenoh.Session:
    config = zenoh.Config()
    for key, value in {"scouting/multicast/enabled": False, **settings}.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def flip(data: bytes) -> bytes:
    return data[:-1] + bytes([data[-1] ^ 1])


class Middleman:
    """A router that victims take for the pit's; it passes on what they say, and what they are told."""

    def __init__(
        self, port: int, change: Change = lambda asked, answer: answer, pass_on: Callable[[bytes], list[bytes]] | None = None
    ):
        self.port, self._change = free_port(), change
        """Where it listens."""
        self.n_passed = 0
        pass_on = pass_on or (lambda data: [data])
        endpoint = {"connect/endpoints": [f"tcp/127.0.0.1:{port}"]}
        self._pit = open_session(mode="client", **endpoint)
        self._victim = open_session(mode="router", **{"listen/endpoints": [f"tcp/127.0.0.1:{self.port}"]})
        remote = zenoh.Locality.REMOTE
        for key in (topics.join("pit"), topics.lobby("pit"), topics.all_journals("pit")):
            self._victim.declare_queryable(key, zenoh.handlers.Callback(self._ask))
        for one, other, key in (
            (self._victim, self._pit, topics.all_actions("pit")),
            (self._pit, self._victim, topics.all_observations("pit")),
        ):

            def carry(other: zenoh.Session, sample: zenoh.Sample) -> None:
                for data in pass_on(sample.payload.to_bytes()):
                    self.n_passed += 1
                    block = zenoh.CongestionControl.BLOCK
                    other.put(sample.key_expr, data, congestion_control=block, allowed_destination=remote)

            one.declare_subscriber(key, zenoh.handlers.Callback(partial(carry, other)))

    def _ask(self, query: zenoh.Query) -> None:
        asked, key = query.payload.to_bytes() if query.payload else b"", str(query.key_expr)

        def heard(reply: zenoh.Reply) -> None:
            answer = self._change(asked, reply.ok.payload.to_bytes()) if reply.ok else b""
            if answer:
                query.reply(key, answer)

        self._pit.get(key, zenoh.handlers.Callback(heard, query.drop), payload=asked, timeout=20.0)

    def close(self) -> None:
        for session in (self._victim, self._pit):
            session.close()


@pytest.fixture
def middleman(port: int) -> Iterator[Callable[..., Middleman]]:
    """Put somebody between the pit and those who connect to its port."""
    with ExitStack() as running:

        def begin(**options: Any) -> Middleman:
            one = Middleman(port, **options)
            running.callback(one.close)
            return one

        yield begin


def address(pit: Any, port: int | None = None) -> str:
    """Return what a pit says to join it with; or that pit's key at another port."""
    said: str = pit.said.partition("join with: arena join ")[2].split()[0]
    return said if port is None else f"arena://127.0.0.1:{port}/pit#{said.partition('#')[2]}"


def lobby(one: Any) -> Lobby:
    signed = decode(one.query(topics.lobby("pit"), b""))
    assert isinstance(signed, Signed)
    said = decode(signed.data, STATEMENT_VERSION)
    assert isinstance(said, Lobby)
    return said


def await_guest(one: Any) -> None:
    """Wait until somebody waits for an opponent."""
    end_s = time.monotonic() + PATIENCE_S
    while not lobby(one).waiting:
        assert time.monotonic() < end_s


def later(do: Callable[..., Any], *arguments: Any, **options: Any) -> Future[Any]:
    """Do something that waits for what comes next."""
    return ThreadPoolExecutor().submit(do, *arguments, **options)


def play(blue: Any, red: Any, n_ticks: int) -> tuple[bytes, bytes]:
    """Play a whole match, and return what each ordered in every tick."""
    actions = b"\1" * 6, b"\2" * 6
    for seat in (blue, red):
        seat.say(Ready(known_ticks=0))
    for tick in range(n_ticks):
        for seat, wanted in zip((blue, red), actions, strict=True):
            assert seat.next(Turn).tick == tick
            seat.say(Orders(tick=tick, actions=wanted), tick)
    for seat in (blue, red):
        assert seat.next(Ended).ticks == n_ticks
    return actions


def sit_down(blue: Any, blue_name: str, red: Any, red_name: str) -> None:
    seats = [later(one.sit, name=name, team=team) for one, name, team in ((blue, blue_name, "blue"), (red, red_name, "red"))]
    for seat in seats:
        seat.result(PATIENCE_S)


# Requests


def test_a_request_that_comes_a_second_time_is_refused_and_its_owner_keeps_seat_and_keys(
    serve: Start, stranger: Start, tmp_path: Path
) -> None:
    pit = serve("--matches", 1, "--set", "tick_limit=3", "--turn-time", 60)
    ann, bob, eve = stranger(), stranger(), stranger()
    attempt = ann.attempt(name="ann", team="blue")

    def replay() -> None:
        for one in (eve, ann):
            answer = decode(one.query(topics.join("pit"), attempt.sealed))
            assert isinstance(answer, Refusal), answer
            assert answer.reason == "a request comes a second time"

    waiting = later(ann.query, topics.join("pit"), attempt.sealed)
    await_guest(eve)
    replay()
    bob.sit(name="bob", team="red")
    ticket = attempt.open(waiting.result(PATIENCE_S))
    assert isinstance(ticket, Ticket)
    replay()
    ann.take(attempt, ticket)
    ann.match, ann.lane, ann.team = ticket.match, ticket.lane, Team.BLUE
    ann.session.declare_subscriber(topics.observation("pit", ticket.lane, Team.BLUE), ann._hear)
    for seat in (ann, bob):
        seat.say(Ready(known_ticks=0))
    for tick in range(3):
        for seat, actions in ((ann, b"\1" * 6), (bob, b"\2" * 6)):
            assert seat.next(Turn).tick == tick
            replay()
            seat.say(Orders(tick=tick, actions=actions), tick)

    assert not any(ann.next(Ended).faults["blue"].values())
    assert pit.finish() == 0
    (path,) = (tmp_path / "journals").glob("*.journal")
    journal = load_journal(path)
    assert verify(journal) == 3
    assert [tick.orders for tick in journal.ticks] == [b"\1" * 6 + b"\2" * 6] * 3


def test_an_answer_opens_for_its_own_request_alone(serve: Start, stranger: Start) -> None:
    serve()
    ann, eve = stranger(), stranger()
    first, second = (ann.attempt(team="green", slot=slot) for slot in (0, 1))
    others = eve.attempt(team="green")
    answers = [one.query(topics.join("pit"), attempt.sealed) for one, attempt in ((ann, first), (ann, second), (eve, others))]

    for number, attempt in enumerate((first, second, others)):
        for other, answer in enumerate(answers):
            if number == other:
                assert isinstance(attempt.open(answer), Refusal)
            else:
                with pytest.raises(ForgedError, match="an answer does not open"):
                    attempt.open(answer)
        with pytest.raises(ForgedError, match="an answer is not sealed"):
            attempt.open(encode(Refusal(reason="no")))


# A man in the middle


def runner(where: Address, **options: Any) -> tuple[Runner, list[object]]:
    """Return a client that is told an address as `arena join` is, and what it has to say as it plays."""
    said: list[object] = []
    settings = ClientSettings(
        endpoint=where.endpoint,
        pit=where.pit,
        make=registry.load("rush"),
        n_matches=1,
        trust=lambda pit_key: trust(where, pit_key, said.append),
        **options,
    )
    return Runner(settings, on_seat=said.append, on_end=said.append, on_wait=said.append), said


def test_nobody_plays_whose_answers_a_man_in_the_middle_makes_up(
    serve: Start, start: Start, stranger: Start, middleman: Start
) -> None:
    pit = serve()
    guest = later(stranger().sit, team="red", name="guest")
    await_guest(stranger())  # so that whoever asks for red as well is answered at once
    true, rival = address(pit).partition("#")[2], Identity.make()
    kept: list[bytes] = []

    def say_no(asked: bytes, answer: bytes) -> bytes:
        return encode(Refusal(reason="go away")) if isinstance(decode(answer), SealedAnswer) else answer

    def say_nothing_new(asked: bytes, answer: bytes) -> bytes:
        if isinstance(decode(answer), SealedAnswer):
            kept.append(answer)
            return kept[0] if len(kept) > 1 else b""  # the first answer, which its own client has never had
        return answer

    def change(asked: bytes, answer: bytes) -> bytes:
        return flip(answer) if isinstance(decode(answer), SealedAnswer) else answer

    def show_own_key(asked: bytes, answer: bytes) -> bytes:
        return encode(sign_challenge("pit", rival, new_secret(), new_secret()))

    def put_own_key_in(asked: bytes, answer: bytes) -> bytes:
        said = decode(answer)
        assert isinstance(said, Challenge)
        own = Challenge(pit_key=said.pit_key, sealing_key=rival.public, number=said.number, signature=said.signature)
        return encode(own)

    goes_on = "no pit called pit answers at tcp/127.0.0.1:"
    both_keys = f"has the key {rival.fingerprint}, the address says {true}: another pit stands there, or the address is old"
    victims = {
        start("join", address(pit, middleman(change=one).port), "--name", one.__name__, "--team", "red"): said
        for one, said in ((say_no, (1, f"arena: {goes_on}")), (show_own_key, (2, both_keys)))
    }
    others = [
        runner(parse_address(address(pit, middleman(change=one).port)), name=one.__name__, team="red")
        for one in (say_nothing_new, change, put_own_key_in)
    ]

    for ending, (_, heard) in [(later(other.run), (other, heard)) for other, heard in others]:
        with pytest.raises(LostPitError, match=goes_on):
            ending.result(PATIENCE_S)
        assert heard == [], "nobody said anything to it that it believed"
    for victim, (exit_code, sentence) in victims.items():
        assert victim.finish() == exit_code, victim.said
        assert sentence in victim.said
        assert "go away" not in victim.said
        assert "the pit says no" not in victim.said
        assert "match " not in victim.said
        assert "Traceback" not in victim.said
    assert len(kept) > 1
    assert not guest.done()


def test_what_a_man_in_the_middle_says_in_the_pits_name_or_adds_is_counted_and_changes_nothing(
    serve: Start, start: Start, join: Start, middleman: Start, tmp_path: Path
) -> None:
    pit = serve("--matches", 1, "--turn-time", 20)
    n_refused = 0
    said: list[bytes] = []

    def say_no_at_first(asked: bytes, answer: bytes) -> bytes:
        nonlocal n_refused
        if n_refused == 3 or not isinstance(decode(answer), SealedAnswer):
            return answer
        n_refused += 1
        return encode(Refusal(reason="go away"))

    def add(data: bytes) -> list[bytes]:
        said.append(data)
        return [flip(data), said[0], bytes(200), data, data]

    between = middleman(change=say_no_at_first, pass_on=add)
    victim = start("join", address(pit, between.port), "--name", "victim", "--team", "red")
    other = join("--policy", "roomba")

    assert victim.finish() == 0, victim.said
    assert [process.finish() for process in (other, pit)] == [0, 0]
    assert n_refused == 3
    assert "go away" not in victim.said
    assert "the journal is of this match, under the keys that the pit committed itself to" in victim.said
    assert between.n_passed > 100
    (path,) = (tmp_path / "journals").glob("*.journal")
    journal = load_journal(path)
    assert verify(journal) > 0
    assert not any(mark for tick in journal.ticks for mark in tick.marks)
    assert "red " in pit.said.partition("counted: ")[2]
    assert "forged" in pit.said.partition("counted: ")[2]
    assert "blue" not in pit.said.partition("counted: ")[2]


def test_a_pit_that_has_another_key_than_before_is_refused_until_its_old_key_is_forgotten(
    serve: Start, join: Start, arena_here: Here, stranger: Start, port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ARENA_CONFIG", str(tmp_path / "config"))
    place = f"127.0.0.1:{port}/pit"
    look_in = ("join", f"arena://{place}", "--rules", "gym-cap")  # which is not played there, so nobody waits
    first = serve()
    old = address(first)
    eve = stranger()
    sealed_to_the_first = eve.attempt().sealed
    exit_code, said = arena_here(*look_in)
    assert (exit_code, "the pit plays ruleset paper" in said) == (1, True), said
    assert f"this pit is new here; from now on {place} must show the key {old.partition('#')[2]}" in said
    first.kill()
    known = (tmp_path / "config" / "known_pits").read_bytes()

    second = serve("--data", tmp_path / "second")
    new = address(second)
    assert new != old
    changed, (exit_code, named) = join(), arena_here("join", old)
    assert changed.finish() == exit_code == 2
    keys = f"from {old.partition('#')[2]} to {new.partition('#')[2]}"
    assert f"arena: the key of the pit at {place} has changed {keys}: either its operator made a new one, or" in changed.said
    assert f"arena keys forget {place}" in changed.said
    assert "another pit stands there, or the address is old" in named
    assert (tmp_path / "config" / "known_pits").read_bytes() == known
    refused = decode(stranger().query(topics.join("pit"), sealed_to_the_first))
    assert isinstance(refused, Refusal)
    assert "it was sealed to another pit, or to this one before it started" in refused.reason

    assert arena_here("keys", "forget", place)[0] == 0
    exit_code, said = arena_here(*look_in)
    assert (exit_code, "the pit plays ruleset paper" in said) == (1, True), said
    assert f"this pit is new here; from now on {place} must show the key {new.partition('#')[2]}" in said


# Names and invites


def test_a_name_belongs_to_the_key_that_finished_a_match_under_it_until_it_is_released(
    serve: Start, arena_here: Here, stranger: Start, tmp_path: Path
) -> None:
    pit = serve("--set", "tick_limit=1", "--turn-time", 60)
    ann, bob, eve = stranger(), stranger(), stranger()
    sentence = (
        "the name ann belongs to another key; choose one with --name, or ask the operator for `arena admin release-name ann`"
    )
    sit_down(stranger(), "ann", stranger(), "bob")
    assert not (tmp_path / "register.json").exists(), "a name that has finished no match is nobody's"
    sit_down(ann, "ann", bob, "bob")
    play(ann, bob, 1)

    assert eve.ask(name="ann") == Refusal(reason=sentence)
    pit.kill()
    pit = serve("--set", "tick_limit=1", "--turn-time", 60)
    ann, bob, eve = (stranger(identity=one.identity) for one in (ann, bob, eve))
    assert eve.ask(name="ann") == Refusal(reason=sentence)
    exit_code, said = arena_here("join", address(pit), "--name", "ann")
    assert exit_code == 1
    assert f"arena: the pit says no: {sentence}" in said
    assert eve.ask(name="ann", match="whatever") == Refusal(reason=sentence)
    sit_down(ann, "ann", bob, "bob")

    exit_code, said = arena_here("admin", "release-name", "ann", "--pit", address(pit), "--data", tmp_path)
    assert exit_code == 0
    assert "the name ann is free" in said
    sit_down(eve, "ann", stranger(), "cid")  # it is whose who comes


def test_an_invite_is_for_the_first_key_that_comes_with_it(
    serve: Start, join: Start, arena_here: Here, stranger: Start, tmp_path: Path
) -> None:
    (tmp_path / "codes").write_text("first-code  # for ann\nsecond-code\n")
    pit = serve("--invite", tmp_path / "codes")
    own_key = load_or_make(entry_key_path("ann"))  # as `arena join` has it
    owner = later(stranger(identity=own_key).sit, name="ann", invite="first-code")
    eve = stranger()
    await_guest(eve)
    assert lobby(eve).needs_invite
    refused = {
        "": "this pit wants an invite code; join with --invite CODE",
        "no-code": "the invite code is none of this pit's",
        "first-code": "the invite code was used by another key",
    }

    for code, sentence in refused.items():
        assert eve.ask(invite=code) == Refusal(reason=sentence)
        exit_code, said = arena_here("join", address(pit), "--name", "bob", *(("--invite", code) if code else ()))
        assert exit_code == 1
        assert said.splitlines()[-1] == f"arena: the pit says no: {sentence}"
    assert not owner.done()
    pit.kill()

    serve("--invite", tmp_path / "codes")
    eve = stranger()
    assert eve.ask(invite="first-code") == Refusal(reason="the invite code was used by another key")
    process = join("--name", "ann", "--invite", "first-code")
    await_guest(eve)
    assert isinstance(eve.ask(invite="second-code", match="none"), Wait)
    later(eve.sit, invite="second-code").result(PATIENCE_S)
    process.wait_for("against eve")
