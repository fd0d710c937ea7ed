"""Transcripts: what a seat kept is read back, and nothing that was cut or changed passes for more than it is."""

import logging
import os
from dataclasses import replace
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import SEEDS, lay, random_orders, rules_for, rulesets, scatter, settle

from arena.annotations import Annotations
from arena.errors import InputError, JournalError
from arena.game.engine import BatchedGame
from arena.game.observation import NO_CLOCK_MS
from arena.game.ruleset import Ruleset
from arena.game.types import Team, Termination
from arena.policy import MatchResult
from arena.protocol.observation_codec import ObservationReader, ObservationWriter, without_clock
from arena.records.transcript import (
    HEAD_BYTES,
    MAGIC,
    Head,
    Transcript,
    TranscriptHeader,
    TranscriptWriter,
    is_transcript,
    load_transcript,
    read_transcript,
    transcript_name,
)

Ticks = list[tuple[bytes, bytes]]
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
SMALL = rules_for("F..u\nU...\n..A.\na..f\n")
RESULT = MatchResult(ending=Termination.CAPTURE, winner=Team.RED, score=-100, ticks=4)
RESULTS = st.builds(
    MatchResult,
    ending=st.sampled_from(Termination),
    winner=st.none() | st.sampled_from(Team),
    score=st.integers(-100, 100),
    ticks=st.integers(0, 1000),
    reason=TEXTS,
)


def header_of(rules: Ruleset, team: Team, **changes: Any) -> TranscriptHeader:
    header = TranscriptHeader(
        match="m1", pit="pit", pit_key=b"p" * 32, entry_key=b"e" * 32, name="me", opponent="other", team=team, ruleset=rules,
        commitment=b"c" * 32,
    )  # fmt: skip
    return replace(header, **changes)


def play(games: BatchedGame, team: Team, rng: np.random.Generator, n_ticks: int, bank_s: float | None = None) -> Ticks:
    """Play at random, and return what one team was shown and what it ordered."""
    writer, ticks = ObservationWriter(games.observe()[team], 0), []
    first = games.n_units[Team.BLUE] if team is Team.RED else 0
    while len(ticks) < n_ticks and not games.has_ended(0):
        if bank_s is not None:
            writer.set_clock(bank_s - len(ticks))
        orders = random_orders(rng, games)
        ticks.append((writer.write(), orders[0, first : first + games.n_units[team]].tobytes()))
        games.play(orders)
    return ticks


def any_ticks(rules: Ruleset, team: Team, seed: int, n_ticks: int, bank_s: float | None = None) -> Ticks:
    games, rng = BatchedGame(rules, 1), np.random.default_rng(seed)
    scatter(games, 0, rng)
    settle(games, 0, tick=0)
    return play(games, team, rng, n_ticks, bank_s)


def written(path: Path, header: TranscriptHeader, ticks: Ticks, result: MatchResult | None) -> bytes:
    path.unlink(missing_ok=True)
    with TranscriptWriter(path, header) as transcript:
        for tick in ticks:
            transcript.add(*tick)
        if result is not None:
            transcript.end(result)
    return path.read_bytes()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("transcripts")


@pytest.fixture(scope="module")
def small_ticks() -> Ticks:
    return play(lay(SMALL), Team.BLUE, np.random.default_rng(3), 4)


@pytest.fixture(scope="module")
def small(folder: Path, small_ticks: Ticks) -> bytes:
    return written(folder / "small", header_of(SMALL, Team.BLUE), small_ticks, RESULT)


def read_or_none(data: bytes) -> Transcript | None:
    """Read a transcript, let nothing but `JournalError` pass, and check that what is read can be used."""
    try:
        transcript = read_transcript(data)
    except JournalError:
        return None
    assert [one.tick for one in transcript.observations()] == list(range(len(transcript.ticks)))
    assert transcript.ending is None or transcript.ending.ticks >= 0
    return transcript


def is_found_out(data: bytes) -> bool:
    transcript = read_or_none(data)
    return transcript is None or not transcript.is_whole


