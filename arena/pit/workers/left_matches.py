"""What another process left of a match: its journal, unfinished, whole, or none."""

from collections import Counter
from pathlib import Path

from arena.errors import JournalError
from arena.files import read_file
from arena.game.types import Team, Termination
from arena.match.seat_record import SeatRecord
from arena.pit.events import UnfinishedFound
from arena.pit.journal_files import JournalFile
from arena.pit.journal_sync import sync_journals
from arena.pit.workers.messages import Gone, Over, Report, Shut, TakeMatch
from arena.policy import MatchResult
from arena.protocol.identity import Identity
from arena.protocol.messages import Ended
from arena.protocol.signed import sign_journal, sign_statement
from arena.records.journal import (
    CHAIN_BYTES,
    Journal,
    Mark,
    journal_name,
    read_journal,
    whole_part,
    write_ending,
    write_signature,
)
from arena.records.replay import BrokenChainError, verify


def find_left(order: TakeMatch, journals: Path, identity: Identity, *, fsync: bool) -> UnfinishedFound | list[Report] | None:
    """Return where a match stands that another process may have begun.

    Returns
    -------
    UnfinishedFound | list[Report] | None
        To be taken up; or what the pit is to be told of one that is over, or can be taken up by nobody; None if it never began.

    Raises
    ------
    ArenaError
        The journal of one that is over cannot be written.
    """
    path = journals / journal_name(order.new.header.identity)
    try:
        whole = whole_part(read_file(path))
        journal = read_journal(whole)
    except FileNotFoundError:
        return [Gone(order.match, order.given_up)] if order.given_up else None
    except JournalError as error:
        return [Gone(order.match, str(error))]
    except OSError as error:
        return [Gone(order.match, error.strerror or str(error))]
    if journal.seals is None or journal.name != order.match:
        return [Gone(order.match, f"{path.name} is another match's")]
    if journal.ending is not None:
        return _finish(order, journal, path, len(whole), identity, fsync=fsync)
    if order.given_up:
        return _give_up(order, journal, path, len(whole), identity, fsync=fsync)
    return UnfinishedFound(path.name, journal, journal.seals.entries, journal.seals.nonce, len(whole))


def _finish(order: TakeMatch, journal: Journal, path: Path, n_bytes: int, identity: Identity, *, fsync: bool) -> list[Report]:
    """Sign a journal that has its ending, unless that was done, and tell what stands there."""
    assert journal.ending is not None
    assert journal.ending_chain is not None
    assert journal.seals is not None
    if not order.given_up:
        try:
            verify(journal)
        except BrokenChainError as error:
            return [Gone(order.match, str(error))]
    signature = b"" if journal.seals.signature else write_signature(sign_journal(identity, journal.ending_chain))
    _write(path, n_bytes, signature, fsync=fsync)
    return _report(order, journal, journal.ending, identity)


def _give_up(order: TakeMatch, journal: Journal, path: Path, n_bytes: int, identity: Identity, *, fsync: bool) -> list[Report]:
    """End a match where it stands, without playing it again."""
    chain = journal.ticks[-1].chain if journal.ticks else journal.start_chain
    result = MatchResult(ending=Termination.VOID, winner=None, score=0, ticks=len(journal.ticks), reason=order.given_up)
    ending = write_ending(chain, result)
    _write(path, n_bytes, ending + write_signature(sign_journal(identity, ending[-CHAIN_BYTES:])), fsync=fsync)
    return _report(order, journal, result, identity)


def _write(path: Path, n_bytes: int, data: bytes, *, fsync: bool) -> None:
    file = JournalFile(path, n_bytes)
    try:
        if data:
            file.append(data)
    finally:
        file.close()
    if data and fsync:
        sync_journals([path])


def _report(order: TakeMatch, journal: Journal, result: MatchResult, identity: Identity) -> list[Report]:
    marks = {team: Counter(mark for record in journal.ticks for mark in record.marks[team]) for team in Team}
    seats = {team: SeatRecord(late=n_of[Mark.LATE], unreadable=n_of[Mark.UNREADABLE]) for team, n_of in marks.items()}
    faults = {team.name.lower(): seat.faults() for team, seat in seats.items()}
    ending = sign_statement(identity, Ended(match=order.match, **result.to_dict(), faults=faults))
    return [Over(order.match, result, seats, ending), Shut(order.match, has_journal=True)]
