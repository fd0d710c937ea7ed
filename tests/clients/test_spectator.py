"""What a spectator makes of the messages of a real match, and what it does not believe."""

import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from arena.errors import ForgedError, InputError, LostPitError, ProtocolError, ReplayedError, UnreadableError
from arena.game.keys import MatchKeys
from arena.game.ruleset import load, to_dict
from arena.game.state import StateField
from arena.game.types import Action, Code, Team
from arena.match.effects import Effect as MatchEffect
from arena.match.match import Match, Phase
from arena.match.time_control import TimeControl
from arena.network.address import Address
from arena.pit.effects import Append, PublishEnding, PublishTick
from arena.pit.match_session import MatchSession, PitContext
from arena.protocol import topics
from arena.protocol.codec import MOST_LISTED, decode, encode
from arena.protocol.identity import Identity
from arena.protocol.messages import Commitment, Ended, Message, Orders, PastTruth, PublicState, Signed, Truth
from arena.protocol.sealing import truth_sealer
from arena.protocol.signed import STATEMENT_VERSION, commit, sign_statement
from arena.records.journal import Header, read_journal
from arena.records.plan import network_name
from arena.records.replay import replay
from clients.spectator import MOST_CLOSED, SALT_BYTES, Frame, Spectator, watch

RULES = load("paper").with_({"side": 10, "tick_limit": 12})
IDENTITY = "pit/0/ann/bob"
MATCH = network_name(IDENTITY, b"", b"")
KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x08" * 32)
PIT, STRANGER = Identity.make(), Identity.make()
KEY, SALT = b"k" * 32, b"s" * 32


class Show:
    """A match of random orders, and what was published of it."""

    def __init__(self, identity: Identity = PIT, spectator_key: bytes | None = KEY, public_delay: int = 0) -> None:
        header = Header(identity=IDENTITY, blue="ann", red="bob", ruleset=RULES, keys=KEYS)
        match, chance = Match(header, TimeControl(turn_time_s=None), 0.0), random.Random(3)
        context = PitContext(pit="pit", identity=identity, spectator_key=spectator_key, public_delay=public_delay)
        self._session = MatchSession(context, match, {team: Identity.make().public for team in Team}, b"", 0, {})
        self.journal = match.start_record
        self.public: list[bytes] = []
        self.truths: list[bytes] = []
        self.past_truths: list[bytes | None] = []
        """By the tick at which each was published."""
        for team in Team:
            self._carry_out(match.ready(team, 0.0))
        while match.phase is Phase.PLAYING:
            tick = match.tick
            for team in Team:
                orders = bytes(chance.randrange(len(Action)) for _ in RULES.team(team))
                self._carry_out(match.submit(team, tick, orders, 0.0))

    def _carry_out(self, match_effects: list[MatchEffect]) -> None:
        for effect in self._session.carry(match_effects):
            if isinstance(effect, Append):
                self.journal += effect.data
            elif isinstance(effect, PublishTick):
                self.public.append(effect.make_public())
                if effect.make_truth is not None:
                    self.truths.append(effect.make_truth())
                self.past_truths.append(effect.make_past_truth and effect.make_past_truth())
            elif isinstance(effect, PublishEnding):
                self.public.append(effect.payload)


@pytest.fixture(scope="module")
def show() -> Show:
    return Show()


@pytest.fixture(scope="module")
def games(show: Show) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, tuple[int, int], int]]:
    """Return the truth, both views, the living and the score of each tick, by the journal."""

    def look() -> Iterator[Any]:
        for game in replay(read_journal(show.journal)):
            fact, grids = game.state.field[0], game.grids()
            living = int(fact[StateField.BLUE_LIVING]), int(fact[StateField.RED_LIVING])
            views = [grids[team, 0].copy() for team in Team]
            yield game.truth(0).copy(), *views, living, int(fact[StateField.SCORE])

    return list(look())


def spectator(key: bytes | None = KEY, pit: str = "pit", match: str = MATCH, pit_key: bytes = PIT.public) -> Spectator:
    return Spectator(pit, match, RULES, pit_key, key)


def frame(heard: Frame | None) -> Frame:
    assert heard is not None
    return heard


