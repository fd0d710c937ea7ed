"""What a client finds out about a journal, once its match is over."""

import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arena.errors import ArenaError
from arena.game.keys import MatchKeys
from arena.game.observation import Observations
from arena.game.ruleset import load, to_dict
from arena.game.types import Action, Team
from arena.match.effects import Ask, Effect, End, Write
from arena.match.match import Match, Phase
from arena.match.time_control import TimeControl
from arena.pit import journal_files
from arena.pit.journal_files import read_piece
from arena.policy import BatchPolicy
from arena.protocol.codec import MOST_BYTES, decode, encode
from arena.protocol.identity import Identity
from arena.protocol.messages import (
    ChallengeRequest,
    Commitment,
    Ended,
    JournalPiece,
    JournalRequest,
    Message,
    Orders,
    Receipt,
    Refusal,
    Ticket,
    Turn,
    Wait,
)
from arena.protocol.signed import commit, sign_journal, sign_receipt, sign_statement
from arena.records.journal import (
    CHAIN_BYTES,
    MAGIC,
    Header,
    Mark,
    journal_name,
    write_receipt,
    write_seats,
    write_signature,
)
from arena.records.plan import network_name
from clients.audit import JournalDownload, Verdict, audit
from clients.seat import Seat

RULES = load("paper").with_({"side": 10, "tick_limit": 12})
UNITS = len(RULES.team(Team.BLUE))
PIT, STRANGER = Identity.make(), Identity.make()
ENTRIES = {team: Identity.make() for team in Team}
KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x08" * 32)
OTHER_KEYS = MatchKeys(map_key=b"\x07" * 32, match_key=b"\x09" * 32)
TRUE = "the journal is of this match, under the keys that the pit committed itself to"


class Wanderer(BatchPolicy):
    def act(self, observations: Observations, orders: np.ndarray) -> None:
        chance = random.Random(int(observations.tick[0]))
        orders[0] = [chance.randrange(len(Action)) for _ in range(orders.shape[1])]


@dataclass(frozen=True)
class Ticks:
    """The ticks of a journal, to be changed."""

    data: bytes

    LENGTH = 1 + 2 * UNITS + len(Team) + CHAIN_BYTES

    def at(self, tick: int, offset: int, value: int) -> bytes:
        changed = bytearray(self.data)
        changed[tick * self.LENGTH + 1 + offset] = value
        return bytes(changed)


class Played:
    """A match between two seats, as its pit wrote it down."""

    def __init__(self, identity: str = "pit/0/ann/bob", late: Callable[[Team, int], bool] = lambda *_: False) -> None:
        self.header = Header(identity=identity, blue="ann", red="bob", ruleset=RULES, keys=KEYS)
        self.id = network_name(identity, b"", b"")
        self.match = Match(self.header, TimeControl(bank_s=0.0), 0.0)
        self.seats = {team: self._sit(team) for team in Team}
        self.now_s, self._late, self.writes = 0.0, late, b""
        self.asked: list[Ask] = []
        self.carry_out([event for team in Team for event in self.match.ready(team, 0.0)])
        while self.match.phase is Phase.PLAYING:
            self._tick()

    def _sit(self, team: Team) -> Seat:
        ticket = Ticket(
            match=self.id,
            lane=7,
            team=int(team),
            ruleset={"name": RULES.name, **to_dict(RULES)},
            opponent="",
            turn_time_s=None,
            bank_s=0.0,
            tick=0,
            secret=bytes(32),
            commitment=b"",
        )
        return Seat(ticket, commit(self.id, KEYS), Wanderer)

    def _tick(self) -> None:
        asked, self.asked = self.asked, []
        for ask in asked:
            (answer,) = self.seats[ask.team].receive(Turn(tick=ask.tick, observation=ask.observation))
            assert isinstance(answer, Orders)
            if not self._late(ask.team, ask.tick):
                self.carry_out(self.match.submit(ask.team, answer.tick, answer.actions, self.now_s))
        self.now_s += 2.0
        self.carry_out(self.match.advance(self.now_s) if self.match.tick == asked[0].tick else [])

    def carry_out(self, events: list[Effect]) -> None:
        for event in events:
            if isinstance(event, Write):
                self.writes += event.data
            elif isinstance(event, Ask):
                self.asked.append(event)
            elif isinstance(event, End):
                ended = Ended(match=self.id, **event.result.to_dict())
                for seat in self.seats.values():
                    seat.receive(ended)

    def receipt(self, team: Team, head: bytes | None = None) -> Receipt:
        seat = self.seats[team]
        return sign_receipt(ENTRIES[team], self.id, team, seat.known_ticks, seat.head if head is None else head)

    def journal(
        self,
        *,
        pit: Identity = PIT,
        keys: MatchKeys = KEYS,
        ticks: Callable[[Ticks], bytes] = lambda ticks: ticks.data,
        receipts: dict[Team, Receipt] | None = None,
        is_signed: bool = True,
    ) -> bytes:
        """Return the pit's journal, or what a pit might write that does not keep to what it said."""
        start = self.match.start_record
        packed, chain = replace(self.header, keys=keys).pack(), start[-CHAIN_BYTES:]
        publics = {team: identity.public for team, identity in ENTRIES.items()}
        commitment = sign_statement(pit, Commitment(match=self.id, digest=commit(self.id, keys))).signature
        given = {team: self.receipt(team) for team in Team} if receipts is None else receipts
        n_ticks = len(self.seats[Team.BLUE].answers) * Ticks.LENGTH
        return (
            MAGIC
            + b"H"
            + len(packed).to_bytes(4, "little")
            + packed
            + chain
            + write_seats(pit.public, publics, commitment)
            + ticks(Ticks(self.writes[:n_ticks]))
            + self.writes[n_ticks:]
            + b"".join(write_receipt(team, receipt) for team, receipt in given.items())
            + (write_signature(sign_journal(pit, self.match.head)) if is_signed else b"")
        )

    def audit(self, team: Team = Team.BLUE, **changes: Any) -> Verdict:
        return audit(self.seats[team], self.journal(**changes), PIT.public)


