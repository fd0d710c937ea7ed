"""Submissions: what an author has, as bytes, and as a folder again; and bytes that somebody made who means ill."""

import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arena.errors import InputError
from arena.submission import MARK, MOST_DEPTH, MOST_FILES, Submission, digest_of, read_source, unpack

BOT = b"def act(seen):\n    return [0] * len(seen.units)\n"
MOST = 1 << 20
NAMES = st.from_regex(r"[a-z0-9_-][a-z0-9_.+-]{0,20}", fullmatch=True)
FOLDERS = st.dictionaries(
    st.lists(NAMES, min_size=1, max_size=MOST_DEPTH - 1).map(lambda parts: "/".join(["in", *parts])), st.binary(max_size=64)
).filter(lambda files: not any(other.startswith(f"{path}/") for path in files for other in files))


def packed(*files: tuple[str, bytes], kind: str = "bot", main: str = "bot.py", sizes: list[object] | None = None) -> bytes:
    """Return bytes as `Submission.pack` makes them, of whatever one likes."""
    header: bytes = msgpack.packb([kind, main, [[path, len(data)] for path, data in files] if sizes is None else sizes])
    return b"arena submission 1\n" + len(header).to_bytes(4, "big") + header + b"".join(data for _, data in files)


def lay(folder: Path, files: dict[str, bytes]) -> Path:
    for path, data in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(data)
    return folder


@given(FOLDERS)
def test_what_is_packed_is_unpacked_and_the_same_files_give_the_same_bytes(files: dict[str, bytes]) -> None:
    given_first = Submission(kind="bot", main="bot.py", files={"bot.py": BOT, **files})
    in_another_order = Submission(kind="bot", main="bot.py", files={**dict(reversed(files.items())), "bot.py": BOT})

    data = given_first.pack()

    assert unpack(data, MOST) == given_first
    assert digest_of(in_another_order.pack()) == digest_of(data)


@given(st.binary(max_size=200), st.integers(0, 200), st.booleans())
def test_junk_and_changed_bytes_give_a_sentence_or_a_submission(junk: bytes, at: int, is_header_kept: bool) -> None:
    genuine = packed(("bot.py", BOT), ("a/b.txt", b"data"))
    data = genuine[:at] + junk if is_header_kept else junk

    found = None
    with suppress(InputError):
        found = unpack(data, MOST)

    assert found is None or found.main in found.files


