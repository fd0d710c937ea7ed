"""Who listens on every key of a pit, and asks for every answer: what is heard is sealed, and its size and number tell nothing."""

import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh
from commands import Command

from arena.errors import ForgedError, LostPitError
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, philox_keys, secret_from_seed
from arena.game.ruleset import load
from arena.game.state import StateField
from arena.game.types import Team
from arena.keyring.files import load_secret
from arena.match.time_control import TimeControl
from arena.network.address import free_port
from arena.network.session import open_router
from arena.pit.effects import MatchEnded
from arena.pit.match_session import PitContext
from arena.pit.referee import Referee
from arena.pit.seating import PlannedSeating
from arena.protocol import topics
from arena.protocol.codec import decode, encode
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    Commitment,
    Ended,
    JournalPiece,
    JournalRequest,
    Orders,
    PublicState,
    Ready,
    Refusal,
    Signed,
    Ticket,
    Truth,
    Turn,
    Wait,
)
from arena.protocol.observation_codec import without_clock
from arena.protocol.sealing import Direction, Opener, derive_key, seat_context, truth_opener
from arena.protocol.signed import commit, read_statement, sign_receipt
from arena.records.journal import Journal, read_journal
from arena.records.journal_folder import load_journal
from arena.records.plan import MatchPlan
from arena.records.replay import replay
from arena.records.transcript import Head
from arena.records.verification import watch
from clients.runner import Runner
from clients.settings import ClientSettings
from policies import registry

PATIENCE_S = 60.0
PIECE_BYTES = 16
SALT_BYTES = 32
HEAD_BYTES = 12
TOLD = (topics.all_observations("pit"), topics.all_public("pit"), topics.all_truths("pit"))
"""What the router lets a client hear."""
SHAPES = (
    "**",
    "*/**",
    "arena/**",
    "arena/pit/**",
    "arena/pit/match/**",
    "arena/pit/lane/**",
    "arena/*/lane/*/*/observation",
    "arena/pit/lane/*/*/*",
    "arena/pit/match/*/*",
    topics.all_actions("pit"),
    topics.all_journals("pit"),
    topics.all_presence("pit"),
    topics.join("pit"),
    *TOLD,
)
SEATS = ("blue/observation", "red/observation")
Start = Callable[..., Any]


class Ear:
    """All that one session hears."""

    def __init__(self, session: zenoh.Session) -> None:
        self._told: SimpleQueue[tuple[str, bytes]] = SimpleQueue()
        self.heard: list[bytes] = []
        """Whatever came, on any shape, and its key."""
        self.present: list[str] = []
        self.messages: dict[str, list[tuple[str, bytes]]] = {}
        """By match: the rest of each key, and what came on it, in order, once."""
        for shape in SHAPES:
            # On the thread that receives: each other callback has a thread of its own, and the order would be lost.
            session.declare_subscriber(shape, zenoh.handlers.Callback(partial(self._hear, shape in TOLD), indirect=False))
            session.liveliness().declare_subscriber(shape, self._see, history=True)
        list(session.get(topics.lobby("pit"), timeout=PATIENCE_S))  # once it is answered, the router knows what we listen to

    def _hear(self, is_told: bool, sample: zenoh.Sample) -> None:
        self.heard.append(str(sample.key_expr).encode() + b" " + sample.payload.to_bytes())
        if is_told:
            self._told.put((str(sample.key_expr), sample.payload.to_bytes()))

    def _see(self, sample: zenoh.Sample) -> None:
        self.present.append(str(sample.key_expr))

    def wait_for_endings(self, n_matches: int) -> None:
        """Sort what comes until so many matches are over: that is said last."""
        of_match: list[tuple[str, bytes]] = []
        while n_matches:
            key, payload = self._told.get(timeout=PATIENCE_S)
            _, _, _, name, kind = key.split("/", 4)
            of_match.append((kind, payload))
            if kind == "public" and isinstance(decode(payload), Signed):  # one match after another is played
                self.messages[name], of_match = of_match, []
                n_matches -= 1


@dataclass
class Overheard:
    """A match, and what was heard of it."""

    journal: Journal
    messages: list[tuple[str, bytes]]

    @property
    def id(self) -> str:
        return self.journal.name

    def on(self, kind: str) -> list[bytes]:
        return [payload for each, payload in self.messages if each == kind]

    @cached_property
    def boards(self) -> list[bytes]:
        return [games.truth(0).tobytes() for games in replay(self.journal)]

    @cached_property
    def shown(self) -> list[list[bytes]]:
        return watch(self.journal)


