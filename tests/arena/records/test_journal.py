"""Journals: what is written is read back, and nothing that was cut, changed or made up passes for one."""

import os
import struct
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import InputError, JournalError
from arena.game.ruleset import RULESETS, Ruleset, load
from arena.game.types import RULES_VERSION, Team, Termination
from arena.local.venue import MatchRecord
from arena.policy import MatchResult
from arena.records.journal import CHAIN_BYTES, MAGIC, Mark, journal_name, link, read_journal, save_journal, write_ending
from arena.records.journal_folder import find_journals, load_journal
from arena.records.replay import BrokenChainError, verify

texts = st.text(st.characters(exclude_categories=["Cs"]))
Change = Callable[[dict[str, Any]], object]


def is_found_out(data: bytes) -> bool:
    """Whether reading or verifying says that something is wrong, in a sentence; any other error is an error of the test."""
    try:
        verify(read_journal(data))
    except (JournalError, BrokenChainError) as error:
        return "journal" in str(error)
    return False


def header_bytes(data: bytes) -> tuple[int, int]:
    """Return where the packed header begins and ends."""
    begin = len(MAGIC) + 1 + 4
    (length,) = struct.unpack_from("<I", data, begin - 4)
    return begin, begin + length


def with_header(data: bytes, change: Change) -> bytes:
    """Return a journal whose header holds other values, well packed."""
    begin, end = header_bytes(data)
    values = msgpack.unpackb(data[begin:end])
    change(values)
    packed = msgpack.packb(values)
    return data[: begin - 4] + struct.pack("<I", len(packed)) + packed + data[end:]


def with_ending(data: bytes, change: Change) -> bytes:
    """Return a journal that ends otherwise, with a link of the chain that fits."""
    journal = read_journal(data)
    old = write_ending(journal.ticks[-1].chain, journal.ending)
    body = data.removesuffix(old)
    values = msgpack.unpackb(old[5:-CHAIN_BYTES])
    change(values)
    packed = msgpack.packb(values)
    return body + b"E" + struct.pack("<I", len(packed)) + packed + link(journal.ticks[-1].chain, packed)


def test_what_is_written_is_read_back(small_rules: Ruleset, played: Callable[..., MatchRecord]) -> None:
    record = played(small_rules, "league/one/other/0000")
    assert record.journal is not None

    journal = read_journal(record.journal)

    assert journal.header.identity == "league/one/other/0000"
    assert (journal.header.blue, journal.header.red) == ("one", "other")
    assert journal.header.keys == record.plan.keys
    assert (journal.header.ruleset, journal.header.ruleset.hash) == (small_rules, small_rules.hash)
    assert journal.ending == record.result
    assert len(journal.ticks) == record.result.ticks
    assert verify(journal) == record.result.ticks


@pytest.mark.parametrize("name", RULESETS)
def test_a_journal_under_any_shipped_ruleset_holds(name: str, played: Callable[..., MatchRecord]) -> None:
    record = played(load(name))
    assert record.journal is not None

    journal = read_journal(record.journal)

    assert journal.header.ruleset == load(name)
    assert verify(journal) == record.result.ticks


def test_orders_are_one_byte_a_unit_blue_first(
    small_rules: Ruleset, played: Callable[..., MatchRecord], every_tick: Callable[..., Any]
) -> None:
    record = played(small_rules, blue=every_tick([1, 2]), red=every_tick([3, 4]))
    assert record.journal is not None

    assert {tick.orders for tick in read_journal(record.journal).ticks} == {bytes([1, 2, 3, 4])}
    assert {tick.marks for tick in read_journal(record.journal).ticks} == {(Mark(0), Mark(0))}


def test_a_journal_that_is_cut_anywhere_says_where(small_journal: bytes) -> None:
    for length in range(len(small_journal)):
        with pytest.raises((JournalError, BrokenChainError)) as found:
            verify(read_journal(small_journal[:length]))
        said = str(found.value)
        assert f"it ends at byte {length}, within " in said or "unfinished: it stops after tick " in said