def test_everyone_is_shown_the_board_as_late_as_the_pit_says_and_no_tick_earlier(games: list[Any]) -> None:
    delay = 3
    published = Show(public_delay=delay).past_truths

    assert len(published) == len(games) - 1
    assert published[:delay] == [None] * delay
    watching = spectator(key=None)
    for tick, payload in enumerate(published[delay:]):
        assert payload is not None
        seen = watching.read_past_truth(payload)
        truth, blue, red, living, score = games[tick]
        assert (seen.tick, seen.living, seen.score, seen.is_past) == (tick, living, score, True)
        assert seen.truth is not None
        assert seen.seen is not None
        np.testing.assert_array_equal([seen.truth, *seen.seen], [truth, blue, red])


def test_where_nothing_was_said_of_a_delay_no_board_is_for_everyone(show: Show) -> None:
    assert set(show.past_truths) == {None}


def test_a_past_truth_of_a_stranger_or_of_another_match_is_not_believed() -> None:
    payload = Show(public_delay=1).past_truths[-1]
    assert payload is not None

    for doubtful in (spectator(pit_key=STRANGER.public), spectator(match="0" * 24)):
        with pytest.raises(ForgedError):
            doubtful.read_past_truth(payload)
    with pytest.raises(ProtocolError):
        spectator().read_past_truth(encode(PastTruth(match=MATCH, tick=0, board=bytes(100), seen=[])))


def test_the_public_facts_of_each_tick_are_those_of_the_journal(show: Show, games: list[Any]) -> None:
    watching = spectator(key=None)
    frames = [frame(watching.read_public(payload)) for payload in show.public[:-1]]

    assert [one.tick for one in frames] == list(range(len(games) - 1))
    assert [(one.living, one.score) for one in frames] == [game[3:] for game in games[:-1]]
    assert {one.names for one in frames} == {("ann", "bob")}
    assert {(one.truth is None, one.seen is None, one.ended) for one in frames} == {(True, True, None)}


def test_the_ending_is_the_one_that_the_pit_signed(show: Show) -> None:
    journal = read_journal(show.journal)
    ending = frame(spectator(key=None).read_public(show.public[-1]))

    assert journal.ending is not None
    assert ending.ended is not None
    assert (ending.tick, ending.score) == (journal.ending.ticks, journal.ending.score)
    assert ending.ended.ending == journal.ending.ending.name.lower()


def test_the_truth_and_both_views_are_those_of_the_journal(show: Show, games: list[Any]) -> None:
    """All frames are kept until the last is there: none is written over by the next."""
    watching = spectator()
    frames = [frame(watching.read_truth(payload)) for payload in show.truths]

    assert [one.tick for one in frames] == list(range(len(games) - 1))
    for one, (truth, blue, red, living, score) in zip(frames, games, strict=False):
        assert one.truth is not None
        assert one.seen is not None
        assert np.array_equal(one.truth, truth)
        assert np.array_equal(one.seen[0], blue)
        assert np.array_equal(one.seen[1], red)
        assert (one.living, one.score) == (living, score)
    assert any((one.seen[0] == Code.HIDDEN).any() for one in frames if one.seen)


def test_a_spectator_that_comes_later_sees_from_there_on(show: Show) -> None:
    watching = spectator()

    assert [frame(watching.read_truth(payload)).tick for payload in show.truths[3:]] == list(range(3, len(show.truths)))


def test_without_the_key_a_truth_is_nothing(show: Show) -> None:
    assert spectator(key=None).read_truth(show.truths[0]) is None
    assert spectator(key=None).read_truth(b"junk") is None


@pytest.mark.parametrize("other", [{"key": b"K" * 32}, {"pit": "other"}, {"match": "0123456789abcdef"}])
def test_a_truth_of_another_key_pit_or_match_does_not_open(show: Show, other: dict[str, Any]) -> None:
    with pytest.raises(ForgedError):
        spectator(**other).read_truth(show.truths[0])


def test_a_key_that_opens_nothing_is_said_to_be_another_pit_s(show: Show) -> None:
    stranger = Spectator("pit", MATCH, RULES, PIT.public, b"o" * 32)
    for truth in show.truths[:MOST_CLOSED]:
        with pytest.raises(ForgedError):
            stranger.read_truth(truth)

    with pytest.raises(InputError, match="does not open with this spectator key"):
        stranger.read_truth(show.truths[MOST_CLOSED])


def test_a_truth_that_was_changed_cut_or_heard_before_does_not_open(show: Show) -> None:
    watching, truths = spectator(), show.truths
    watching.read_truth(truths[1])
    for payload in (
        b"",
        truths[2][:SALT_BYTES],
        truths[2][:-1],
        truths[2][:-1] + bytes([truths[2][-1] ^ 1]),
        truths[3][:SALT_BYTES] + b"\x01" + truths[3][SALT_BYTES + 1 :],
    ):
        with pytest.raises(ForgedError):
            watching.read_truth(payload)
    with pytest.raises(ReplayedError):
        watching.read_truth(truths[0])