@dataclass
class Evening:
    """All that a stranger heard in a pit."""

    ear: Ear
    matches: list[Overheard]
    pit_key: bytes
    spectator_key: bytes


def gather(ear: Ear, folder: Path) -> list[Overheard]:
    """Put what was heard beside the journals."""
    journals = [load_journal(path) for path in sorted((folder / "journals").glob("*.journal"))]
    return [Overheard(journal, ear.messages[journal.name]) for journal in journals]


def client(endpoint: str, policy: str, team: str, n_matches: int | None) -> Runner:
    """Return what plays as `arena join` does, and checks the journals."""
    settings = ClientSettings(
        endpoint=endpoint,
        pit="pit",
        name=policy,
        team=team,
        make=registry.load(policy),
        n_matches=n_matches,
        on_audit=lambda seat, verdict: None,
    )
    return Runner(settings, on_seat=lambda _: None, on_end=lambda _: None, on_wait=lambda _: None)


@pytest.fixture(scope="module")
def evening(size: Callable[[int, int], int], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Evening]:
    """Whole matches of different fighters on different maps, in one pit, with a stranger on every shape."""
    pairs = [("rush", "patrol"), ("spiral", "fighter"), ("roomba", "rush"), ("defend", "random"), ("fighter", "rush")][
        : size(2, 5)
    ]
    each, folder, address = size(2, 10), tmp_path_factory.mktemp("pit"), f"127.0.0.1:{free_port()}"
    config = zenoh.Config()
    settings = {"mode": "client", "connect/endpoints": [f"tcp/{address}"], "scouting/multicast/enabled": False}
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    with ExitStack() as stack:
        stack.enter_context(pytest.MonkeyPatch.context()).setenv("ARENA_CONFIG", str(tmp_path_factory.mktemp("config")))

        def start(*arguments: object) -> Command:
            command = Command("from tournaments.cli import main; main()", arguments)
            stack.callback(command.close)
            return command

        n_matches = each * len(pairs)
        options = ("--matches", n_matches, "--seed", 11, "--turn-time", 20)
        pit = start("serve", "--listen", f"tcp/{address}", "--data", folder, *options).wait_for("join with: ")
        ear = Ear(stack.enter_context(zenoh.open(config)))
        for pair in pairs:
            runners = [client(f"tcp/{address}", name, team, each) for team, name in zip(("blue", "red"), pair, strict=True)]
            with ThreadPoolExecutor() as pool:
                assert list(pool.map(Runner.run, runners)) == [each, each]
        ear.wait_for_endings(n_matches)
        assert pit.finish() == 0
        matches = gather(ear, folder)
        assert len(matches) == n_matches
        assert all(match.journal.seals for match in matches)
        pit_key = matches[0].journal.seals.pit_key if matches[0].journal.seals else b""
        yield Evening(ear, matches, pit_key, load_secret(folder / "keys" / "spectator.key"))


def pieces(messages: list[bytes]) -> set[bytes]:
    """Return every run of bytes that is long enough to tell something."""
    return set(cut(messages))


def cut(messages: list[bytes]) -> Iterator[bytes]:
    for data in set(messages):
        for at in range(len(data) - PIECE_BYTES + 1):
            yield data[at : at + PIECE_BYTES]


def read_head(sealed: bytes) -> tuple[int, int]:
    """Return the counter and the tick that stand before a sealed message."""
    return int.from_bytes(sealed[:8], "big"), int.from_bytes(sealed[8:HEAD_BYTES], "big")


def tick_of(kind: str, data: bytes) -> int:
    if kind != "public":
        return read_head(data[SALT_BYTES:] if kind == "truth" else data)[1]
    message = decode(data)
    return message.tick if isinstance(message, PublicState) else -1


def opens(opener: Opener, data: bytes) -> bool:
    with suppress(ForgedError):
        opener.open(data)
        return True
    return False


def test_what_a_stranger_hears_is_on_the_keys_that_it_may_hear(evening: Evening) -> None:
    kinds = {kind for match in evening.matches for kind, _ in match.messages}
    prefixes = {data.partition(b" ")[0].rpartition(b"/")[2] for data in evening.ear.heard}

    assert kinds == {*SEATS, "public", "truth"}
    assert prefixes == {b"observation", b"public", b"truth"}
    assert evening.ear.present == []