def test_a_journal_that_is_cut_within_a_tick_names_the_tick(small_journal: bytes) -> None:
    _, end = header_bytes(small_journal)
    first_tick = end + CHAIN_BYTES

    with pytest.raises(JournalError, match=r"within the record of tick 1$"):
        read_journal(small_journal[: first_tick + 1])
    with pytest.raises(JournalError, match="within its header"):
        read_journal(small_journal[: end - 1])
    with pytest.raises(JournalError, match="within its ending"):
        read_journal(small_journal[:-1])


def test_a_journal_without_an_ending_is_read_and_does_not_verify(small_journal: bytes) -> None:
    whole = read_journal(small_journal)
    data = small_journal.removesuffix(write_ending(whole.ticks[-1].chain, whole.ending))

    journal = read_journal(data)

    assert (journal.ending, journal.ending_chain, journal.ticks) == (None, None, whole.ticks)
    with pytest.raises(BrokenChainError, match=f"unfinished: it stops after tick {len(whole.ticks)}, without an ending"):
        verify(journal)


def test_every_byte_counts(small_journal: bytes, size: Callable[[int, int], int]) -> None:
    """Each byte in turn becomes another: by one bit at each end, all bits, and in full size every other value."""
    assert not is_found_out(small_journal)
    flips = range(1, 256) if size(0, 1) else (1, 0x80, 0xFF)
    missed = []
    for position, before in enumerate(small_journal):
        for flip in flips:
            changed = bytearray(small_journal)
            changed[position] = before ^ flip
            if not is_found_out(bytes(changed)):
                missed.append((position, flip))

    assert missed == []


@given(data=st.data())
def test_no_random_edit_passes(small_journal: bytes, data: st.DataObject) -> None:
    begin = data.draw(st.integers(0, len(small_journal)))
    end = data.draw(st.integers(begin, min(begin + 40, len(small_journal))))
    changed = small_journal[:begin] + data.draw(st.binary(max_size=40)) + small_journal[end:]

    assert changed == small_journal or is_found_out(changed)


@given(st.binary(max_size=300))
def test_no_noise_is_a_journal(noise: bytes) -> None:
    assert is_found_out(noise)
    assert is_found_out(MAGIC + noise)
    assert is_found_out(MAGIC + b"H" + struct.pack("<I", len(noise)) + noise)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | texts | st.binary(max_size=40),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts | st.binary(max_size=4), inner, max_size=4),
        max_leaves=8,
    ),
    st.data(),
)
def test_no_value_of_the_header_can_be_replaced(small_journal: bytes, value: object, data: st.DataObject) -> None:
    """The values are well packed, so what is tried is how they are read."""
    begin, end = header_bytes(small_journal)
    header = msgpack.unpackb(small_journal[begin:end])
    table = data.draw(st.sampled_from([(), ("ruleset",), ("ruleset", "units"), ("ruleset", "units", "ugv")]))
    inner = header
    for key in table:
        inner = inner[key]
    name = data.draw(st.sampled_from(sorted(inner)) | texts)

    def change(values: dict[str, Any]) -> None:
        for key in table:
            values = values[key]
        values[name] = value

    assert is_found_out(with_header(small_journal, change)) or inner.get(name) == value


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            lambda header: header.update(rules_version=RULES_VERSION + 1),
            f"written under version {RULES_VERSION + 1} of the rules",
        ),
        (lambda header: header.update(match_key=b"short"), "its keys are not 32 bytes each"),
        (lambda header: header.update(map_key="a" * 32), "its keys are not 32 bytes each"),
        (lambda header: header.update(blue=7), "a name is not text"),
        (lambda header: header.pop("ruleset"), "header was changed: KeyError('ruleset')"),
        (lambda header: header["ruleset"].update(sidee=4), "did you mean 'side'"),
        (lambda header: header["ruleset"].update(side=15), "it must be even"),
        (lambda header: header.update(more=1), "its bytes are not as the arena writes them"),
        (lambda header: header.update(identity=header.pop("identity")), "its bytes are not as the arena writes them"),
    ],
)
def test_a_changed_header_is_refused_with_what_is_wrong(small_journal: bytes, change: Change, sentence: str) -> None:
    with pytest.raises(JournalError) as found:
        read_journal(with_header(small_journal, change))

    assert sentence in str(found.value)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda header: header.update(match_key=bytes(32)), "its header was changed, or its board"),
        (lambda header: header.update(red="somebody"), "its header was changed, or its board"),
        (lambda header: header["ruleset"].pop("board"), "its header was changed"),
        (lambda header: header["ruleset"].update(tick_limit=9), "its header was changed, or its board"),
    ],
)
def test_a_header_that_is_another_match_s_does_not_verify(small_journal: bytes, change: Change, sentence: str) -> None:
    with pytest.raises(BrokenChainError, match=sentence):
        verify(read_journal(with_header(small_journal, change)))