@given(rulesets(max_side=12), st.sampled_from(Team), SEEDS, st.integers(0, 12), st.none() | RESULTS, TEXTS)
def test_what_is_written_is_read_back(
    folder: Path, rules: Ruleset, team: Team, seed: int, n_ticks: int, result: MatchResult | None, name: str
) -> None:
    header = header_of(rules, team, name=name, opponent=name[::-1])
    ticks = any_ticks(rules, team, seed, n_ticks, bank_s=10.0)

    transcript = read_transcript(written(folder / "any", header, ticks, result))

    assert (transcript.header, transcript.ticks, transcript.is_whole) == (header, ticks, True)
    assert transcript.ending == result
    assert repr(list(transcript.observations())) == repr(
        [ObservationReader(rules, team).read(data).seat(0, rules) for data, _ in ticks]
    )


@given(rulesets(max_side=12), st.sampled_from(Team), SEEDS, st.floats(0, 1000))
def test_a_head_is_the_same_with_a_clock_and_without(rules: Ruleset, team: Team, seed: int, bank_s: float) -> None:
    heads = [Head(), Head()]
    timed, untimed = (any_ticks(rules, team, seed, 6, bank) for bank in (bank_s, None))

    for (one, _), (other, _) in zip(timed, untimed, strict=True):
        assert one != other
        assert without_clock(one) == without_clock(other) == other
        assert int(ObservationReader(rules, team).read(without_clock(one)).clock_ms[0]) == NO_CLOCK_MS
        for head, data in zip(heads, (one, other), strict=True):
            head.add(data)

    assert heads[0].digest == heads[1].digest


def test_a_head_is_a_chain_of_all_that_was_shown(small: bytes, small_ticks: Ticks) -> None:
    chain = bytes(HEAD_BYTES)
    digests = [Head().digest]
    head = Head()
    for observation, _ in small_ticks:
        chain = sha256(chain + without_clock(observation)).digest()
        head.add(observation)
        digests.append(head.digest)

    assert digests[0] == bytes(HEAD_BYTES)
    assert len(set(digests)) == len(small_ticks) + 1
    assert read_transcript(small).head == digests[-1] == chain


def test_a_transcript_that_is_cut_anywhere_is_a_shorter_one_or_says_where(small: bytes, small_ticks: Ticks) -> None:
    n_read = []
    for length in range(len(small)):
        transcript = read_or_none(small[:length])
        if transcript is None:
            with pytest.raises(JournalError, match=f"it ends at byte {length}, within its "):
                read_transcript(small[:length])
        else:
            n_read.append(len(transcript.ticks))
            assert transcript.ticks == small_ticks[: n_read[-1]]
            assert transcript.ending is None

    assert len(n_read) > len(small) // 3
    assert all(before <= after for before, after in pairwise(n_read))
    assert set(n_read) == set(range(len(small_ticks) + 1))


def test_a_transcript_is_whole_only_at_the_end_of_a_record(small: bytes, small_ticks: Ticks) -> None:
    whole = [length for length in range(len(small)) if not is_found_out(small[:length])]
    record = 1 + 4 + sum(map(len, small_ticks[0])) + 4

    assert whole == [whole[0] + number * record for number in range(len(small_ticks) + 1)]


def test_every_byte_counts(small: bytes) -> None:
    assert not is_found_out(small)
    changed = [(at, flip) for at in range(len(small)) for flip in (1, 0x80, 0xFF)]

    assert [
        (at, flip) for at, flip in changed if not is_found_out(small[:at] + bytes([small[at] ^ flip]) + small[at + 1 :])
    ] == []


@given(data=st.data())
def test_no_random_edit_passes(small: bytes, data: st.DataObject) -> None:
    begin = data.draw(st.integers(0, len(small)))
    end = data.draw(st.integers(begin, min(begin + 40, len(small))))
    changed = small[:begin] + data.draw(st.binary(max_size=40)) + small[end:]

    transcript = read_or_none(changed)
    assert changed == small or transcript is None or transcript.ending is None


@given(st.binary(max_size=300))
def test_no_noise_is_a_transcript(noise: bytes) -> None:
    for data in (noise, MAGIC + noise, MAGIC + b"H" + len(noise).to_bytes(4, "little") + noise):
        assert read_or_none(data) is None


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"name": 7}, "a name is not text"),
        ({"pit_key": b"short"}, "a key is not 32 bytes"),
        ({"commitment": "c" * 32}, "a key is not 32 bytes"),
    ],
)
def test_a_header_of_other_values_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(JournalError, match=f"the transcript's header was changed: {sentence}"):
        TranscriptHeader.unpack(header_of(SMALL, Team.RED, **changes).pack())