@pytest.fixture(scope="module")
def played() -> Played:
    return Played()


# A whole journal


@pytest.mark.parametrize("team", Team)
def test_the_true_journal_holds(played: Played, team: Team) -> None:
    assert played.seats[team].ended is not None
    assert played.audit(team) == (True, TRUE)
    assert played.audit(team, receipts={}) == (True, TRUE)


def test_keys_that_the_pit_did_not_commit_itself_to_are_found_out(played: Played) -> None:
    assert played.audit(keys=OTHER_KEYS) == (False, "the journal's keys are not those that the pit committed itself to")


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("tick", [0, 3])
def test_orders_that_the_seat_did_not_give_are_found_out(played: Played, team: Team, tick: int) -> None:
    for unit in (0, UNITS - 1):
        own = UNITS * team + unit
        before = played.seats[team].answers[tick][unit]

        def change(ticks: Ticks, own: int = own, before: int = before) -> bytes:
            return ticks.at(tick, own, (before + 1) % len(Action))

        assert played.audit(team, ticks=change) == (False, f"at tick {tick} the journal has other orders than this seat gave")
        assert played.audit(team.other, ticks=change) == (True, TRUE)  # what the other said, only the other knows


def test_a_mark_excuses_orders_that_were_not_played_and_only_the_seat_s_own() -> None:
    late = Played(late=lambda team, tick: (team, tick) == (Team.RED, 2))
    assert late.audit(Team.RED) == late.audit(Team.BLUE) == (True, TRUE)

    def move_mark(ticks: Ticks) -> bytes:
        return Ticks(ticks.at(2, 2 * UNITS + Team.RED, 0)).at(2, 2 * UNITS + Team.BLUE, Mark.LATE)

    assert late.audit(Team.RED, ticks=move_mark) == (False, "at tick 2 the journal has other orders than this seat gave")


def test_another_receipt_than_the_seat_gave_is_found_out(played: Played) -> None:
    other = {Team.BLUE: played.receipt(Team.BLUE, bytes(32))}

    assert played.audit(Team.BLUE, receipts=other) == (False, "the journal has another receipt than this seat gave")
    assert played.audit(Team.RED, receipts=other) == (True, TRUE)


def test_a_journal_of_another_pit_is_found_out(played: Played) -> None:
    assert played.audit(pit=STRANGER) == (False, "the journal is not signed by this pit")


def test_a_journal_of_another_match_is_found_out(played: Played) -> None:
    other = Played("pit/1/ann/bob")

    assert audit(played.seats[Team.BLUE], other.journal(), PIT.public) == (False, f"the journal is of match {other.id}")


def test_a_journal_that_nobody_signed_is_found_out(played: Played) -> None:
    assert played.audit(is_signed=False) == (False, "the signature of a journal does not hold")
    assert audit(played.seats[Team.BLUE], played.match.start_record + played.writes, PIT.public) == (
        False,
        "the journal is not signed by this pit",
    )


def test_a_journal_that_is_cut_anywhere_is_found_out(played: Played) -> None:
    data = played.journal()
    for length in range(len(data)):
        holds, sentence = audit(played.seats[Team.BLUE], data[:length], PIT.public)
        assert holds is False
        assert sentence