def test_a_header_with_which_no_board_can_be_drawn_does_not_verify(played: Callable[..., MatchRecord]) -> None:
    record = played(load("paper").with_({"side": 8, "units": {"ugv": {"blue": 14, "red": 14}}}))
    assert record.journal is not None
    crowded = with_header(record.journal, lambda header: header["ruleset"].update(side=4))

    with pytest.raises(BrokenChainError, match=r"its header was changed: .*boards had room"):
        verify(read_journal(crowded))


@pytest.mark.parametrize(
    "change",
    [
        lambda ending: ending.update(winner="red" if ending["winner"] == "blue" else "blue"),
        lambda ending: ending.update(score=ending["score"] + 1),
        lambda ending: ending.update(score=float(ending["score"])),
        lambda ending: ending.update(ticks=ending["ticks"] + 1),
        lambda ending: ending.update(ticks=str(ending["ticks"])),
        lambda ending: ending.update(ending="tick_limit" if ending["ending"] != "tick_limit" else "capture"),
        lambda ending: ending.update(ending="surrender"),
        lambda ending: ending.update(ending="running"),
        lambda ending: ending.update(reason="because"),
        lambda ending: ending.update(more=1),
        lambda ending: ending.pop("score"),
        lambda ending: ending.clear(),
    ],
)
def test_another_ending_is_found_out_even_with_a_link_that_fits(small_journal: bytes, change: Change) -> None:
    changed = with_ending(small_journal, change)

    assert changed != small_journal
    assert is_found_out(changed)


def test_ticks_after_the_end_are_found_out(small_journal: bytes) -> None:
    journal = read_journal(small_journal)
    length = 1 + 4 + 2 + CHAIN_BYTES
    ending = write_ending(journal.ticks[-1].chain, journal.ending)
    body = small_journal.removesuffix(ending)

    with pytest.raises(BrokenChainError, match="the match was over after tick"):
        verify(read_journal(body + body[-length:] + ending))
    with pytest.raises(JournalError, match="bytes follow its ending"):
        read_journal(small_journal + b"T")


def test_ticks_in_another_order_are_found_out(small_journal: bytes) -> None:
    _, end = header_bytes(small_journal)
    length, first = 1 + 4 + 2 + CHAIN_BYTES, end + CHAIN_BYTES
    one, two = small_journal[first : first + length], small_journal[first + length : first + 2 * length]

    with pytest.raises(BrokenChainError, match="at tick 1 "):
        verify(read_journal(small_journal[:first] + two + one + small_journal[first + 2 * length :]))


def test_a_change_is_found_at_its_tick(small_journal: bytes) -> None:
    _, end = header_bytes(small_journal)
    length = 1 + 4 + 2 + CHAIN_BYTES
    for tick in range(1, len(read_journal(small_journal).ticks) + 1):
        changed = bytearray(small_journal)
        changed[end + CHAIN_BYTES + (tick - 1) * length + 1] ^= 7
        with pytest.raises(BrokenChainError, match=f"at tick {tick} its orders or its state were changed") as found:
            verify(read_journal(bytes(changed)))
        assert found.value.tick == tick


