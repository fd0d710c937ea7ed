"""The journal of a match: its keys and its orders, and a hash of the state after every tick.

A match is its keys and its orders, so a journal can be played again by anyone, and every tick compared. The canonical journal
holds no clock and no signature: the same match gives the same bytes in every venue. A pit on the network writes more between and
behind, which is not canonical: who played, and their word on it.

    magic                                               16 bytes
    "H"  length (uint32)  header (msgpack)  chain       rules, entries, keys; the chain begins with the drawn board
    "K"  pit key  blue's key  red's key  signature      not canonical: of the commitment to the keys, made before the first tick
    "N"  nonce                                          not canonical: 16 bytes that make the match's name on the network unique
    "T"  orders  marks  chain                           one a tick: a byte per unit, a byte per team, 32 bytes
    "E"  length (uint32)  ending (msgpack)  chain       once the match is over
    "R"  team  shown (uint32)  head  signature          not canonical: a seat's receipt
    "S"  signature                                      not canonical: the pit's, of the last link of the chain

Integers are little-endian. Each link of the chain is the SHA-256 of the link before it and of what it stands behind.
"""

import errno
import os
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import msgpack

from arena.errors import JournalError
from arena.files import keep_former
from arena.game.keys import KEY_BYTES, MatchKeys
from arena.game.ruleset import Ruleset, rules_values
from arena.game.types import RULES_VERSION, Team
from arena.policy import MatchResult
from arena.protocol.identity import PUBLIC_BYTES, SIGNATURE_BYTES
from arena.protocol.messages import Receipt
from arena.records.framing import (
    CutShortError,
    FrameReader,
    link,
    pack_ending,
    pack_frame,
    read_ending,
    read_header,
)
from arena.records.plan import network_name

MAGIC = b"ARENA-JOURNAL-1\n"
CHAIN_BYTES = 32
_KIND = "journal"
_MAP_OF_7 = b"\x87"
"""The byte that a map of so many begins with in msgpack; smaller ones begin with one byte, too."""
SUFFIX = ".journal"
_NO_TEXT = "surrogateescape"
"""How bytes stand in an identity that are no text: a stranger's bundle may hold any."""
_SEATS_BYTES = 3 * PUBLIC_BYTES + SIGNATURE_BYTES
NONCE_BYTES = 16
_SEAL_BYTES = {b"K": _SEATS_BYTES, b"N": NONCE_BYTES, b"R": 1 + 4 + CHAIN_BYTES + SIGNATURE_BYTES, b"S": SIGNATURE_BYTES}


_MAP_KEY, _MATCH_KEY = (msgpack.packb({name: bytes(KEY_BYTES)})[1:-KEY_BYTES] for name in ("map_key", "match_key"))


@lru_cache(maxsize=64)
def pack_around(ruleset: Ruleset, blue: str, red: str) -> tuple[bytes, bytes]:
    """Return what stands before and behind the identity in the header of every match of two entries, the keys apart."""
    before = msgpack.packb({"rules_version": RULES_VERSION, "identity": ""})
    behind = msgpack.packb({"blue": blue, "red": red, "ruleset": rules_values(ruleset)})
    return _MAP_OF_7 + before[1:-1], behind[1:]


def pack_header(around: tuple[bytes, bytes], identity: str, keys: MatchKeys) -> bytes:
    """Return a header's bytes, one map; `around` is of `pack_around`."""
    before, behind = around
    return b"".join((before, msgpack.packb(identity), behind, _MAP_KEY, keys.map_key, _MATCH_KEY, keys.match_key))


class Mark(IntFlag):
    """What a team's answer of one tick was, if not an order in time."""

    LATE = 1
    UNREADABLE = 2
    """The policy raised, or answered with anything but one action per unit; its units stayed."""


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
        return pack_header(pack_around(self.ruleset, self.blue, self.red), self.identity, self.keys)

    @classmethod
    def unpack(cls, data: bytes) -> "Header":
        """Read what `pack` wrote; `JournalError` if it is no header, or one of another version of the rules."""
        return read_header(data, _KIND, cls._make)

    @classmethod
    def _make(cls, values: dict[str, Any], ruleset: Ruleset) -> "Header":
        given = {name: values[name] for name in ("map_key", "match_key")}
        if any(not isinstance(key, bytes) or len(key) != KEY_BYTES for key in given.values()):
            raise JournalError("the journal's header was changed: its keys are not 32 bytes each")
        names = {name: values[name] for name in ("identity", "blue", "red")}
        if not all(isinstance(name, str) for name in names.values()):
            raise JournalError("the journal's header was changed: a name is not text")
        return cls(ruleset=ruleset, keys=MatchKeys(**given), **names)


