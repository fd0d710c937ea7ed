"""The transcript of a seat: what it was shown in one match and what it answered, kept by its client on its own disk.

It is the client's own help, without any truth: a disk that fails ends the transcript and not the match.

    magic                                               19 bytes
    "H"  length (uint32)  header (msgpack)              pit, match, seat, rules
    "T"  charged (uint32)  observation  orders          one a tick: what the pit's clock charged for the tick before, in us;
         length (uint32)  annotations                   as `protocol.observation_codec` packs it; a byte per own unit; what the
                                                        fighter noted, as `arena.annotations` packs it
    "E"  length (uint32)  ending (msgpack)  SHA-256     once the match is over: of all bytes before the hash

Integers are little-endian; 0xFFFFFFFF where it is not known what was charged. Versions 1 and 2 of the format, which are still
read, have no annotations, and version 1 has no charges.
"""

import logging
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from itertools import count
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import Any, NamedTuple
from urllib.parse import quote

import msgpack

from arena.annotations import read_annotations
from arena.errors import InputError, JournalError, UnreadableError
from arena.files import read_file
from arena.game.observation import Observation
from arena.game.ruleset import Ruleset, rules_values
from arena.game.types import RULES_VERSION, Team
from arena.policy import MatchResult
from arena.protocol.messages import MOST_US, UNKNOWN_US
from arena.protocol.observation_codec import ObservationReader, without_clock
from arena.records.framing import (
    CutShortError,
    FrameReader,
    link,
    load,
    pack_ending,
    pack_frame,
    read_ending,
    read_header,
)

logger = logging.getLogger(__name__)

_STEM = b"ARENA-TRANSCRIPT-"
_MAGICS = tuple(_STEM + version + b"\n" for version in (b"1", b"2", b"3"))
MAGIC = _MAGICS[-1]
_UINT32 = Struct("<I")
_NO_CHARGE = 0xFFFFFFFF
HEAD_BYTES = 32
_KIND = "transcript"
_BUFFER_BYTES = 1 << 12
"""About eight ticks: what a killed client loses of its transcript."""
_TEXTS = ("match", "pit", "name", "opponent")
_HASHES = ("pit_key", "entry_key", "commitment")


class Head:
    """The hash chain over all that a seat was shown in a match, which the client signs and the referee computes for itself."""

    def __init__(self) -> None:
        self.digest = bytes(HEAD_BYTES)

    def add(self, observation: bytes) -> None:
        """Take the observation of the next tick; its clock does not count."""
        self.digest = link(self.digest, without_clock(observation))


@dataclass(frozen=True, slots=True, kw_only=True)
class TranscriptHeader:
    """Which seat of which match a transcript is of."""

    match: str
    pit: str
    pit_key: bytes
    """Public; 32 bytes, as every key and hash here."""
    entry_key: bytes
    name: str
    """Of the entry."""
    opponent: str
    team: Team
    ruleset: Ruleset
    commitment: bytes
    """To the match's key, as the pit gave it before the first tick."""

    def pack(self) -> bytes:
        """Return the header's bytes."""
        named = {name: getattr(self, name) for name in _TEXTS + _HASHES}
        rules = rules_values(self.ruleset)
        return bytes(msgpack.packb({"rules_version": RULES_VERSION, **named, "team": self.team.name.lower(), "ruleset": rules}))

    @classmethod
    def unpack(cls, data: bytes) -> "TranscriptHeader":
        """Read what `pack` wrote; `JournalError` if it is no header, or one of another version of the rules."""
        return read_header(data, _KIND, cls._make)

    @classmethod
    def _make(cls, values: dict[str, Any], ruleset: Ruleset) -> "TranscriptHeader":
        if not all(isinstance(values[name], str) for name in _TEXTS):
            raise JournalError("the transcript's header was changed: a name is not text")
        if any(not isinstance(values[name], bytes) or len(values[name]) != HEAD_BYTES for name in _HASHES):
            raise JournalError("the transcript's header was changed: a key is not 32 bytes")
        given = {name: values[name] for name in _TEXTS + _HASHES}
        return cls(team=Team[values["team"].upper()], ruleset=ruleset, **given)


class TranscriptWriter:
    """Writes a transcript, readable by its owner alone.

    No file is written over: where `path` is there already, as after a client that was killed, the name gets a number.

    Raises
    ------
    InputError
        The file cannot be opened. What fails later is logged once, and nothing more is written.
    """

    def __init__(self, path: Path, header: TranscriptHeader) -> None:
        self._hash = sha256()
        try:
            self.path, descriptor = _create(path)
        except OSError as error:
            raise InputError(f"cannot write the transcript {path}: {error.strerror}") from error
        self._file = os.fdopen(descriptor, "wb", _BUFFER_BYTES)
        self._write(MAGIC + pack_frame(b"H", header.pack()))
        try:
            self._file.flush()  # what is known of a client that is killed early: where it sat
        except OSError as error:
            self._give_up(error)

    def __enter__(self) -> "TranscriptWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def add(self, observation: bytes, orders: bytes, charged_us: int = UNKNOWN_US, annotations: bytes = b"") -> None:
        """Keep one tick.

        Parameters
        ----------
        observation
            One that could be read.
        orders
            A byte per own unit.
        charged_us
            What the tick before was charged.
        annotations
            What the fighter noted, packed.
        """
        charge = charged_us if 0 <= charged_us <= MOST_US else _NO_CHARGE
        self._write(b"T" + _UINT32.pack(charge) + observation + orders + _UINT32.pack(len(annotations)) + annotations)

    def end(self, result: MatchResult) -> None:
        """Keep how the match ended, and close the file; `result.score` is the seat's own."""
        self._write(pack_frame(b"E", pack_ending(result)))
        self._write(self._hash.digest())
        self.close()

    def close(self) -> None:
        """Close the file; without an ending it can be read all the same."""
        try:
            self._file.close()
        except OSError as error:
            self._give_up(error)

    def _write(self, data: bytes) -> None:
        if self._file.closed:
            return
        try:
            self._file.write(data)
            self._hash.update(data)
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        logger.warning("the transcript %s ends here: %s", self.path, error.strerror)
        with suppress(OSError):
            self._file.close()