HOSTILE = {
    "to the root": (packed(("bot.py", BOT), ("/etc/passwd", b"")), "none leads out of the folder"),
    "upwards": (packed(("bot.py", BOT), ("a/../../b", b"")), "none leads out of the folder"),
    "upwards at once": (packed(("bot.py", BOT), ("..", b"")), "none leads out of the folder"),
    "by backslash": (packed(("bot.py", BOT), ("..\\b", b"")), "none leads out of the folder"),
    "hidden": (packed(("bot.py", BOT), (MARK, b"")), "begin with no dot"),
    "no name": (packed(("bot.py", BOT), ("a//b", b"")), "letters, digits"),
    "a NUL": (packed(("bot.py", BOT), ("a\0b", b"")), "letters, digits"),
    "a terminal's order": (packed(("bot.py", BOT), ("\x1b[2J", b"")), "letters, digits"),
    "twice": (packed(("bot.py", BOT), ("bot.py", BOT)), "twice"),
    "twice by case": (packed(("bot.py", BOT), ("Bot.py", BOT)), "take for one file"),
    "file and folder": (packed(("bot.py", BOT), ("a", b""), ("a/b", b"")), "as a file and as a folder"),
    "file and folder by case": (packed(("bot.py", BOT), ("A", b""), ("a/b", b"")), "as a file and as a folder"),
    "too deep": (packed(("bot.py", BOT), ("/".join("abcdefghi"), b"")), "too long"),
    "a long path": (packed(("bot.py", BOT), ("/".join(["a" * 90] * 3), b"")), "too long"),
    "a long name": (packed(("bot.py", BOT), ("a" * 150, b"")), "letters, digits"),
    "too many": (packed(*((f"{n}.py", b"") for n in range(MOST_FILES + 1))), "it takes 1 to 200"),
    "far too many": (packed(*((f"{n}.py", b"") for n in range(9_000))), "names too many files"),
    "none": (packed(), "it takes 1 to 200"),
    "cut short": (packed(("bot.py", BOT))[:-1], "cut short"),
    "too long": (packed(("bot.py", BOT)) + b"x", "longer than it says"),
    "a negative size": (packed(sizes=[["bot.py", -1]]), "header cannot be read"),
    "a size that is true": (packed(("bot.py", b"x"), sizes=[["bot.py", True]]), "header cannot be read"),
    "an endless size": (packed(sizes=[["bot.py", 1 << 62]]), "cut short"),
    "sizes in sizes": (packed(sizes=[[[[[]]]]]), "header cannot be read"),
    "another format": (b"arena submission 2\nanything", "of another format"),
    "no submission": (b"PK\x03\x04", "the submission is none"),
    "nothing": (b"", "the submission is none"),
    "too large": (bytes(MOST + 1), "and 1,048,576 are taken"),
    "another kind": (packed(("bot.py", BOT), kind="virus"), "of a kind"),
    "no main": (packed(("other.py", BOT)), "'bot.py'"),
    "a main of another kind": (packed(("bot.txt", BOT), main="bot.txt"), "'bot.txt'"),
    "an empty command": (packed(("a", b""), kind="program", main=" "), "is empty"),
    "half a command": (packed(("a", b""), kind="program", main="sh 'a"), "cannot be read"),
    "a command of two lines": (packed(("a", b""), kind="program", main="a\nb"), "one line"),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_submission_is_refused_in_a_sentence(what: str) -> None:
    data, says = HOSTILE[what]

    with pytest.raises(InputError) as refused:
        unpack(data, MOST)

    assert says in str(refused.value)
    assert str(refused.value).isprintable()


def test_a_file_becomes_a_folder_with_that_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_bytes(BOT)
    (tmp_path / "there").mkdir()

    found = unpack(read_source(tmp_path / "mine.py", MOST).pack(), MOST)
    found.write(tmp_path / "there")

    assert (found.kind, found.main) == ("bot", "mine.py")
    assert sorted(path.name for path in (tmp_path / "there").iterdir()) == [MARK, "mine.py"]
    assert (tmp_path / "there" / "mine.py").read_bytes() == BOT


def test_a_folder_is_submitted_without_what_is_hidden_or_a_cache(tmp_path: Path) -> None:
    lay(tmp_path, {"bot.py": BOT, "maps/a.txt": b"a", ".git/config": b"", "__pycache__/bot.pyc": b"", "maps/.x": b""})

    found = read_source(tmp_path, MOST)

    assert found == Submission(kind="bot", main="bot.py", files={"bot.py": BOT, "maps/a.txt": b"a"})


def test_a_program_starts_in_its_folder_with_the_words_of_its_author(tmp_path: Path) -> None:
    source = lay(tmp_path / "from", {"program": b"cat 'a b.txt' $HOME\n", "a_b.txt": b"a"})
    (tmp_path / "there").mkdir()

    found = read_source(source, MOST)
    found.write(tmp_path / "there")

    assert (found.kind, found.main) == ("program", "cat 'a b.txt' $HOME")
    assert (tmp_path / "there" / ".start.sh").read_text() == "cd \"$1\" && exec cat 'a b.txt' '$HOME'\n"
    assert stat.S_IMODE((tmp_path / "there" / "a_b.txt").stat().st_mode) == 0o755


def a_link(folder: Path) -> None:
    (folder / "link.py").symlink_to("/etc/passwd")


def a_pipe(folder: Path) -> None:
    os.mkfifo(folder / "pipe")


def a_strange_name(folder: Path) -> None:
    (folder / "my bot.txt").touch()


def too_much(folder: Path) -> None:
    (folder / "large").write_bytes(bytes(MOST))


def too_many(folder: Path) -> None:
    for number in range(MOST_FILES):
        (folder / str(number)).touch()


def too_deep(folder: Path) -> None:
    (folder / "a/a/a/a/a/a/a/a/a").mkdir(parents=True)


def no_bot(folder: Path) -> None:
    (folder / "bot.py").rename(folder / "other.txt")


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (a_link, "is a link"), (a_pipe, "it is a pipe"), (a_strange_name, "names are letters"),
        (too_much, "1,048,576 bytes in all"), (too_many, "more than 200 files"),
        (too_deep, "more than 8 folders"), (no_bot, "holds no fighter"),
    ],
)  # fmt: skip
def test_a_folder_that_cannot_be_submitted_is_refused_in_a_sentence(
    spoil: Callable[[Path], None], says: str, tmp_path: Path
) -> None:
    spoil(lay(tmp_path, {"bot.py": BOT}))

    with pytest.raises(InputError, match=says):
        read_source(tmp_path, MOST)