def test_a_marked_tick_cannot_be_cleared(small_journal: bytes) -> None:
    _, end = header_bytes(small_journal)
    changed = bytearray(small_journal)
    changed[end + CHAIN_BYTES + 1 + 4] = Mark.LATE

    with pytest.raises(BrokenChainError, match="at tick 1 "):
        verify(read_journal(bytes(changed)))


def test_a_frame_of_a_great_length_is_refused_before_it_is_read() -> None:
    with pytest.raises(JournalError, match="its header claims 4294967295 bytes"):
        read_journal(MAGIC + b"H" + b"\xff" * 4)


def test_the_canonical_hash_is_of_the_bytes(small_journal: bytes) -> None:
    assert read_journal(small_journal).canonical_hash == sha256(small_journal).hexdigest()


def test_a_saved_journal_is_its_owner_s_alone_and_is_loaded_again(tmp_path: Path, small_journal: bytes) -> None:
    save_journal(str(tmp_path), "a/b", small_journal)
    [path] = find_journals([tmp_path])

    assert path.stat().st_mode & 0o777 == 0o600
    assert path.read_bytes() == small_journal
    assert load_journal(path) == read_journal(small_journal)


def test_no_journal_is_written_over_by_another_of_its_name(tmp_path: Path, small_journal: bytes) -> None:
    kept = [small_journal + bytes(100), small_journal + b"1", small_journal, small_journal]
    for data in kept:
        save_journal(str(tmp_path), "a", data)

    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {
        "a.journal.1": kept[0],
        "a.journal.2": kept[1],
        "a.journal": small_journal,
    }


def test_a_journal_that_does_not_fit_on_the_disk_leaves_nothing_and_spoils_none(
    tmp_path: Path, small_journal: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_journal(str(tmp_path), "a", small_journal)
    write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:10]))

    for identity in ("a", "b"):
        with pytest.raises(OSError, match="No space left"):
            save_journal(str(tmp_path), identity, small_journal + b"more")

    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {journal_name("a"): small_journal}


@given(st.lists(texts, min_size=2, max_size=6, unique=True))
def test_no_two_identities_share_a_file_name(identities: list[str]) -> None:
    names = [journal_name(identity) for identity in identities]

    assert len(set(names)) == len(identities)
    assert all("/" not in name and name.isascii() and name.endswith(".journal") for name in names)


@pytest.mark.parametrize(
    ("one", "other"), [("a/b", "a+b"), ("a b", "a%20b"), ("..", "%2E%2E"), ("a/b", "a%2Fb"), ("é", "e\u0301")]
)
def test_identities_that_look_alike_have_names_of_their_own(one: str, other: str) -> None:
    assert journal_name(one) != journal_name(other)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "not.journal").write_bytes(b"hello, this is no journal")

    with pytest.raises(InputError, match=r"cannot read .*absent.journal: No such file"):
        load_journal(tmp_path / "absent.journal")
    with pytest.raises(JournalError, match=r"not.journal: this is not a journal: its first line is another"):
        load_journal(tmp_path / "not.journal")


def test_a_folder_without_journals_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no journals"):
        list(find_journals([tmp_path]))


def test_journals_of_a_folder_come_by_name(tmp_path: Path, small_journal: bytes) -> None:
    for identity in ("c", "a", "b"):
        save_journal(str(tmp_path), identity, small_journal)
    (tmp_path / "notes.txt").write_text("no journal")

    assert [path.stem for path in find_journals([tmp_path])] == ["a", "b", "c"]
    assert list(find_journals([tmp_path / "notes.txt"])) == [tmp_path / "notes.txt"]


def test_a_result_is_kept_whole() -> None:
    result = MatchResult(ending=Termination.FORFEIT, winner=Team.RED, score=-100, ticks=0, reason="blue vanished")

    assert write_ending(bytes(32), result) != write_ending(
        bytes(32), MatchResult(ending=Termination.FORFEIT, winner=Team.RED, score=-100, ticks=0, reason="blue was late")
    )
