"""Where a journal is: by its identity or by its path, in a file or in a bundle, it is the same bytes."""

import os
from pathlib import Path

import pytest

from arena.errors import InputError, JournalError
from arena.records import journal_bundle
from arena.records.journal import journal_name, read_journal, save_journal
from arena.records.journal_bundle import MAGIC, BundleWriter
from arena.records.journal_folder import JournalFolder, find_journals, has_journals, load_journal, read_recorded
from arena.records.recording import load_recording

STRANGE = ["a/b", "a+b", "../../etc/passwd", "..", "%2e%2e", "\x00", "é" * 200, "a.journals", "a\nb", "x" * 2_000]


def bundle(folder: Path, *identities: str, data: bytes = b"in a bundle") -> None:
    with BundleWriter(folder) as writer:
        writer.add((identity, data + identity.encode()) for identity in identities)


def test_a_journal_is_found_by_any_name_that_a_match_has(tmp_path: Path) -> None:
    bundle(tmp_path, *STRANGE)
    folder = JournalFolder(tmp_path)

    for identity in STRANGE:
        data = b"in a bundle" + identity.encode()
        assert folder.holds(identity)
        assert folder.read(identity) == data
        assert read_recorded(tmp_path / journal_name(identity)) == data
        assert read_recorded(tmp_path / "000001.journals" / journal_name(identity)) == data
        assert list(find_journals([tmp_path / journal_name(identity)])) == [tmp_path / journal_name(identity)]
    assert folder.identities() == folder.bundled() == set(STRANGE)


def test_a_journal_in_a_strangers_bundle_is_found_whose_name_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "1.journals").write_bytes(MAGIC + journal_bundle._pack(b"J", b"ann\xff", b"a journal"))

    [found] = find_journals([tmp_path])

    assert found.name == "ann%FF.journal"
    assert read_recorded(found) == b"a journal"


@pytest.mark.parametrize("identity", ["absent", "a/absent", "b" * 2_000])
def test_what_is_not_there_is_not_found_by_any_name(identity: str, tmp_path: Path) -> None:
    bundle(tmp_path, "a")

    assert not JournalFolder(tmp_path).holds(identity)
    for path in (tmp_path, tmp_path / "000001.journals", tmp_path / "nowhere"):
        with pytest.raises(FileNotFoundError):
            read_recorded(path / journal_name(identity))
        with pytest.raises(InputError, match=r"cannot read .*: No such file"):
            list(find_journals([path / journal_name(identity)]))


def test_a_file_counts_before_bundles_and_a_later_bundle_before_others(tmp_path: Path) -> None:
    folder = JournalFolder(tmp_path)
    bundle(tmp_path, "a", "b", data=b"1")
    assert [folder.read(identity) for identity in "ab"] == [b"1a", b"1b"]
    bundle(tmp_path, "a", "b", data=b"2")
    assert [folder.read(identity) for identity in "ab"] == [b"2a", b"2b"]
    save_journal(str(tmp_path), "b", b"3b")

    assert [folder.read(identity) for identity in "ab"] == [b"2a", b"3b"]
    assert [folder.bundled(), folder.identities()] == [{"a"}, {"a", "b"}]
    assert read_recorded(tmp_path / "000001.journals" / "b.journal") == b"1b"
    assert [path.name for path in find_journals([tmp_path])] == ["a.journal", "b.journal"]


def test_a_journal_in_a_bundle_is_loaded_like_a_file(tmp_path: Path, small_journal: bytes) -> None:
    with BundleWriter(tmp_path) as writer:
        writer.add([("a", small_journal), ("b", small_journal[:-1])])

    assert load_journal(tmp_path / "a.journal") == load_recording(tmp_path / "a.journal") == read_journal(small_journal)
    with pytest.raises(JournalError, match=r"b.journal: the journal is truncated"):
        load_journal(tmp_path / "b.journal")


def test_journals_of_folders_and_of_bundles_come_by_name(tmp_path: Path) -> None:
    for folder, identities in {"one": "cb", "two/below": "d"}.items():
        (tmp_path / folder).mkdir(parents=True)
        bundle(tmp_path / folder, *identities)
    save_journal(str(tmp_path / "one"), "a", b"in a file")
    save_journal(str(tmp_path / "one"), "b", b"in a file")

    found = [path.relative_to(tmp_path) for path in find_journals([tmp_path])]
    assert found == [Path("one/a.journal"), Path("one/b.journal"), Path("one/c.journal"), Path("two/below/d.journal")]
    inside = tmp_path / "one" / "000001.journals"
    assert list(find_journals([inside])) == [inside / "b.journal", inside / "c.journal"]


def test_a_bundle_of_a_newer_format_is_told_whatever_is_asked(tmp_path: Path) -> None:
    bundle(tmp_path, "a")
    path = tmp_path / "000001.journals"
    path.write_bytes(path.read_bytes().replace(MAGIC, b"ARENA-JOURNALS-7\n"))
    folder = JournalFolder(tmp_path)

    for ask in (lambda: folder.holds("b"), folder.identities, lambda: folder.read("a"), lambda: list(find_journals([tmp_path]))):
        with pytest.raises(JournalError, match=r"000001.journals is of format 7"):
            ask()
    assert has_journals(tmp_path)


def test_what_is_called_like_a_bundle_and_is_none_is_left_alone(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    folder = tmp_path / "kept.journals"
    for place in (elsewhere, folder):
        place.mkdir()
    bundle(elsewhere, "far")
    bundle(folder, "near")
    (folder / "000002.journals").symlink_to(elsewhere / "000001.journals")
    (folder / "000003.journals").symlink_to(elsewhere / "absent")
    os.mkfifo(folder / "000004.journals")

    assert {path.stem for path in find_journals([folder])} == {"near", "far"}
    assert JournalFolder(folder).read("far") == b"in a bundlefar"
    before = (elsewhere / "000001.journals").read_bytes()
    bundle(folder, "new")
    assert (elsewhere / "000001.journals").read_bytes() == before
    assert sorted(path.name for path in folder.iterdir())[-1] == "000005.journals"


def test_each_of_a_thousand_bundles_is_looked_into_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(1_000):
        (tmp_path / f"{number:06}.journals").write_bytes(b"")
    for number in range(4):
        bundle(tmp_path, f"in/{number}")
    looked, scan = [], journal_bundle.open_file

    def count(path: Path) -> object:
        looked.append(path)
        return scan(path)

    monkeypatch.setattr(journal_bundle, "open_file", count)
    folder = JournalFolder(tmp_path)

    for number in range(4):
        assert folder.read(f"in/{number}")
    assert len(looked) == 4 + 4, "to look into it, and to read"
