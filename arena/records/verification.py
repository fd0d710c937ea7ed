"""What the pit and the entries put their names to in a journal, checked against the match as it is played again."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

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
    """Return what each seat was shown, tick by tick, without the clock.

    Raises
    ------
    BrokenChainError
        The journal does not hold.
    """
    shown: list[list[bytes]] = [[], []]
    for games in replay(journal):
        for team, seen in games.observe().items():
            shown[team].append(without_clock(ObservationWriter(seen, 0).write()))
    return shown


def check_seals(journal: Journal) -> Checked | None:
    """Return how the signatures stand, or None if no network was between the players; raises as `watch` does."""
    seals = journal.seals
    if seals is None:
        return None
    match = journal.name
    commitment = encode(Commitment(match=match, digest=commit(match, journal.header.keys)), STATEMENT_VERSION)
    shown = watch(journal)
    return Checked(
        commitment=_stands(lambda: read_statement(Signed(data=commitment, signature=seals.commitment), seals.pit_key)),
        signature=_stands(lambda: check_journal(seals.pit_key, journal.ending_chain or b"", seals.signature))
        if seals.signature
        else Standing.MISSING,
        receipts={team: _check_receipt(seals.entries[team], match, team, seals.receipts.get(team), shown[team]) for team in Team},
    )


def compare(journal: Journal, transcript: Transcript) -> str:
    """Return in what a seat's transcript differs from the journal of its match, or nothing; raises as `watch` does."""
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
    shown, told = watch(journal)[header.team], transcript.ending
    for tick, (seen, (observation, orders)) in enumerate(zip(shown, transcript.ticks, strict=False)):
        if seen != without_clock(observation):
            return f"at tick {tick} the seat was shown something else than the journal's match shows"
        if not journal.keeps(tick, header.team, orders):
            return f"at tick {tick} the journal has other orders than the seat gave"
    if len(transcript.ticks) > len(shown):
        return "the seat was shown more ticks than the journal has"
    if told and journal.ending != told.seen_by(header.team):
        return "the journal ends otherwise than the seat was told"
    return ""


def _check_receipt(entry: bytes, match: str, team: Team, receipt: Receipt | None, shown: list[bytes]) -> Standing:
    if receipt is None:
        return Standing.MISSING
    standing = _stands(lambda: check_receipt(entry, match, team, receipt))
    if standing is not Standing.HOLDS:
        return standing
    head = Head()
    for observation in shown[: receipt.n_shown]:
        head.add(observation)
    return Standing.HOLDS if receipt.n_shown <= len(shown) and head.digest == receipt.head else Standing.DIFFERS


def _stands(check: Callable[[], object]) -> Standing:
    try:
        check()
    except ForgedError:
        return Standing.FORGED
    return Standing.HOLDS