def test_a_pit_that_came_back_is_seen_again(show: Show) -> None:
    """Its new process counts from 0, under a salt of its own."""
    watching = spectator()
    for payload in show.truths[:4]:
        watching.read_truth(payload)

    assert frame(watching.read_truth(Show().truths[0])).tick == 0
    with pytest.raises(ReplayedError):
        watching.read_truth(show.truths[0])


def sealed(message: Message, tick: int = 0) -> bytes:
    return SALT + truth_sealer(KEY, SALT, "pit", MATCH).close(encode(message), tick)


@pytest.mark.parametrize(
    "change",
    [
        lambda truth: replace(truth, board=truth.board[:-1]),
        lambda truth: replace(truth, board=truth.board + b"\0"),
        lambda truth: replace(truth, board=b""),
        lambda truth: replace(truth, seen=truth.seen[:1]),
        lambda truth: replace(truth, seen=[]),
        lambda truth: replace(truth, seen=truth.seen * 2),
        lambda truth: replace(truth, seen=[truth.seen[0], truth.seen[1][:-1]]),
        lambda truth: replace(truth, seen=[b"", b""]),
        lambda truth: replace(truth, seen=[bytes([0x7F]) * len(truth.seen[0]), truth.seen[1]]),
        lambda truth: Orders(tick=0, actions=b""),
    ],
)
def test_a_truth_of_other_sizes_is_refused(change: Callable[[Truth], Message]) -> None:
    match = Match(Header(identity=IDENTITY, blue="ann", red="bob", ruleset=RULES, keys=KEYS), TimeControl(), 0.0)
    board, seen = match.truth()
    truth = Truth(tick=0, board=board, seen=seen)
    assert frame(spectator().read_truth(sealed(truth))).tick == 0

    with pytest.raises(UnreadableError):
        spectator().read_truth(sealed(change(truth)))


@pytest.mark.parametrize(
    "changes", [{"living": [6]}, {"living": [6, 6, 6]}, {"living": []}, {"names": ["ann"]}, {"names": ["a", "b", "c"]}]
)
def test_facts_of_another_number_of_teams_are_refused(show: Show, changes: dict[str, Any]) -> None:
    facts = decode(show.public[0])
    assert isinstance(facts, PublicState)

    with pytest.raises(UnreadableError, match="the facts are not of two teams"):
        spectator().read_public(encode(replace(facts, **changes)))


def test_an_ending_that_another_signed_or_of_another_match_is_refused(show: Show) -> None:
    signed = decode(show.public[-1])
    assert isinstance(signed, Signed)
    ended = decode(signed.data, STATEMENT_VERSION)
    assert isinstance(ended, Ended)
    for forged in (
        sign_statement(STRANGER, ended),
        replace(signed, signature=bytes(64)),
        replace(signed, data=encode(replace(ended, winner="red", score=-100))),
        sign_statement(PIT, replace(ended, match="0123456789abcdef")),
    ):
        with pytest.raises(ForgedError):
            spectator().read_public(encode(forged))
    with pytest.raises(ForgedError):
        spectator(pit_key=STRANGER.public).read_public(show.public[-1])


@pytest.mark.parametrize("payload", [b"", b"junk", b"\xc1", bytes(70_000)])
def test_noise_is_refused(payload: bytes) -> None:
    with pytest.raises(ProtocolError):
        spectator().read_public(payload)


def test_what_is_nothing_for_spectators_is_passed_over() -> None:
    commitment = sign_statement(PIT, Commitment(match=MATCH, digest=commit(MATCH, KEYS)))
    unsigned = Ended(match=MATCH, ending="capture", winner="red", score=-100, ticks=3, reason="")

    for message in (commitment, unsigned, Orders(tick=0, actions=b"")):
        assert spectator().read_public(encode(message)) is None


# Among several matches


class Hall:
    """A connection on which much has been said already."""

    def __init__(self, heard_by: str, said: list[tuple[str, bytes]]) -> None:
        self._heard_by, self._said = heard_by, said

    def __enter__(self) -> "Hall":
        return self

    def __exit__(self, *_: object) -> None:
        return

    def subscribe(self, key: str, on_sample: Callable[[Any], None]) -> None:
        for one in self._said if key == self._heard_by else []:
            on_sample(one)


