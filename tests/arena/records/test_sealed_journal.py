"""Journals of pits on the network: who played, and who signed, stands between what is canonical and behind it."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import accumulate, permutations

import pytest

from arena.errors import JournalError
from arena.game.types import Team
from arena.protocol.identity import Identity
from arena.protocol.messages import Commitment, Receipt
from arena.protocol.signed import commit, sign_journal, sign_receipt, sign_statement
from arena.records.journal import (
    CHAIN_BYTES,
    MAGIC,
    Journal,
    Seals,
    read_journal,
    whole_part,
    write_ending,
    write_receipt,
    write_seats,
    write_signature,
)
from arena.records.replay import BrokenChainError
from arena.records.transcript import Head
from arena.records.verification import Standing, check_seals, watch

PIT = Identity.make()
ENTRIES = {team: Identity.make() for team in Team}
PUBLIC = {team: identity.public for team, identity in ENTRIES.items()}


@dataclass(frozen=True)
class Sealed:
    """A journal, record by record."""

    start: bytes
    seats: bytes
    ticks: list[bytes]
    ending: bytes
    receipts: dict[Team, bytes]
    signature: bytes
    seals: Seals

    @property
    def records(self) -> list[bytes]:
        return [self.start, self.seats, *self.ticks, self.ending, *self.receipts.values(), self.signature]

    @property
    def canonical(self) -> bytes:
        return self.start + b"".join(self.ticks) + self.ending

    @property
    def data(self) -> bytes:
        return b"".join(self.records)


@pytest.fixture(scope="module")
def sealed(small_journal: bytes) -> Sealed:
    """Return a match's journal with all that a pit writes into it."""
    plain = read_journal(small_journal)
    assert plain.ending is not None
    assert plain.ending_chain is not None
    match = plain.name
    commitment = sign_statement(PIT, Commitment(match=match, digest=commit(match, plain.header.keys))).signature
    signature = sign_journal(PIT, plain.ending_chain)
    receipts = {team: receipt_of(match, team, watch(plain)[team][:-1]) for team in Team}
    begin = len(MAGIC) + 5 + len(plain.header.pack()) + CHAIN_BYTES
    ending = write_ending(plain.ticks[-1].chain, plain.ending)
    length = (len(small_journal) - begin - len(ending)) // len(plain.ticks)
    return Sealed(
        start=small_journal[:begin],
        seats=write_seats(PIT.public, PUBLIC, commitment),
        ticks=[small_journal[at : at + length] for at in range(begin, len(small_journal) - len(ending), length)],
        ending=ending,
        receipts={team: write_receipt(team, receipt) for team, receipt in receipts.items()},
        signature=write_signature(signature),
        seals=Seals(pit_key=PIT.public, entries=PUBLIC, nonce=b"", commitment=commitment, receipts=receipts, signature=signature),
    )


def receipt_of(match: str, team: Team, shown: list[bytes]) -> Receipt:
    head = Head()
    for observation in shown:
        head.add(observation)
    return sign_receipt(ENTRIES[team], match, team, len(shown), head.digest)


def is_sealed(journal: Journal) -> bool:
    """Whether everybody's word is there, and holds."""
    checked = check_seals(journal)
    return checked is not None and {checked.commitment, checked.signature, *checked.receipts.values()} == {Standing.HOLDS}


def test_what_was_sealed_is_read_back(sealed: Sealed, small_journal: bytes) -> None:
    journal = read_journal(sealed.data)

    assert journal.seals == sealed.seals
    assert is_sealed(journal)
    assert read_journal(small_journal).seals is None
    assert check_seals(read_journal(small_journal)) is None


def test_the_canonical_journal_is_that_of_the_same_match_without_a_network(sealed: Sealed, small_journal: bytes) -> None:
    journal, plain = read_journal(sealed.data), read_journal(small_journal)

    assert sealed.canonical == journal.canonical == small_journal
    assert journal.canonical_hash == plain.canonical_hash
    assert (journal.header, journal.start_chain, journal.ticks) == (plain.header, plain.start_chain, plain.ticks)
    assert (journal.ending, journal.ending_chain) == (plain.ending, plain.ending_chain)