@dataclass(frozen=True, slots=True, kw_only=True)
class TickRecord:
    """What one tick was played from, and the link of the chain after it."""

    orders: bytes
    """One byte per unit, blue's first."""
    marks: tuple[Mark, Mark]
    chain: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Seals:
    """What a pit on the network, and those who played there, put their names to; `arena.records.verification` checks it."""

    pit_key: bytes
    entries: dict[Team, bytes]
    """Public keys."""
    nonce: bytes
    """As in `arena.records.plan.network_name`."""
    commitment: bytes
    """The pit's signature of the match's `Commitment`."""
    receipts: dict[Team, Receipt]
    """None from a seat that gave none."""
    signature: bytes
    """The pit's, of the last link of the chain; empty if it was killed before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Journal:
    """A journal as read from its bytes; whether it is true, `arena.records.replay` finds out."""

    header: Header
    start_chain: bytes
    ticks: tuple[TickRecord, ...]
    ending: MatchResult | None
    """None while the match is not over. `score` is blue's."""
    ending_chain: bytes | None
    seals: Seals | None
    """None if no network was between the players."""
    canonical: bytes
    """Its bytes without what is not canonical."""

    @property
    def name(self) -> str:
        """What the match was called on the network, if there was one."""
        seals = self.seals
        return network_name(self.header.identity, b"" if seals is None else seals.pit_key, b"" if seals is None else seals.nonce)

    def keeps(self, tick: int, team: Team, orders: bytes) -> bool:
        """Whether a seat's orders are those of a tick, or were ruled late or unreadable; a tick that was not played keeps any."""
        if tick >= len(self.ticks) or self.ticks[tick].marks[team] & (Mark.LATE | Mark.UNREADABLE):
            return True
        n_blue = len(self.header.ruleset.team(Team.BLUE))
        own = slice(0, n_blue) if team is Team.BLUE else slice(n_blue, None)
        return self.ticks[tick].orders[own] == orders

    @property
    def canonical_hash(self) -> str:
        """SHA-256 (hex) of the canonical bytes."""
        return sha256(self.canonical).hexdigest()


def write_start(header: Header, ground: bytes, state: bytes) -> tuple[bytes, bytes]:
    """Return the bytes that a journal begins with, and the first link; `ground` and `state` are of the drawn board."""
    return write_packed_start(header.pack(), ground, state)


def write_packed_start(header: bytes, ground: bytes, state: bytes) -> tuple[bytes, bytes]:
    """Return what `write_start` does, from a packed header."""
    chain = link(MAGIC, header, ground, state)
    return MAGIC + pack_frame(b"H", header) + chain, chain


def write_tick(chain: bytes, orders: bytes, marks: bytes, state: bytes) -> tuple[bytes, bytes]:
    """Return the record of one tick, and the next link; `state` is the one after it."""
    record = b"T" + orders + marks
    chain = link(chain, record, state)
    return record + chain, chain


def write_ending(chain: bytes, result: MatchResult) -> bytes:
    """Return the record that closes a journal; `result.score` is blue's."""
    packed = pack_ending(result)
    return pack_frame(b"E", packed) + link(chain, packed)


def write_seats(pit_key: bytes, entries: Mapping[Team, bytes], commitment: bytes, nonce: bytes = b"") -> bytes:
    """Return the records of who plays in a pit, and of the nonce in the match's name."""
    seats = b"K" + pit_key + entries[Team.BLUE] + entries[Team.RED] + commitment
    return seats + b"N" + nonce if nonce else seats


def write_receipt(team: Team, receipt: Receipt) -> bytes:
    """Return the record of a seat's receipt, whose signature was checked."""
    return b"R" + bytes([team]) + receipt.n_shown.to_bytes(4, "little") + receipt.head + receipt.signature


def write_signature(signature: bytes) -> bytes:
    """Return the record of the pit's signature."""
    return b"S" + signature