@pytest.fixture
def enter(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, list[tuple[str, bytes]]], None]:
    """Let `watch` find a pit where this is said on an expression's keys."""

    def prepare(heard_by: str, said: list[tuple[str, bytes]], running: tuple[str, ...] = (MATCH,)) -> None:
        lobby = SimpleNamespace(ruleset={"name": RULES.name, **to_dict(RULES)}, running=[{"match": one} for one in running])
        for name, value in {
            "open_client": lambda *_: Hall(heard_by, said),
            "ask_challenge": lambda *_: SimpleNamespace(pit_key=PIT.public),
            "ask_lobby": lambda *_: lobby,
            "read_key": lambda sample: sample[0],
            "read_payload": lambda sample: sample[1],
        }.items():
            monkeypatch.setattr(f"clients.spectator.{name}", value)

    return prepare


@pytest.mark.parametrize("match", ["", MATCH])
def test_one_match_is_watched_from_the_first_word_that_is_the_pit_s_to_its_end(
    show: Show, enter: Callable[..., None], match: str
) -> None:
    """Whatever is said of others, and whatever noise comes first."""
    other = topics.truth("pit", "0123456789abcdef")
    said = [(other, b"noise")]
    for truth in show.truths:
        said += [(topics.truth("pit", MATCH), truth), (other, truth)]
    enter(topics.all_truths("pit"), said)
    trusted: list[bytes] = []

    watching = watch(Address(), None, match, trusted.append, KEY, lambda: pytest.fail("a match runs"))
    frames = list(islice(watching, len(show.truths)))

    assert trusted == [PIT.public]
    assert [(at, one.tick) for at, one in frames] == [(MATCH, tick) for tick in range(len(show.truths))]


def test_facts_of_other_matches_are_not_mixed_in(show: Show, enter: Callable[..., None]) -> None:
    facts = [(topics.public("pit", at), payload) for payload in show.public[:-1] for at in (MATCH, "other")]
    said = [*facts, (topics.public("pit", "other"), show.public[-1]), (topics.public("pit", MATCH), show.public[-1])]
    enter(topics.all_public("pit"), said)

    frames = list(watch(Address(), None, "", lambda _: None, None, lambda: None))

    assert {at for at, _ in frames} == {MATCH}
    assert [one.tick for _, one in frames] == [*range(len(show.public) - 1), len(show.public) - 1]
    assert frames[-1][1].ended is not None


def test_who_watches_before_a_match_runs_is_told_once_that_it_waits(show: Show, enter: Callable[..., None]) -> None:
    enter(topics.all_public("pit"), [(topics.public("pit", MATCH), payload) for payload in show.public], running=())
    told: list[str] = []

    frames = list(watch(Address(), None, "", lambda _: None, None, lambda: told.append("waits")))

    assert told == ["waits"]
    assert frames[-1][1].ended is not None


def test_a_match_is_watched_that_the_lobby_has_no_room_to_name(show: Show, enter: Callable[..., None]) -> None:
    said = [(topics.public("pit", MATCH), payload) for payload in show.public]
    enter(topics.all_public("pit"), said, running=tuple(f"other-{number}" for number in range(MOST_LISTED)))

    frames = list(watch(Address(), None, MATCH, lambda _: None, None, lambda: pytest.fail("matches run")))

    assert frames[-1][1].ended is not None


@pytest.mark.parametrize("n_others", [1, MOST_LISTED])
def test_a_match_whose_ending_was_missed_is_known_to_be_over_though_others_run(
    show: Show, enter: Callable[..., None], monkeypatch: pytest.MonkeyPatch, n_others: int
) -> None:
    others = tuple(f"other-{number}" for number in range(n_others))
    enter(topics.all_public("pit"), [(topics.public("pit", MATCH), show.public[0])], running=(MATCH, *others))
    watching = watch(Address(), None, MATCH, lambda _: None, None, lambda: pytest.fail("a match runs"))
    assert next(watching)[1].tick == 0
    enter("", [], running=others)
    monkeypatch.setattr("clients.spectator._SILENCE_S", 0.01)
    monkeypatch.setattr("clients.spectator._MOST_SILENCE_S", 0.05)
    monkeypatch.setattr(
        "clients.spectator.queue.Queue.get", lambda *_, **__: (Spectator.read_public, (topics.public("pit", "other-0"), b""))
    )

    with pytest.raises(LostPitError, match=f"match {MATCH} does not run in pit"):
        next(watching)
