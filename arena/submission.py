"""A fighter as it is sent to a season: what its author has, a file, a folder or a zip, as one value of bytes, and as a folder.

    "arena submission 1" and a line break   length of the header (4 bytes)   header   what is in each file, one behind the other

The header is msgpack: the kind, what is run, and the path and the size of each file, sorted. The same files give the same bytes,
so their hash names them. Whoever reads them trusts nothing: a path stays within its folder, and no size is believed unread.
"""

import re
import shlex
import stat
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from errno import EFBIG
from hashlib import sha256
from io import BytesIO
from lzma import LZMAError
from pathlib import Path
from zipfile import BadZipFile, ZipFile, ZipInfo

import msgpack

from arena.errors import InputError
from arena.files import MOST_BYTES, read_file

BOT, CHECKPOINT, PROGRAM = "bot", "checkpoint", "program"
BOT_FILE = "bot.py"
PROGRAM_FILE = "program"
"""Holds the command line of a folder's program; its paths begin at the folder."""
MARK = ".submission"
"""A file in each folder that a submission was written to, and in no submission."""
START = ".start.sh"
"""Beside it, the script that starts a program: its one argument is the folder."""
MOST_FILES = 200
MOST_DEPTH = 8
"""Folders within each other, and the file in them."""
PIECE_BYTES = 48_000
"""Of a submission that is uploaded, in one message."""
_MOST_PATH_LETTERS, _MOST_COMMAND_LETTERS = 200, 1_000
_MAGIC = b"arena submission 1\n"
_ANY_FORMAT = b"arena submission "
_LENGTH_BYTES = 4
_MOST_HEADER_BYTES = 1 << 16
_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.+-]{0,99}")
_KINDS = {".py": BOT, ".safetensors": CHECKPOINT}
"""By how the only file of a fighter ends."""
_CACHE = "__pycache__"
_MOST_ZIPPED = 5_000
_UNREADABLE_ZIP = (
    BadZipFile, zlib.error, LZMAError, EOFError, OSError, NotImplementedError, RuntimeError, ValueError, struct.error
)  # fmt: skip
"""What `zipfile` raises where a zip is cut short, changed, locked, or packed in a way that it does not know."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Submission:
    """A fighter and all that it needs; valid once built, `InputError` says what is wrong."""

    kind: str
    """`BOT`, `CHECKPOINT` or `PROGRAM`."""
    main: str
    """The name of the file that is loaded; the command line of a program."""
    files: Mapping[str, bytes]
    """By path, with / between its parts."""

    def __post_init__(self) -> None:
        _check_paths(self.files)
        if self.kind == PROGRAM:
            _read_command(self.main)
        elif self.kind not in _KINDS.values():
            raise InputError("a submission is of a kind that this arena does not know; submit it with an arena of its version")
        elif self.main not in self.files or "/" in self.main or _KINDS.get(Path(self.main).suffix) != self.kind:
            raise InputError(f"a submission lacks the file that it is to be loaded from, {self.main!r}")

    @property
    def n_bytes(self) -> int:
        """Of all files."""
        return sum(map(len, self.files.values()))

    def pack(self) -> bytes:
        """Return it as bytes, the same for the same files."""
        ordered = sorted(self.files.items())
        header: bytes = msgpack.packb([self.kind, self.main, [[path, len(data)] for path, data in ordered]])
        return b"".join((_MAGIC, len(header).to_bytes(_LENGTH_BYTES, "big"), header, *(data for _, data in ordered)))

    def write(self, folder: Path) -> None:
        """Write it into a folder that is new, and empty; `OSError` if it cannot be written."""
        for path, data in self.files.items():
            place = folder / path
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(data)
            place.chmod(0o755 if self.kind == PROGRAM else 0o644)
        if self.kind == PROGRAM:
            (folder / START).write_text(f'cd "$1" && exec {shlex.join(_read_command(self.main))}\n')
        (folder / MARK).write_text(f"{self.kind}\n{self.main}\n")


def digest_of(packed: bytes) -> str:
    """Return the name of a packed submission: SHA-256, in hexadecimal."""
    return sha256(packed).hexdigest()


def read_source(source: Path, most_bytes: int) -> Submission:
    """Return what an author submits: a bot file, a checkpoint, a folder, or a zip of one.

    Hidden files and Python's caches stay behind.

    Raises
    ------
    InputError
        It cannot be read, is too large, or holds no fighter.
    """
    if source.is_dir():
        return _submission_of(str(source), dict(_read_folder(source, most_bytes)))
    try:
        data = read_file(source, most_bytes)
    except OSError as error:
        raise InputError(f"cannot submit {source}: {error.strerror}") from error
    if source.suffix.lower() == ".zip":
        return _submission_of(str(source), _read_zip(str(source), data, most_bytes))
    if source.suffix not in _KINDS:
        raise InputError(
            f"{source} is no fighter; name a .py file, a .safetensors checkpoint, or a folder or .zip with {BOT_FILE} or with "
            f"a file {PROGRAM_FILE}, which holds a command line"
        )
    return Submission(kind=_KINDS[source.suffix], main=source.name, files={source.name: data})


def unpack(data: bytes, most_bytes: int = MOST_BYTES) -> Submission:
    """Return what `Submission.pack` packed, whoever sent it.

    Raises
    ------
    InputError
        It is too large, no submission, one of another format, or names a file that no folder may get.
    """
    if len(data) > most_bytes:
        raise InputError(f"the submission has {len(data):,} bytes, and {most_bytes:,} are taken")
    if not data.startswith(_MAGIC):
        what = "of another format than this arena reads" if data.startswith(_ANY_FORMAT) else "none"
        raise InputError(f"the submission is {what}; send it with `arena submit` of this version")
    begin = len(_MAGIC) + _LENGTH_BYTES
    length = int.from_bytes(data[len(_MAGIC) : begin], "big")
    if length > _MOST_HEADER_BYTES:
        raise InputError(f"the submission names too many files; at most {MOST_FILES} are taken")
    at = begin + length
    kind, main, sizes = _read_header(data[begin:at])
    files = {}
    for path, size in sizes:
        if path in files:
            raise InputError(f"the submission holds {path!r} twice")
        files[path] = data[at : at + size]
        at += size
    if at != len(data):
        raise InputError("the submission is cut short, or longer than it says")
    return Submission(kind=kind, main=main, files=files)


def _read_header(data: bytes) -> tuple[str, str, list[tuple[str, int]]]:
    unreadable = InputError("the submission's header cannot be read; send it with `arena submit` of this version")
    try:
        values = msgpack.unpackb(data, max_array_len=MOST_FILES + 3)
    except (ValueError, msgpack.UnpackException, RecursionError) as error:
        raise unreadable from error
    match values:
        case [str(kind), str(main), list(sizes)] if all(map(_is_size, sizes)):
            return kind, main, [(path, size) for path, size in sizes]
    raise unreadable


def _is_size(value: object) -> bool:
    match value:
        case [str(), int(size)]:
            return size >= 0 and not isinstance(size, bool)
    return False


def _check_paths(paths: Mapping[str, bytes]) -> None:
    if not 1 <= len(paths) <= MOST_FILES:
        raise InputError(f"a submission has {len(paths)} files; it takes 1 to {MOST_FILES}")
    folded: dict[str, str] = {}
    for path in paths:
        parts = path.split("/")
        if len(path) > _MOST_PATH_LETTERS or len(parts) > MOST_DEPTH:
            raise InputError(
                f"a path of a submission begins with {path[:40]!r} and is too long; it takes {_MOST_PATH_LETTERS} letters and "
                f"{MOST_DEPTH} parts"
            )
        for part in parts:
            if not _NAME.fullmatch(part):
                raise InputError(
                    f"a submission holds {path!r}; names are letters, digits, _ - + and ., begin with no dot, and none leads "
                    "out of the folder"
                )
        if folded.setdefault(path.casefold(), path) != path:
            raise InputError(
                f"a submission holds {path!r} and {folded[path.casefold()]!r}, which some machines take for one file"
            )
    for path in folded:
        above = next((str(one) for one in Path(path).parents if str(one) in folded), None)
        if above is not None:
            raise InputError(f"a submission holds {folded[above]!r} as a file and as a folder")


def _read_command(line: str) -> list[str]:
    """Return the words of a program's command line."""
    if len(line) > _MOST_COMMAND_LETTERS or not line.isprintable():
        raise InputError(f"the file {PROGRAM_FILE} must hold one line of at most {_MOST_COMMAND_LETTERS:,} letters, a command")
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise InputError(f"the command line in {PROGRAM_FILE} cannot be read: {error}") from error
    if not words:
        raise InputError(f"the file {PROGRAM_FILE} is empty; write the program's command line there, as in: python3 main.py")
    return words