def test_a_zip_of_a_folder_gives_the_bytes_of_the_folder(tmp_path: Path) -> None:
    files = {"bot.py": BOT, "maps/a.txt": b"a"}
    with ZipFile(tmp_path / "bot.zip", "w", ZIP_DEFLATED) as archive:
        for path, data in files.items():
            archive.writestr(f"mybot/{path}", data)
        archive.writestr("__MACOSX/mybot/._bot.py", b"")

    assert read_source(tmp_path / "bot.zip", MOST).pack() == read_source(lay(tmp_path / "mybot", files), MOST).pack()


def linked(archive: ZipFile) -> None:
    link = ZipInfo("passwd")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    archive.writestr(link, "/etc/passwd")


def locked(archive: ZipFile) -> None:
    archive.writestr("a.txt", b"a")
    archive.getinfo("a.txt").flag_bits |= 1


def crowded(archive: ZipFile) -> None:
    for number in range(MOST_FILES):
        archive.writestr(str(number), b"")


ZIPS: dict[str, tuple[Callable[[ZipFile], None], str]] = {
    "upwards": (lambda archive: archive.writestr("../bot.py", BOT), "leads out of its folder"),
    "to the root": (lambda archive: archive.writestr("/bot.py", BOT), "leads out of its folder"),
    "by backslash": (lambda archive: archive.writestr("a\\..\\b", BOT), "leads out of its folder"),
    "a link": (linked, "a link or a device"),
    "a bomb": (lambda archive: archive.writestr("zeros", bytes(50 * MOST)), "unpacks to more than 1,048,576 bytes"),
    "twice": (lambda archive: archive.writestr("bot.py", BOT), "twice"),
    "locked": (locked, "locked by a password"),
    "too many": (crowded, "more than 200 files"),
}


@pytest.mark.parametrize("what", ZIPS)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_hostile_zip_is_refused_in_a_sentence(what: str, tmp_path: Path) -> None:
    spoil, says = ZIPS[what]
    with ZipFile(tmp_path / "bot.zip", "w", ZIP_DEFLATED) as archive:
        archive.writestr("bot.py", BOT)
        spoil(archive)

    with pytest.raises(InputError, match=says):
        read_source(tmp_path / "bot.zip", MOST)


@given(cut=st.integers(0, 150), junk=st.binary(max_size=30))
def test_a_spoilt_zip_gives_a_sentence(cut: int, junk: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    file = tmp_path_factory.mktemp("zip") / "bot.zip"
    with ZipFile(file, "w", ZIP_DEFLATED) as archive:
        archive.writestr("bot.py", BOT)
    file.write_bytes(file.read_bytes()[:cut] + junk)

    with pytest.raises(InputError):
        read_source(file, MOST)
