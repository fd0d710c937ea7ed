"""Bundles: each journal whole, as it was, or not there, wherever a bundle was cut or changed."""

import os
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import msgpack
import pytest

from arena.errors import JournalError
from arena.records import journal_bundle
from arena.records.journal_bundle import MAGIC, Bundle, BundleWriter

KEPT = {"small/0": b"one journal", "a/../%b c": bytes(range(216, 256)), "": b"", "x" * 40: b"another"}


def write(folder: Path, journals: dict[str, bytes] = KEPT) -> Path:
    """Write a bundle, and return where it is."""
    with BundleWriter(folder) as writer:
        for identity, data in journals.items():
            writer.add([(identity, data)])
    [path] = sorted(folder.iterdir())[-1:]
    return path


def read(path: Path) -> dict[str, bytes]:
    bundle = Bundle(path)
    bundle.look()
    return {identity: bundle.read(identity) for identity in bundle}


def index_at(path: Path) -> int:
    """Return where a bundle's index begins."""
    return int.from_bytes(path.read_bytes()[-16:-8], "little")


def test_what_is_written_is_read_back_with_the_index_and_without_it(tmp_path: Path) -> None:
    path = write(tmp_path)
    assert read(path) == KEPT
    assert path.stat().st_mode & 0o777 == 0o600

    os.truncate(path, index_at(path))

    assert read(path) == KEPT


def test_a_bundle_that_is_cut_anywhere_holds_the_journals_before_the_cut(tmp_path: Path) -> None:
    path = write(tmp_path)
    data, ends = path.read_bytes(), [len(MAGIC)]
    for identity, journal in KEPT.items():
        ends.append(ends[-1] + 13 + len(identity.encode()) + len(journal))
    assert ends[-1] == index_at(path)

    for n_bytes in reversed(range(len(data))):
        os.truncate(path, n_bytes)
        n_whole = sum(end <= n_bytes for end in ends[1:])
        assert read(path) == dict(list(KEPT.items())[:n_whole]), n_bytes


def test_no_changed_byte_makes_another_journal(tmp_path: Path, size: Callable[[int, int], int]) -> None:
    path = write(tmp_path)
    whole = path.read_bytes()

    for place in range(0, len(whole), size(3, 1)):
        with path.open("r+b") as file:
            file.write(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        bundle = Bundle(path)
        try:
            bundle.look()
        except JournalError:
            assert place < len(MAGIC)
        for identity in bundle:
            try:
                assert bundle.read(identity) == KEPT[identity]
            except JournalError as error:
                assert "was changed" in str(error)  # noqa: PT017 - most bytes are of another journal, which is read


def test_a_bundle_is_read_while_it_grows(tmp_path: Path) -> None:
    with BundleWriter(tmp_path) as writer:
        writer.add([("a", b"1"), ("b", b"22")])
        [path] = tmp_path.iterdir()
        bundle = Bundle(path)
        bundle.look()
        assert list(bundle) == ["a", "b"]
        writer.add([("c", b"333")])
        assert "c" not in bundle
        bundle.look()
        assert bundle.read("c") == b"333"
    bundle.look()
    assert [bundle.read(identity) for identity in bundle] == [b"1", b"22", b"333"]


def test_writers_in_one_folder_have_files_of_their_own_and_a_full_one_is_followed_by_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal_bundle, "MOST_BYTES", 100)
    with BundleWriter(tmp_path) as one, BundleWriter(tmp_path) as other:
        for number in range(4):
            one.add([(f"one/{number}", bytes(70))])
            other.add([(f"other/{number}", bytes(20))])

    held = {path.name: list(read(path)) for path in tmp_path.iterdir()}
    assert len(held) == 6
    assert sorted(identity for identities in held.values() for identity in identities) == sorted(
        f"{who}/{number}" for who in ("one", "other") for number in range(4)
    )


def test_a_writer_without_journals_leaves_no_file(tmp_path: Path) -> None:
    with BundleWriter(tmp_path):
        pass

    assert list(tmp_path.iterdir()) == []


def test_what_does_not_fit_on_the_disk_spoils_nothing_before_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_some = os.write
    with BundleWriter(tmp_path) as writer:
        with monkeypatch.context() as patch:
            patch.setattr(os, "write", lambda descriptor, data: write_some(descriptor, data[:10]))
            with pytest.raises(OSError, match="No space left"):
                writer.add([("first", b"1")])
        writer.add([("a", b"1")])
        monkeypatch.setattr(os, "write", lambda descriptor, data: write_some(descriptor, data[:10]))
        with pytest.raises(OSError, match="No space left"):
            writer.add([("b", b"22"), ("c", b"333")])

    [path] = tmp_path.iterdir()
    assert read(path) == {"a": b"1"}
    assert path.stat().st_size == len(MAGIC) + 13 + 2, "half a journal stays behind, or half an index"


@pytest.mark.parametrize(
    ("first", "says"),
    [
        (b"ARENA-JOURNALS-2\n", "is of format 2, which this arena does not know; install a newer arena"),
        (b"ARENA-JOURNAL-1\n.", "is no bundle of journals: its first line is another"),
        (b"what is this? \xff\xff\xff", "is no bundle of journals: its first line is another"),
    ],
)
def test_what_is_no_bundle_of_this_format_is_refused(first: bytes, says: str, tmp_path: Path) -> None:
    path = write(tmp_path)
    path.write_bytes(first + path.read_bytes()[len(MAGIC) :])

    with pytest.raises(JournalError, match=f"{path.name} {says}"):
        read(path)


def test_a_length_that_nothing_has_takes_no_memory(tmp_path: Path) -> None:
    path = write(tmp_path, {"a": b"1"})
    data = bytearray(path.read_bytes()[: index_at(path)])
    data[len(MAGIC) + 5 : len(MAGIC) + 9] = b"\xff\xff\xff\xf0"
    path.write_bytes(data)
    os.truncate(path, 1 << 33)  # with holes
    bundle = Bundle(path)

    bundle.look()

    with pytest.raises(JournalError, match=r"the journal of a in the bundle 000001.journals was changed"):
        bundle.read("a")


@pytest.mark.parametrize("is_indexed", [True, False])
def test_a_strangers_bundle_takes_no_more_memory_than_a_journal(tmp_path: Path, is_indexed: bool) -> None:
    """Whose file says that the name of a match has 4 GB, and has holes if need be."""
    path, head = tmp_path / "1.journals", journal_bundle._HEAD.pack(b"J", 2**32 - 1, 0, 0)
    index = journal_bundle._pack(b"I", b"", msgpack.packb({"a": len(MAGIC)}))
    trailer = journal_bundle._TRAILER.pack(len(MAGIC + head), b"JOURNALS")
    path.write_bytes(MAGIC + head + (index + trailer if is_indexed else b""))
    if not is_indexed:
        os.truncate(path, 2**32 + 100)
    bundle = Bundle(path)
    tracemalloc.start()

    bundle.look()
    found = list(bundle)
    for identity in found:
        with pytest.raises(JournalError, match="was changed"):
            bundle.read(identity)

    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found == (["a"] if is_indexed else [])
    assert most < 1 << 20