def _submission_of(name: str, files: Mapping[str, bytes]) -> Submission:
    """Return the fighter of a folder."""
    if PROGRAM_FILE in files:
        try:
            line = files[PROGRAM_FILE].decode("utf-8").strip()
        except UnicodeDecodeError as error:
            raise InputError(f"the file {PROGRAM_FILE} of {name} is no text; write the program's command line there") from error
        return Submission(kind=PROGRAM, main=line, files=files)
    if BOT_FILE in files:
        return Submission(kind=BOT, main=BOT_FILE, files=files)
    if len(files) == 1:
        [only] = files
        if Path(only).suffix in _KINDS:
            return Submission(kind=_KINDS[Path(only).suffix], main=only, files=files)
    raise InputError(
        f"{name} holds no fighter; it takes a {BOT_FILE}, or a file {PROGRAM_FILE} with a command line, as in: python3 main.py"
    )


def _is_left_out(path: str) -> bool:
    """Whether a file stays behind."""
    return any(part.startswith(".") or part == _CACHE for part in path.split("/"))


def _read_folder(folder: Path, most_bytes: int) -> Iterator[tuple[str, bytes]]:
    """Yield the files of a folder by their paths in it; `InputError` before there are too many."""
    n_files, n_left = 0, most_bytes
    waiting = [(folder, "")]
    while waiting:
        place, within = waiting.pop()
        if within.count("/") >= MOST_DEPTH:
            raise InputError(f"{folder} has more than {MOST_DEPTH} folders within each other, as {within}")
        try:
            found = sorted(place.iterdir())
        except OSError as error:
            raise InputError(f"cannot submit {place}: {error.strerror}") from error
        for path in found:
            name = within + path.name
            if _is_left_out(name):
                continue
            if path.is_symlink():
                raise InputError(f"{path} is a link; a submission holds files alone, so copy what it points to")
            if path.is_dir():
                waiting.append((path, f"{name}/"))
                continue
            n_files += 1
            if n_files > MOST_FILES:
                raise InputError(f"{folder} has more than {MOST_FILES} files; name the folder of the bot alone")
            try:
                data = read_file(path, n_left)
            except OSError as error:
                why = f"{folder} has more than {most_bytes:,} bytes in all" if error.errno == EFBIG else error.strerror
                raise InputError(f"cannot submit {path}: {why}") from error
            n_left -= len(data)
            yield name, data