def test_nothing_that_a_stranger_hears_holds_a_piece_of_a_board_or_of_what_a_seat_is_shown(evening: Evening) -> None:
    hidden = pieces([data for match in evening.matches for side in (*match.shown, match.boards) for data in side])

    assert len(hidden) > 1000
    assert not any(piece in hidden for piece in cut(evening.ear.heard))


def test_nothing_that_a_stranger_hears_holds_a_key_or_a_seed_of_a_match(evening: Evening) -> None:
    heard = b"\0".join(set(evening.ear.heard))

    for match in evening.matches:
        keys = match.journal.header.keys
        drawn = [pair for part in philox_keys([keys]) for pair in part.reshape(-1, 2)]
        for secret in (keys.map_key, keys.match_key, *(key.tobytes() for key in drawn)):
            assert secret not in heard
            assert secret[::-1] not in heard
            assert secret.hex().encode() not in heard


def test_a_seat_is_sent_one_message_a_tick_and_all_of_one_length_whatever_happens(evening: Evening) -> None:
    for seat in SEATS:
        assert len({len(data) for match in evening.matches for data in match.on(seat)}) == 1
        for match in evening.matches:
            heads = [read_head(data) for data in dict.fromkeys(match.on(seat))]
            starts = [at for at, (counter, _) in enumerate(heads) if counter == 0]  # more than one if a slow seat took new keys
            for start, end in pairwise([*starts, len(heads)]):
                first = heads[start][1]
                assert heads[start:end] == [(counter, first + counter) for counter in range(end - start)]
            assert list(dict.fromkeys(tick for _, tick in heads)) == list(range(len(match.journal.ticks) + 1))


def test_the_truth_is_one_message_a_tick_and_all_of_one_length_whatever_happens(evening: Evening) -> None:
    assert len({len(data) for match in evening.matches for data in match.on("truth")}) == 1
    for match in evening.matches:
        heads = [read_head(data[SALT_BYTES:]) for data in match.on("truth")]
        assert heads == [(tick, tick) for tick in range(len(match.journal.ticks))]