def test_ticks_in_another_order_are_found_out(folder: Path, small_ticks: Ticks) -> None:
    with pytest.raises(JournalError, match="at tick 0 stands the observation of tick 3"):
        read_transcript(written(folder / "turned", header_of(SMALL, Team.BLUE), small_ticks[::-1], None))


def test_a_transcript_is_its_owner_s_alone(tmp_path: Path, small: bytes, small_ticks: Ticks) -> None:
    path = tmp_path / "seat.transcript"

    data = written(path, header_of(SMALL, Team.BLUE), small_ticks, RESULT)

    assert path.stat().st_mode & 0o777 == 0o600
    assert data == small
    assert load_transcript(path) == read_transcript(small)


def test_no_file_is_written_over(tmp_path: Path, small_ticks: Ticks) -> None:
    """A process that takes up the seat of one that was killed keeps what that one saw."""
    path, header = tmp_path / "seat.transcript", header_of(SMALL, Team.BLUE)
    path.write_bytes(b"of another")
    (tmp_path / "seat+2.transcript").symlink_to("/nowhere")

    for _ in range(2):
        with TranscriptWriter(path, header) as transcript:
            transcript.add(*small_ticks[0])

    assert path.read_bytes() == b"of another"
    assert transcript.path == tmp_path / "seat+4.transcript"
    assert [len(load_transcript(tmp_path / f"seat+{number}.transcript").ticks) for number in (3, 4)] == [1, 1]


def test_what_was_charged_stands_beside_the_turn_that_it_was_charged_for(tmp_path: Path, small_ticks: Ticks) -> None:
    """The pit tells it with the turn that follows; of the last, it is not known."""
    told = [-1, 250_000, -1, 2**32 - 2]
    with TranscriptWriter(tmp_path / "seat", header_of(SMALL, Team.BLUE)) as transcript:
        for (observation, orders), charged_us in zip(small_ticks, told, strict=True):
            transcript.add(observation, orders, charged_us)
        transcript.end(RESULT)

    assert load_transcript(tmp_path / "seat").charges_us == [250_000, None, 2**32 - 2, None]


def test_no_charge_that_is_told_breaks_a_transcript(tmp_path: Path, small_ticks: Ticks) -> None:
    with TranscriptWriter(tmp_path / "seat", header_of(SMALL, Team.BLUE)) as transcript:
        for tick, charged_us in zip(small_ticks, (0, 2**32 - 1, 2**63, -(2**63)), strict=True):
            transcript.add(*tick, charged_us)

    assert load_transcript(tmp_path / "seat").charges_us == [None] * 4


@pytest.mark.parametrize("version", [1, 2])
def test_a_transcript_of_an_earlier_version_is_read(version: int, small: bytes, small_ticks: Ticks) -> None:
    record, start = 1 + 4 + sum(map(len, small_ticks[0])) + 4, small.index(b"T" + b"\xff" * 4 + small_ticks[0][0])
    ticks = [small[start + number * record :][:record] for number in range(len(small_ticks))]
    rest = small[start + len(ticks) * record : -HEAD_BYTES]
    magic, n_charge = b"TRANSCRIPT-%d" % version, 4 * (version - 1)
    records = (b"T" + tick[1:][:n_charge] + tick[5:-4] for tick in ticks)
    old = small[:start].replace(b"TRANSCRIPT-3", magic) + b"".join(records) + rest

    read = read_transcript(old + sha256(old).digest())

    assert (read.ticks, read.ending, read.is_whole) == (small_ticks, RESULT, True)
    assert read.charges_us == [None] * len(small_ticks)
    assert read.annotations == [{"log": [], "draw": []}] * len(small_ticks)
    assert read.head == read_transcript(small).head


