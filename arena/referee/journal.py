"""The journal of a match: its keys and its orders, and a hash of the state after every tick.

A match is its keys and its orders, so a journal can be played again by anyone, and every tick compared. The canonical journal
holds no clock and no signature: the same match gives the same bytes in every venue.

    magic                                               16 bytes
    "H"  length (uint32)  header (msgpack)  chain       rules, entries, keys; the chain begins with the drawn board
    "T"  orders  marks  chain                           one a tick: a byte per unit, a byte per team, 32 bytes
    "E"  length (uint32)  ending (msgpack)  chain       once the match is over

Integers are little-endian. Each link of the chain is the SHA-256 of the link before it and of what it stands behind.
"""

import errno
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntFlag
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

import msgpack

from arena.errors import InputError, JournalError
from arena.game.keys import KEY_BYTES, MatchKeys
from arena.game.ruleset import Ruleset, from_dict, to_dict
from arena.game.types import RULES_VERSION, Ending, Team
from arena.policy import MatchResult

MAGIC = b"ARENA-JOURNAL-1\n"
CHAIN_BYTES = 32
_LENGTH = struct.Struct("<I")
_MAX_FRAME = 1 << 20


class Mark(IntFlag):
    """What a team's answer of one tick was, if not an order in time."""

    LATE = 1
    UNREADABLE = 2
    """The policy raised, or answered with anything but one action per unit; its units stayed."""


@lru_cache(maxsize=64)
def _rules_values(ruleset: Ruleset) -> dict[str, Any]:
    return {"name": ruleset.name, **to_dict(ruleset)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """Everything that a match is played from, its orders apart."""

    identity: str
    blue: str
    """Name of the entry that plays blue."""
    red: str
    ruleset: Ruleset
    keys: MatchKeys

    def pack(self) -> bytes:
        """Return the header's bytes."""
        values = {
            "rules_version": RULES_VERSION,
            "identity": self.identity,
            "blue": self.blue,
            "red": self.red,
            "ruleset": _rules_values(self.ruleset),
            "map_key": self.keys.map_key,
            "match_key": self.keys.match_key,
        }
        return bytes(msgpack.packb(values))

    @classmethod
    def unpack(cls, data: bytes) -> "Header":
        """Read what `pack` wrote.

        Raises
        ------
        JournalError
            The bytes are no header, or one of another version of the rules.
        """
        try:
            values = msgpack.unpackb(data)
            version = values["rules_version"]
            if version != RULES_VERSION:
                raise JournalError(
                    f"the journal was written under version {version} of the rules; this is version {RULES_VERSION}"
                )
            rules = dict(values["ruleset"])
            given = {name: values[name] for name in ("map_key", "match_key")}
            if any(not isinstance(key, bytes) or len(key) != KEY_BYTES for key in given.values()):
                raise JournalError("the journal's header was changed: its keys are not 32 bytes each")
            keys = MatchKeys(**given)
            names = {name: values[name] for name in ("identity", "blue", "red")}
            if not all(isinstance(name, str) for name in names.values()):
                raise JournalError("the journal's header was changed: a name is not text")
            header = cls(ruleset=from_dict(rules.pop("name"), rules), keys=keys, **names)
            if header.pack() != data:  # the same facts in other bytes would give one match two canonical journals
                raise JournalError("the journal's header was changed: its bytes are not as the arena writes them")
            return header
        except JournalError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError, InputError, msgpack.UnpackException) as error:
            raise JournalError(f"the journal's header was changed: {error!r} on reading it") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class TickRecord:
    """What one tick was played from, and the link of the chain after it."""

    orders: bytes
    """One byte per unit, blue's first."""
    marks: tuple[Mark, Mark]
    chain: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Journal:
    """A journal as read from its bytes; whether it is true, `arena.referee.replay` finds out."""

    header: Header
    start_chain: bytes
    ticks: tuple[TickRecord, ...]
    ending: MatchResult | None
    """None while the match is not over. `score` is blue's."""
    ending_chain: bytes | None
    canonical_hash: str
    """SHA-256 (hex) of the canonical bytes."""


def link(chain: bytes, *parts: bytes) -> bytes:
    """Return the next link of the chain."""
    return sha256(chain + b"".join(parts)).digest()


def write_start(header: Header, ground: bytes, state: bytes) -> tuple[bytes, bytes]:
    """Return the bytes that a journal begins with, and the first link; `ground` and `state` are of the drawn board."""
    packed = header.pack()
    chain = link(MAGIC, packed, ground, state)
    return MAGIC + b"H" + _LENGTH.pack(len(packed)) + packed + chain, chain


def write_tick(chain: bytes, orders: bytes, marks: bytes, state: bytes) -> tuple[bytes, bytes]:
    """Return the record of one tick, and the next link; `state` is the one after it."""
    record = b"T" + orders + marks
    chain = link(chain, record, state)
    return record + chain, chain


def write_ending(chain: bytes, result: MatchResult) -> bytes:
    """Return the record that closes a journal; `result.score` is blue's."""
    packed = _pack_ending(result)
    return b"E" + _LENGTH.pack(len(packed)) + packed + link(chain, packed)