@dataclass(frozen=True, kw_only=True)
class Transcript:
    """A transcript as read from its bytes: every observation is one, of its own tick."""

    header: TranscriptHeader
    ticks: list[tuple[bytes, bytes]]
    """The observation and the orders of each tick, from 0."""
    charges_us: list[int | None]
    """What the pit's clock charged for each tick, in microseconds; None where it is not known, as of the last."""
    annotations: list[dict[str, Any]]
    """What the fighter noted on each tick, as `arena.annotations` shows it."""
    ending: MatchResult | None
    """`score` is the seat's own; None if the match went on."""
    is_whole: bool
    """False if its last record was cut short."""

    @cached_property
    def head(self) -> bytes:
        """The digest of its `Head`."""
        head = Head()
        for observation, _ in self.ticks:
            head.add(observation)
        return head.digest

    def observations(self) -> Iterator[Observation]:
        """Yield what the seat was shown, as a bot gets it."""
        reader = ObservationReader(self.header.ruleset, self.header.team)
        for observation, _ in self.ticks:
            yield reader.read(observation).seat(0, self.header.ruleset)


def read_transcript(data: bytes) -> Transcript:
    """Read a transcript's bytes; one whose last record was cut short is read up to there.

    Raises
    ------
    JournalError
        It is truncated within its header, was changed, or is not a transcript; the sentence says where.
    """
    source = FrameReader(data, _KIND)
    version = next((number for number, magic in enumerate(_MAGICS, start=1) if data.startswith(magic)), len(_MAGICS))
    header = TranscriptHeader.unpack(source.take_start(_MAGICS[version - 1]))
    reader = ObservationReader(header.ruleset, header.team)
    ticks: list[_Tick] = []
    is_cut = False
    while source.peek() == b"T" and not is_cut:
        try:
            ticks.append(_read_tick(source, version, header, reader, len(ticks)))
        except CutShortError:
            is_cut = True
    letter, ending = b"T" if is_cut else source.peek(), None
    if letter not in (b"", b"T", b"E"):
        raise JournalError(f"the transcript was changed: behind {len(ticks)} ticks stands a record that begins with {letter!r}")
    if letter == b"E":
        ending = _read_ending(source, data)
    return Transcript(
        header=header,
        ticks=[(tick.observation, tick.orders) for tick in ticks],
        charges_us=[*(tick.charged_before_us for tick in ticks[1:]), *([None] if ticks else [])],
        annotations=[tick.annotations for tick in ticks],
        ending=ending,
        is_whole=not letter or ending is not None,
    )


class _Tick(NamedTuple):
    observation: bytes
    orders: bytes
    charged_before_us: int | None
    """For the tick before."""
    annotations: dict[str, Any]


def _read_tick(source: FrameReader, version: int, header: TranscriptHeader, reader: ObservationReader, expected: int) -> _Tick:
    where = f"tick {expected}"
    source.take(1, where)
    (charged_us,) = _UINT32.unpack(source.take(_UINT32.size, where)) if version > 1 else (_NO_CHARGE,)
    observation = source.take(reader.n_bytes, where)
    orders = source.take(len(header.ruleset.team(header.team)), where)
    packed = source.take_frame(where) if version > 2 else b""
    try:
        number = int(reader.read(observation).tick[0])
        annotations = read_annotations(packed, header.ruleset.side)
    except UnreadableError as error:
        raise JournalError(f"the transcript was changed: at {where} {error}") from error
    if number != expected:
        raise JournalError(f"the transcript was changed: at {where} stands the observation of tick {number}")
    return _Tick(observation, orders, None if charged_us == _NO_CHARGE else charged_us, annotations)


def _read_ending(source: FrameReader, data: bytes) -> MatchResult | None:
    """Return the ending; None if it was cut short."""
    where = "its ending"
    try:
        source.take(1, where)
        packed = source.take_frame(where)
        hashed = data[: len(data) - source.left]
        digest = source.take(HEAD_BYTES, where)
    except CutShortError:
        return None
    if source.left:
        raise JournalError("the transcript was changed: bytes follow its ending")
    if sha256(hashed).digest() != digest:
        raise JournalError("the transcript was changed: its bytes are not those that its last hash is of")
    return read_ending(packed, _KIND)


def begins_transcript(data: bytes) -> bool:
    """Whether bytes begin as a transcript's do, of whatever version."""
    return data.startswith(_STEM)


def is_transcript(path: Path) -> bool:
    """Whether a file begins as a transcript does; not so one that cannot be read."""
    try:
        return begins_transcript(read_file(path))
    except OSError:
        return False


def load_transcript(path: Path) -> Transcript:
    """Read a transcript's file; `JournalError` names it."""
    return load(path, read_transcript)


def transcript_name(pit: str, match: str, team: Team) -> str:
    """Return the file name of a seat's transcript; no two seats share one."""
    return "+".join(quote(part, safe="") for part in (pit, match, team.name.lower())) + ".transcript"


def _create(path: Path) -> tuple[Path, int]:
    """Create a file that was not there, and return its path and descriptor: `path`, or the first free one with a number."""
    for number in count(1):
        free = path if number == 1 else path.with_name(f"{path.stem}+{number}{path.suffix}")
        with suppress(FileExistsError):
            return free, os.open(free, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    raise AssertionError("there is always one more number")
