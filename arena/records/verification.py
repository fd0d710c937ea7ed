"""What the pit and the entries put their names to in a journal, checked against the match as it is played again."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import chain

from arena.errors import ForgedError
from arena.game.types import Team
from arena.protocol.codec import encode
from arena.protocol.identity import to_text
from arena.protocol.messages import Commitment, Receipt, Signed
from arena.protocol.observation_codec import ObservationWriter, without_clock
from arena.protocol.signed import STATEMENT_VERSION, check_journal, check_receipt, commit, read_statement
from arena.records.journal import Journal
from arena.records.replay import replay
from arena.records.transcript import Head, Transcript


class Standing(Enum):
    """What a signature is worth."""

    HOLDS = "holds"
    MISSING = "missing"
    FORGED = "forged"
    DIFFERS = "differs"
    """It is the signer's, who says something else than the journal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """How each signature of a journal stands."""

    commitment: Standing
    """The pit committed itself to these keys."""
    signature: Standing
    """The pit stands for the last link of the chain."""
    receipts: dict[Team, Standing]
    """A seat was shown what the match, played again, shows it."""

    @property
    def is_sound(self) -> bool:
        """Whether nothing is forged, and the pit's own word is not against itself; the pit may not have signed yet."""
        standings = (self.commitment, self.signature, *self.receipts.values())
        return Standing.FORGED not in standings and self.commitment is Standing.HOLDS

    @property
    def is_signed(self) -> bool:
        """Whether the pit stands for how the match ended. Without that, anyone can write another ending behind its ticks."""
        return self.is_sound and self.signature is Standing.HOLDS


def watch(journal: Journal) -> list[list[bytes]]:
    """Return what each seat was shown, tick by tick, without the clock; raises as `watch_ticks` does."""
    return [list(shown) for shown in zip(*watch_ticks(journal), strict=True)]


def watch_ticks(journal: Journal) -> Iterator[tuple[bytes, ...]]:
    """Yield what each seat was shown of a tick, without the clock; all of a stranger's journal may be more than memory holds.

    Raises
    ------
    BrokenChainError
        The journal does not hold.
    """
    for games in replay(journal):
        yield tuple(without_clock(ObservationWriter(seen, 0).write()) for seen in games.observe().values())


def check_seals(journal: Journal) -> Checked | None:
    """Return how the signatures stand, or None if no network was between the players; raises as `watch_ticks` does."""
    seals = journal.seals
    if seals is None:
        return None
    match = journal.name
    commitment = encode(Commitment(match=match, digest=commit(match, journal.header.keys)), STATEMENT_VERSION)
    heads = _find_heads(journal, {team: receipt.n_shown for team, receipt in seals.receipts.items()})
    return Checked(
        commitment=_stands(lambda: read_statement(Signed(data=commitment, signature=seals.commitment), seals.pit_key)),
        signature=_stands(lambda: check_journal(seals.pit_key, journal.ending_chain or b"", seals.signature))
        if seals.signature
        else Standing.MISSING,
        receipts={
            team: _check_receipt(seals.entries[team], match, team, seals.receipts.get(team), heads.get(team)) for team in Team
        },
    )


def compare(journal: Journal, transcript: Transcript) -> str:
    """Return in what a seat's transcript differs from the journal of its match, or nothing; raises as `watch_ticks` does."""
    header, match = transcript.header, journal.name
    if header.match != match:
        return f"the transcript is of match {header.match}, the journal of {match}"
    if header.commitment != commit(match, journal.header.keys):
        return "the journal's keys are not those that the pit committed itself to"
    seals = journal.seals
    if seals is not None and seals.pit_key != header.pit_key:
        return f"the transcript is of the pit {to_text(header.pit_key)}, the journal of {to_text(seals.pit_key)}"
    if seals is not None and seals.entries[header.team] != header.entry_key:
        return f"the transcript is of the entry {to_text(header.entry_key)}, the journal of {to_text(seals.entries[header.team])}"
    n_shown, told, difference = 0, transcript.ending, ""
    for tick, seen in enumerate(watch_ticks(journal)):  # to the end, since it may not hold
        n_shown += 1
        if tick < len(transcript.ticks) and not difference:
            observation, orders = transcript.ticks[tick]
            if seen[header.team] != without_clock(observation):
                difference = f"at tick {tick} the seat was shown something else than the journal's match shows"
            elif not journal.keeps(tick, header.team, orders):
                difference = f"at tick {tick} the journal has other orders than the seat gave"
    if difference:
        return difference
    if len(transcript.ticks) > n_shown:
        return "the seat was shown more ticks than the journal has"
    if told and journal.ending != told.seen_by(header.team):
        return "the journal ends otherwise than the seat was told"
    return ""


def _find_heads(journal: Journal, n_shown: Mapping[Team, int]) -> dict[Team, bytes]:
    """Return the head of what a seat was shown of its first ticks, so many; of none that was not shown so many."""
    found: dict[Team, bytes] = {}
    heads = {team: Head() for team in Team}
    for n_before, seen in enumerate(chain(watch_ticks(journal), [()])):
        found |= {team: heads[team].digest for team, n_ticks in n_shown.items() if n_ticks == n_before}
        for head, observation in zip(heads.values(), seen, strict=False):
            head.add(observation)
    return found


def _check_receipt(entry: bytes, match: str, team: Team, receipt: Receipt | None, head: bytes | None) -> Standing:
    if receipt is None:
        return Standing.MISSING
    standing = _stands(lambda: check_receipt(entry, match, team, receipt))
    if standing is not Standing.HOLDS:
        return standing
    return Standing.HOLDS if receipt.head == head else Standing.DIFFERS


def _stands(check: Callable[[], object]) -> Standing:
    try:
        check()
    except ForgedError:
        return Standing.FORGED
    return Standing.HOLDS