def _pack_ending(result: MatchResult) -> bytes:
    winner = None if result.winner is None else result.winner.name.lower()
    values = {
        "ending": result.ending.name.lower(),
        "winner": winner,
        "score": result.score,
        "ticks": result.ticks,
        "reason": result.reason,
    }
    return bytes(msgpack.packb(values))


def read_journal(data: bytes) -> Journal:
    """Read a journal's bytes.

    Raises
    ------
    JournalError
        It is truncated, or is not a journal; the sentence says where.
    """
    reader = _Reader(data)
    if reader.take(len(MAGIC), "its first line") != MAGIC:
        raise JournalError("this is not a journal: its first line is another")
    if reader.take(1, "its header") != b"H":
        raise JournalError("the journal was changed: it does not begin with a header")
    header = Header.unpack(reader.take_frame("its header"))
    start_chain = reader.take(CHAIN_BYTES, "its header")
    n_units = sum(len(header.ruleset.team(team)) for team in Team)
    ticks: list[TickRecord] = []
    while tag := reader.peek():
        where = f"the record of tick {len(ticks) + 1}"
        if tag == b"E":
            break
        if tag != b"T":
            raise JournalError(f"the journal was changed: {where} begins with {tag!r}")
        reader.take(1, where)
        ticks.append(
            TickRecord(
                orders=reader.take(n_units, where),
                marks=(Mark(reader.take(1, where)[0]), Mark(reader.take(1, where)[0])),
                chain=reader.take(CHAIN_BYTES, where),
            )
        )
    ending, ending_chain = None, None
    if reader.peek():
        reader.take(1, "its ending")
        ending = _unpack_ending(reader.take_frame("its ending"))
        ending_chain = reader.take(CHAIN_BYTES, "its ending")
        if reader.peek():
            raise JournalError("the journal was changed: bytes follow its ending")
    return Journal(
        header=header,
        start_chain=start_chain,
        ticks=tuple(ticks),
        ending=ending,
        ending_chain=ending_chain,
        canonical_hash=sha256(data).hexdigest(),
    )


def _unpack_ending(data: bytes) -> MatchResult:
    try:
        values: dict[str, Any] = msgpack.unpackb(data)
        result = MatchResult(
            ending=Ending[values["ending"].upper()],
            winner=None if values["winner"] is None else Team[values["winner"].upper()],
            score=values["score"],
            ticks=values["ticks"],
            reason=values["reason"],
        )
        if _pack_ending(result) != data:
            raise JournalError("the journal's ending was changed: its bytes are not as the arena writes them")
        return result
    except (ValueError, KeyError, TypeError, AttributeError, msgpack.UnpackException) as error:
        raise JournalError(f"the journal's ending was changed: {error!r} on reading it") from error


def whole_part(data: bytes) -> bytes:
    """Return a running match's journal without a last record that was cut short when its writer died."""
    reader = _Reader(data)
    reader.take(len(MAGIC) + 1, "its header")
    header = Header.unpack(reader.take_frame("its header"))
    reader.take(CHAIN_BYTES, "its header")
    length = 1 + sum(len(header.ruleset.team(team)) for team in Team) + len(Team) + CHAIN_BYTES
    while reader.peek() == b"T" and reader.left >= length:
        reader.take(length, "a tick")
    return data[: len(data) - reader.left]


class _Reader:
    """Takes bytes from the front, and says where they ran out."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    @property
    def left(self) -> int:
        return len(self._data) - self._at

    def peek(self) -> bytes:
        return self._data[self._at : self._at + 1]

    def take(self, n_bytes: int, where: str) -> bytes:
        piece = self._data[self._at : self._at + n_bytes]
        if len(piece) < n_bytes:
            raise JournalError(f"the journal is truncated: it ends at byte {len(self._data)}, within {where}")
        self._at += n_bytes
        return piece

    def take_frame(self, where: str) -> bytes:
        (length,) = _LENGTH.unpack(self.take(_LENGTH.size, where))
        if length > _MAX_FRAME:
            raise JournalError(f"the journal was changed: {where} claims {length} bytes")
        return self.take(length, where)


def journal_name(identity: str) -> str:
    """Return the file name of a match's journal; no two identities share one."""
    return quote(identity, safe="/").replace("/", "+") + ".journal"


def save_journal(folder: str, identity: str, data: bytes) -> None:
    """Write a whole journal, readable by its owner alone. One that was cut short is found so on reading."""
    descriptor = os.open(f"{folder}/{journal_name(identity)}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    try:
        if os.write(descriptor, data) != len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    finally:
        os.close(descriptor)


def load_journal(path: Path) -> Journal:
    """Read a journal's file; `JournalError` names it."""
    try:
        return read_journal(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except JournalError as error:
        raise JournalError(f"{path}: {error}") from error


def find_journals(paths: list[Path]) -> Iterator[Path]:
    """Yield journals: each file as it is, and those in each folder, by name."""
    for path in paths:
        if path.is_dir():
            found = sorted(path.rglob("*.journal"))
            if not found:
                raise InputError(f"{path} holds no journals (files ending in .journal)")
            yield from found
        else:
            yield path