@pytest.mark.parametrize("data", [b"", b"junk", MAGIC, MAGIC + b"H\xff\xff\xff\xff"])
def test_what_is_no_journal_is_found_out(played: Played, data: bytes) -> None:
    holds, sentence = audit(played.seats[Team.BLUE], data, PIT.public)

    assert holds is False
    assert "journal" in sentence


def test_ticks_that_the_seat_played_cannot_be_taken_back(played: Played) -> None:
    """Not those before the last: to that one, an answer may have come too late to be played."""
    kept = len(played.seats[Team.BLUE].answers) - 2

    assert played.audit(ticks=lambda ticks: ticks.data[: kept * Ticks.LENGTH]) == (
        False,
        "the journal lacks ticks that this seat played",
    )


@pytest.mark.parametrize("team", Team)
@pytest.mark.parametrize("change", [{"winner": "red"}, {"score": 77}, {"ticks": 3}, {"ending": "void"}, {"reason": "because"}])
def test_an_ending_that_the_pit_did_not_tell_the_seat_is_found_out(played: Played, team: Team, change: dict[str, Any]) -> None:
    seat = played.seats[team]
    told = seat.ended
    assert told is not None
    if change == {"winner": told.winner}:
        change = {"winner": "blue"}
    try:
        seat.ended = replace(told, **change)
        assert played.audit(team) == (False, "the journal ends otherwise than the pit told this seat")
    finally:
        seat.ended = told


# Piece by piece


def fetch(played: Played, answer: Callable[[bytes], bytes]) -> tuple[Verdict, list[int]]:
    """Return what was found, and the offsets that were asked for."""
    download, journal, offsets = JournalDownload(), None, []  # type: JournalDownload, bytes | None, list[int]
    try:
        while journal is None:
            request = decode(download.request())
            assert isinstance(request, JournalRequest)
            offsets.append(request.offset)
            journal = download.receive(answer(download.request()))
    except ArenaError as error:
        return (None, str(error)), offsets
    return audit(played.seats[Team.BLUE], journal, PIT.public), offsets


def pit_of(played: Played, folder: Path, data: bytes) -> Callable[[bytes], bytes]:
    """Return how a pit answers from its files."""
    path = folder / journal_name(played.header.identity)
    path.write_bytes(data)

    def answer(payload: bytes) -> bytes:
        request = decode(payload)
        assert isinstance(request, JournalRequest)
        return read_piece(path, request.offset)

    return answer


def test_a_journal_comes_in_pieces(played: Played, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_files, "PIECE_BYTES", 400)
    data = played.journal()

    verdict, offsets = fetch(played, pit_of(played, tmp_path, data))

    assert verdict == (True, TRUE)
    assert offsets == list(range(0, len(data), 400))
    assert len(offsets) > 2


def test_a_journal_of_one_piece_is_asked_for_once(played: Played, tmp_path: Path) -> None:
    assert fetch(played, pit_of(played, tmp_path, played.journal())) == ((True, TRUE), [0])


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        (Refusal(reason="there is none"), "the journal cannot be had: there is none"),
        (Wait(reason="until the last match of these two is over"), "the journal is not to be seen until the last match of these"),
        (ChallengeRequest(), "the journal cannot be had: the pit is gone"),
        (JournalPiece(n_bytes=0, offset=0, data=b""), "the journal cannot be had: the pit is gone"),
        (JournalPiece(n_bytes=100, offset=0, data=b""), "the journal cannot be had: the pit is gone"),
        (JournalPiece(n_bytes=1 << 40, offset=0, data=b"x"), "the journal cannot be had: the pit is gone"),
    ],
)
def test_a_journal_that_cannot_be_had_is_no_verdict(played: Played, answer: Message, sentence: str) -> None:
    (holds, said), offsets = fetch(played, lambda _: encode(answer))

    assert holds is None
    assert said.startswith(sentence)
    assert offsets == [0]


@pytest.mark.parametrize("answer", [b"", b"\xc1", b"junk", bytes(MOST_BYTES + 1)])
def test_silence_and_noise_are_no_verdict(played: Played, answer: bytes) -> None:
    (holds, said), _ = fetch(played, lambda _: answer)

    assert holds is None
    assert said.startswith("the journal cannot be had: ")


def test_a_pit_that_falls_silent_between_pieces_is_no_verdict(played: Played) -> None:
    data = played.journal()
    answers = [encode(JournalPiece(n_bytes=len(data), offset=0, data=data[:100])), b""]

    assert fetch(played, lambda _: answers.pop(0)) == ((None, "the journal cannot be had: the pit is gone"), [0, 100])