def _read_zip(name: str, data: bytes, most_bytes: int) -> dict[str, bytes]:
    """Return the files of a zip; the one folder in which all of them lie is left out of their paths."""
    files: dict[str, bytes] = {}
    n_left = most_bytes
    try:
        with ZipFile(BytesIO(data)) as archive:
            if len(archive.infolist()) > _MOST_ZIPPED:
                raise InputError(f"{name} has more than {_MOST_ZIPPED:,} files; a submission takes {MOST_FILES}")
            for item in archive.infolist():
                path = item.filename
                _check_zipped(name, item)
                if item.is_dir() or _is_left_out(path) or path.startswith("__MACOSX/"):
                    continue
                if path in files or len(files) == MOST_FILES:
                    what = f"{path!r} twice" if path in files else f"more than {MOST_FILES} files"
                    raise InputError(f"{name} holds {what}; pack the folder of the bot alone")
                with archive.open(item) as file:
                    files[path] = file.read(n_left + 1)
                n_left -= len(files[path])
                if n_left < 0:
                    raise InputError(f"{name} unpacks to more than {most_bytes:,} bytes; a submission has no more")
    except _UNREADABLE_ZIP as error:
        raise InputError(f"{name} is no zip that can be read: {error}") from error
    tops = {path.partition("/")[0] for path in files}
    if len(tops) == 1 and all("/" in path for path in files):
        files = {path.partition("/")[2]: content for path, content in files.items()}
    return files


def _check_zipped(name: str, item: ZipInfo) -> None:
    path = item.filename
    if path.startswith("/") or ".." in path.split("/") or "\\" in path:
        raise InputError(f"{name} holds {path!r}, which leads out of its folder; pack the folder of the bot anew")
    mode = item.external_attr >> 16
    if stat.S_IFMT(mode) not in (0, stat.S_IFREG, stat.S_IFDIR):
        raise InputError(f"{name} holds {path!r}, which is a link or a device; a submission holds files alone")
    if item.flag_bits & 1:
        raise InputError(f"{name} is locked by a password; pack it without one")