def read_journal(data: bytes) -> Journal:
    """Read a journal's bytes.

    Raises
    ------
    JournalError
        It is truncated, or is not a journal; the sentence says where.
    """
    reader = FrameReader(data, _KIND)
    header = Header.unpack(reader.take_start(MAGIC))
    start_chain = reader.take(CHAIN_BYTES, "its header")
    begin = len(data) - reader.left
    seats = _read_seats(reader) if reader.peek() == b"K" else None
    first = len(data) - reader.left
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
        ending = read_ending(reader.take_frame("its ending"), _KIND)
        ending_chain = reader.take(CHAIN_BYTES, "its ending")
    end = len(data) - reader.left
    seals = None if seats is None else _read_seals(reader, *seats)
    if reader.peek():
        raise JournalError("the journal was changed: bytes follow its ending")
    return Journal(
        header=header,
        start_chain=start_chain,
        ticks=tuple(ticks),
        ending=ending,
        ending_chain=ending_chain,
        seals=seals,
        canonical=data if seats is None else data[:begin] + data[first:end],
    )


def _read_seats(reader: FrameReader) -> tuple[bytes, dict[Team, bytes], bytes, bytes]:
    where = "the record of its seats"
    reader.take(1, where)
    pit_key, blue, red = (reader.take(PUBLIC_BYTES, where) for _ in range(3))
    commitment, nonce = reader.take(SIGNATURE_BYTES, where), b""
    if reader.peek() == b"N":
        reader.take(1, where)
        nonce = reader.take(NONCE_BYTES, where)
    return pit_key, {Team.BLUE: blue, Team.RED: red}, commitment, nonce


def _read_seals(reader: FrameReader, pit_key: bytes, entries: dict[Team, bytes], commitment: bytes, nonce: bytes) -> Seals:
    receipts: dict[Team, Receipt] = {}
    while reader.peek() == b"R":
        reader.take(1, "a receipt")
        team = reader.take(1, "a receipt")[0]
        if team not in tuple(Team) or team in receipts:
            raise JournalError("the journal was changed: a receipt is of no seat, or comes twice")
        receipts[Team(team)] = Receipt(
            n_shown=int.from_bytes(reader.take(4, "a receipt"), "little"),
            head=reader.take(CHAIN_BYTES, "a receipt"),
            signature=reader.take(SIGNATURE_BYTES, "a receipt"),
        )
    signature = b""
    if reader.peek() == b"S":
        reader.take(1, "its signature")
        signature = reader.take(SIGNATURE_BYTES, "its signature")
    return Seals(pit_key=pit_key, entries=entries, nonce=nonce, commitment=commitment, receipts=receipts, signature=signature)


def whole_part(data: bytes) -> bytes:
    """Return a journal without a last record that was cut short when its writer died."""
    reader = FrameReader(data, _KIND)
    header = Header.unpack(reader.take_start(MAGIC))
    reader.take(CHAIN_BYTES, "its header")
    n_tick_bytes = sum(len(header.ruleset.team(team)) for team in Team) + len(Team) + CHAIN_BYTES
    whole = len(data) - reader.left
    try:
        while tag := reader.peek():
            reader.take(1, "a record")
            if tag == b"E":
                reader.take_frame("its ending")
            reader.take({b"T": n_tick_bytes, b"E": CHAIN_BYTES, **_SEAL_BYTES}.get(tag, 0), "a record")
            whole = len(data) - reader.left
    except CutShortError:
        pass
    return data[:whole]


def journal_name(identity: str) -> str:
    """Return the file name of a match's journal; no two identities share one."""
    return quote(identity, safe="/", errors=_NO_TEXT).replace("/", "+") + SUFFIX


def identity_of(name: str) -> str:
    """Return the identity of the match whose journal has this file name."""
    return unquote(name.removesuffix(SUFFIX).replace("+", "/"), errors=_NO_TEXT)


def save_journal(folder: str, identity: str, data: bytes) -> None:
    """Write a whole journal, readable by its owner alone; whoever looks for it finds it whole, or not at all."""
    path = f"{folder}/{journal_name(identity)}"
    draft = f"{path.removesuffix(SUFFIX)}.draft"
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    try:
        if os.write(descriptor, data) != len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError:
        Path(draft).unlink()
        raise
    finally:
        os.close(descriptor)
    keep_former(Path(path), data)
    Path(draft).rename(path)