@pytest.mark.parametrize("teams", [(), (Team.BLUE,), (Team.RED,), (Team.RED, Team.BLUE)])
@pytest.mark.parametrize("has_signature", [True, False])
def test_any_seal_but_the_seats_may_be_missing_and_receipts_come_in_any_order(
    sealed: Sealed, small_journal: bytes, teams: tuple[Team, ...], has_signature: bool
) -> None:
    receipts = b"".join(sealed.receipts[team] for team in teams)
    data = sealed.start + sealed.seats + b"".join(sealed.ticks) + sealed.ending + receipts
    data += sealed.signature if has_signature else b""

    seals = read_journal(data).seals

    assert seals is not None
    assert seals.receipts == {team: sealed.seals.receipts[team] for team in teams}
    assert seals.signature == (sealed.seals.signature if has_signature else b"")
    assert read_journal(data).canonical == small_journal


def test_a_cut_anywhere_loses_the_record_that_it_cuts_and_no_other(sealed: Sealed) -> None:
    """A pit that is killed while it writes goes on from the last whole record; an ending that is whole stays."""
    data, ends = sealed.data, list(accumulate(map(len, sealed.records)))
    last_tick = 2 + len(sealed.ticks)
    for length in range(len(data) + 1):
        cut = data[:length]
        n_whole = sum(end <= length for end in ends)
        if n_whole == 0:
            for read in (read_journal, whole_part):
                with pytest.raises(JournalError, match=f"it ends at byte {length}, within its "):
                    read(cut)
            continue
        if length not in ends:
            with pytest.raises(JournalError, match=f"it ends at byte {length}, within "):
                read_journal(cut)
        whole = whole_part(cut)
        assert whole == data[: ends[n_whole - 1]]
        journal = read_journal(whole)
        assert len(journal.ticks) == min(max(n_whole - 2, 0), len(sealed.ticks))
        assert (journal.seals is not None) == (n_whole >= 2)
        assert (journal.ending is not None) == (n_whole > last_tick)
        if journal.seals is not None:
            assert len(journal.seals.receipts) == min(max(n_whole - last_tick - 1, 0), len(Team))
            assert (journal.seals.signature != b"") == (n_whole == len(ends))


def test_records_where_none_belong_are_refused(sealed: Sealed) -> None:
    """Each record is tried again at every place at which it would be a second one, or too early."""
    start, seats, ending, signature = sealed.start, sealed.seats, sealed.ending, sealed.signature
    ticks, (blue, red) = b"".join(sealed.ticks), sealed.receipts.values()
    nobody = b"R\x02" + blue[2:]
    refused = [
        start + seats + ticks + ending + blue + blue,
        start + seats + ticks + ending + blue + red + blue + signature,
        start + seats + ticks + ending + nobody,
        start + seats + ticks + ending + blue + signature + red,
        start + seats + ticks + ending + signature + signature,
        start + seats + ticks + blue + ending,
        start + seats + ticks + signature + ending,
        start + seats + seats + ticks + ending,
        start + sealed.ticks[0] + seats + b"".join(sealed.ticks[1:]) + ending,
        start + ticks + ending + seats,
        start + ticks + ending + blue,
        start + ticks + ending + signature,
        start + seats + ticks + ending + ending,
        start + seats + ticks + ending + ticks,
        sealed.data + b"\0",
    ]

    for data in refused:
        with pytest.raises(JournalError, match="the journal was changed"):
            read_journal(data)


def test_the_records_stand_in_one_order_but_for_the_receipts(sealed: Sealed) -> None:
    ticks = b"".join(sealed.ticks)
    whole = (sealed.seats, ticks, sealed.ending, *sealed.receipts.values(), sealed.signature)
    found = []
    for order in permutations(whole):
        try:
            found.append(read_journal(sealed.start + b"".join(order)))
        except JournalError:
            continue

    assert len(found) == 2
    assert all(is_sealed(journal) for journal in found)


def test_every_byte_counts(sealed: Sealed, size: Callable[[int, int], int]) -> None:
    """Each byte in turn becomes another: by its lowest bit, and in the seals, or in full size, by others as well."""
    data = sealed.data
    first, last = len(sealed.start), len(data) - len(b"".join(sealed.receipts.values())) - len(sealed.signature)
    seals = {*range(first, first + len(sealed.seats)), *range(last, len(data))}
    missed = []
    for position, before in enumerate(data):
        flips = (1, 0x80, 0xFF) if position in seals else range(1, 256, size(255, 1))
        for flip in flips:
            changed = bytearray(data)
            changed[position] = before ^ flip
            with suppress(JournalError, BrokenChainError):
                if is_sealed(read_journal(bytes(changed))):
                    missed.append((position, flip))

    assert missed == []