def test_the_order_and_the_lengths_of_all_messages_are_those_of_any_other_match(evening: Evening) -> None:
    ends = {match.id: len(match.journal.ticks) for match in evening.matches}
    n_ticks = min(ends.values())
    orders = {match.journal.ticks[n_ticks // 2].orders for match in evening.matches}
    sequences = []
    for match in evening.matches:
        first: dict[tuple[str, int], tuple[str, int]] = {}
        for kind, data in match.messages:
            first.setdefault((kind, tick_of(kind, data)), (kind, 0 if kind == "public" else len(data)))
        sequences.append(list(first.values())[: 4 * n_ticks])

    assert len(orders) == len(evening.matches)
    assert len({tuple(match.boards[n_ticks - 1]) for match in evening.matches}) == len(evening.matches)
    assert [kind for kind, _ in sequences[0][:4]] == [*SEATS, "public", "truth"]
    for sequence in sequences:
        assert sequence == sequences[0][:4] * n_ticks


def test_what_everyone_is_told_is_the_names_the_tick_the_living_the_score_and_the_commitment(evening: Evening) -> None:
    for match in evening.matches:
        *facts, ending = match.on("public")
        first = decode(facts[0])
        assert isinstance(first, PublicState)
        states = []
        for games in replay(match.journal):
            blue, red, score = (
                int(games.state.field[0][fact]) for fact in (StateField.BLUE_LIVING, StateField.RED_LIVING, StateField.SCORE)
            )
            states.append((len(states), [blue, red], score))
        names = [match.journal.header.blue, match.journal.header.red]
        said = [
            encode(PublicState(tick=tick, names=names, living=living, score=score, commitment=first.commitment))
            for tick, living, score in states[:-1]
        ]

        assert facts == said
        signed = decode(first.commitment)
        assert isinstance(signed, Signed)
        digest = commit(match.id, match.journal.header.keys)
        assert read_statement(signed, evening.pit_key) == Commitment(match=match.id, digest=digest)
        last = decode(ending)
        assert isinstance(last, Signed)
        ended = read_statement(last, evening.pit_key)
        assert isinstance(ended, Ended)
        assert match.journal.ending is not None
        assert (ended.match, ended.ending) == (match.id, match.journal.ending.ending.name.lower())
        assert (ended.score, ended.ticks, ended.reason) == (match.journal.ending.score, len(states) - 1, "")


def test_the_truth_opens_with_the_spectator_key_and_no_other(evening: Evening) -> None:
    for match in evening.matches:
        truths = match.on("truth")
        salts = {data[:SALT_BYTES] for data in truths}
        assert len(salts) == 1
        salt = salts.pop()
        keys = match.journal.header.keys
        for wrong in (bytes(32), b"\xff" * 32, evening.pit_key, salt, keys.match_key, evening.spectator_key[::-1]):
            opener = truth_opener(wrong, salt, "pit", match.id)
            assert not any(opens(opener, data[SALT_BYTES:]) for data in truths)
        for other in evening.matches:
            opener = truth_opener(evening.spectator_key, salt, "pit", other.id)
            for tick, data in enumerate(truths if other is match else truths[:1]):
                if other is not match:
                    assert not opens(opener, data[SALT_BYTES:]), "it is of another match"
                    continue
                truth = decode(opener.open(data[SALT_BYTES:]))
                assert isinstance(truth, Truth)
                assert (truth.tick, truth.board) == (tick, match.boards[tick])
                assert [without_clock(seen) for seen in truth.seen] == [side[tick] for side in match.shown]
                assert pieces([truth.board]) & pieces(match.boards), "a piece would have been found"


def play(eve: Any, on_turn: Callable[[Turn], object] = lambda turn: None) -> list[bytes]:
    """Play a seat to its end, and give the receipt; return what it was shown."""
    shown: list[bytes] = []
    eve.say(Ready(known_ticks=0))
    while not isinstance(message := eve.heard.get(timeout=PATIENCE_S), Ended):
        if isinstance(message, Turn) and message.tick == len(shown):
            shown.append(message.observation)
            on_turn(message)
            n_units = len(load("paper").team(eve.team))
            eve.say(Orders(tick=message.tick, actions=bytes((message.tick + unit) % 5 for unit in range(n_units))), message.tick)
    head = Head()
    for observation in shown:
        head.add(observation)
    eve.say(sign_receipt(eve.identity, eve.match, eve.team, len(shown), head.digest), len(shown))
    return shown


def ask_for_journal(one: Any, match: str, offset: int = 0) -> Any:
    return decode(one.query(topics.journal("pit", match), encode(JournalRequest(offset=offset))))


def seat_openers(eve: Any, attempt: Any, ticket: Ticket) -> dict[tuple[Team, Direction, Team], Opener]:
    """Return what the holder of one seat's secrets can open, if she takes herself for any seat, in any direction."""
    openers = {}
    for team in Team:
        for direction in Direction:
            parts = (eve.pit_key, ticket.match.encode(), team.name.encode(), direction.value.encode())
            key = derive_key(ticket.secret + attempt._secret, "seat", *parts)
            for place in Team:
                openers[team, direction, place] = Opener(key, seat_context("pit", ticket.match, place, Direction.OBSERVATION))
    return openers


def test_a_player_with_two_connections_opens_its_own_seat_and_nothing_else(
    serve: Start, play_here: Start, stranger: Start, tmp_path: Path
) -> None:
    pit = serve("--matches", 1, "--turn-time", 60, "--set", "tick_limit=40")
    eve = stranger()
    second = stranger(identity=eve.identity)
    ear = Ear(second.session)
    honest = play_here("spiral", team="blue")
    seats: list[tuple[Any, Ticket]] = []
    eve.take = lambda attempt, ticket: (seats.append((attempt, ticket)), type(eve).take(eve, attempt, ticket))
    answers: list[Any] = []

    def pry(turn: Turn) -> None:
        if turn.tick == 5:
            answers.extend(ask_for_journal(second, eve.match, offset) for offset in (0, 1, 1 << 40))
            answers.append(ask_for_journal(second, "*"))
            for name in ("eve", "spiral"):
                assert not isinstance(second.ask(name=name, team="blue", match=eve.match), Ticket)
                assert not isinstance(second.ask(name=name), Ticket)

    eve.sit(team="red")
    shown = play(eve, pry)
    ear.wait_for_endings(1)

    assert (honest.result(PATIENCE_S), pit.finish()) == (1, 0)
    (match,) = gather(ear, tmp_path)
    assert len(answers) == 4
    assert all(isinstance(answer, Refusal) for answer in answers), answers
    assert [without_clock(data) for data in shown] == match.shown[Team.RED][:-1]
    assert not pieces([data for side in (*match.shown, match.boards) for data in side]) & pieces(ear.heard)
    ((attempt, ticket),) = seats
    theirs, truths = match.on(SEATS[Team.BLUE]), [data[SALT_BYTES:] for data in match.on("truth")]
    assert len(theirs) == len(shown) + 1
    openers = seat_openers(eve, attempt, ticket)
    for opener in (*openers.values(), *(attempt.sit(match.id, team, ticket.secret)[1] for team in Team)):
        assert not any(opens(opener, data) for data in (*theirs, *truths))
    own = openers[Team.RED, Direction.OBSERVATION, Team.RED]
    assert all(opens(own, data) for data in match.on(SEATS[Team.RED])), "these are the keys of the seat"
    for secret in (bytes(32), ticket.secret, attempt._secret):
        opener = truth_opener(secret, match.on("truth")[0][:SALT_BYTES], "pit", match.id)
        assert not any(opens(opener, data) for data in truths)


def test_the_journal_of_leg_one_is_given_when_leg_two_is_over_and_not_before(port: int, stranger: Start, tmp_path: Path) -> None:
    secret, map_key = secret_from_seed(5), derive_map_key(secret_from_seed(5), "fixture", 0)
    plans = [
        MatchPlan(
            identity=f"league/{leg}",
            blue=blue,
            red=red,
            keys=MatchKeys(map_key=map_key, match_key=derive_match_key(secret, f"league/{leg}")),
        )
        for leg, (blue, red) in enumerate([("eve", "patrol"), ("patrol", "eve")])
    ]
    played: list[MatchEnded] = []
    is_over = threading.Event()
    given: dict[str, Any] = {}
    with open_router(f"tcp/127.0.0.1:{port}", "pit") as session:
        context = PitContext(pit="pit", identity=Identity.make(), spectator_key=bytes(32))
        ruleset, time_control = load("paper").with_({"tick_limit": 12}), TimeControl(turn_time_s=None, grace_s=PATIENCE_S)
        referee = Referee(session, context, ruleset, PlannedSeating(plans), time_control, tmp_path, on_end=played.append)
        runner = client(f"tcp/127.0.0.1:{port}", "patrol", "any", None)

        def run() -> None:
            with suppress(LostPitError):
                runner.run()

        threads = [threading.Thread(target=run), threading.Thread(target=referee.run, args=(is_over.is_set,))]
        for thread in threads:
            thread.start()
        try:
            eve = stranger()
            first = eve.sit()
            play(eve, lambda turn: given.setdefault("in leg one", ask_for_journal(eve, first.match)))
            given["between"] = ask_for_journal(eve, first.match)
            second = eve.sit()
            play(eve, lambda turn: given.setdefault("in leg two", ask_for_journal(eve, first.match)))
            given["of leg two"] = ask_for_journal(eve, second.match)  # answered when that one is whole
            given["after"] = ask_for_journal(eve, first.match)
        finally:
            runner.stop()
            is_over.set()
            for thread in threads:
                thread.join(PATIENCE_S)
            referee.close()

    assert first.match != second.match
    assert (first.team, second.team) == (Team.BLUE, Team.RED)
    kinds = {when: type(answer) for when, answer in given.items()}
    assert kinds == {
        "in leg one": Refusal,
        "between": Wait,
        "in leg two": Wait,
        "of leg two": JournalPiece,
        "after": JournalPiece,
    }
    for ticket, when, plan in ((first, "after", plans[0]), (second, "of leg two", plans[1])):
        piece = given[when]
        assert len(piece.data) == piece.n_bytes
        journal = read_journal(piece.data)
        signed = decode(ticket.commitment)
        assert isinstance(signed, Signed)
        digest = commit(ticket.match, journal.header.keys)
        assert read_statement(signed, context.identity.public) == Commitment(match=ticket.match, digest=digest)
        assert journal.header.keys == plan.keys
        assert len(watch(journal)[Team.BLUE]) == len(journal.ticks) + 1