def test_what_a_fighter_noted_is_kept_with_its_tick(tmp_path: Path, small_ticks: Ticks) -> None:
    noted = Annotations(SMALL.side)
    noted.log("here I stand")
    noted.draw.path([(0, 0), (0, 1)], "red")
    with TranscriptWriter(tmp_path / "seat", header_of(SMALL, Team.BLUE)) as transcript:
        for number, tick in enumerate(small_ticks):
            transcript.add(*tick, annotations=noted.pack() if number == 2 else b"")

    nothing = {"log": [], "draw": []}
    drawn = {"log": ["here I stand"], "draw": [{"path": [[0, 0], [0, 1]], "colour": "red"}]}
    assert load_transcript(tmp_path / "seat").annotations == [nothing, nothing, drawn, nothing]


def test_annotations_that_were_changed_are_named_with_their_tick(tmp_path: Path, small_ticks: Ticks) -> None:
    with TranscriptWriter(tmp_path / "seat", header_of(SMALL, Team.BLUE)) as transcript:
        transcript.add(*small_ticks[0], annotations=b"junk")

    with pytest.raises(JournalError, match="changed: at tick 0 the annotations cannot be read"):
        load_transcript(tmp_path / "seat")


def test_a_transcript_of_a_newer_version_is_named_as_such(small: bytes) -> None:
    with pytest.raises(JournalError, match="the transcript is of format 4, which this arena does not know"):
        read_transcript(small.replace(b"TRANSCRIPT-3", b"TRANSCRIPT-4"))


def test_a_tick_costs_no_system_call(tmp_path: Path, small_ticks: Ticks) -> None:
    with TranscriptWriter(tmp_path / "seat", header_of(SMALL, Team.BLUE)) as transcript:
        n_header_bytes = (tmp_path / "seat").stat().st_size
        transcript.add(*small_ticks[0])
        assert (tmp_path / "seat").stat().st_size == n_header_bytes > 0
    assert read_transcript((tmp_path / "seat").read_bytes()).ticks == small_ticks[:1]


def test_what_comes_after_the_end_is_not_kept(tmp_path: Path, small: bytes, small_ticks: Ticks) -> None:
    with TranscriptWriter(tmp_path / "seat", header_of(SMALL, Team.BLUE)) as transcript:
        for tick in small_ticks:
            transcript.add(*tick)
        transcript.end(RESULT)
        transcript.add(*small_ticks[0])
        transcript.end(RESULT)

    assert (tmp_path / "seat").read_bytes() == small


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot write the transcript .*/absent/seat: No such file or directory"):
        TranscriptWriter(tmp_path / "absent" / "seat", header_of(SMALL, Team.BLUE))


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")  # noqa: PTH110
def test_a_full_disk_ends_the_transcript_with_one_warning(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path, small_ticks: Ticks
) -> None:
    opened = os.open
    monkeypatch.setattr("os.open", lambda path, flags, mode: opened("/dev/full", os.O_WRONLY))
    transcript = TranscriptWriter(tmp_path / "seat", header_of(SMALL, Team.BLUE))

    with caplog.at_level(logging.WARNING):
        for _ in range(3_000):
            transcript.add(*small_ticks[0])
        transcript.end(RESULT)
        transcript.close()

    assert [record.getMessage() for record in caplog.records] == [
        f"the transcript {tmp_path / 'seat'} ends here: No space left on device"
    ]


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, small: bytes) -> None:
    (tmp_path / "other").write_bytes(b"hello, this is no transcript")
    (tmp_path / "small").write_bytes(small)

    assert [is_transcript(tmp_path / name) for name in ("small", "other", "absent", ".")] == [True, False, False, False]
    with pytest.raises(InputError, match=r"cannot read .*absent: No such file"):
        load_transcript(tmp_path / "absent")
    with pytest.raises(JournalError, match=r"other: this is not a transcript: its first line is another"):
        load_transcript(tmp_path / "other")


@given(st.lists(st.tuples(TEXTS, TEXTS, st.sampled_from(Team)), min_size=2, max_size=6, unique=True))
def test_no_two_seats_share_a_file_name(seats: list[tuple[str, str, Team]]) -> None:
    names = [transcript_name(*seat) for seat in seats]

    assert len(set(names)) == len(seats)
    assert all("/" not in name and name.isascii() and name.endswith(".transcript") for name in names)


def test_a_file_name_says_whose_it_is() -> None:
    assert transcript_name("pit", "0007-one-other", Team.RED) == "pit+0007-one-other+red.transcript"
