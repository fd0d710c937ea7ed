"""A ladder, as a pit needs one, and who plays whom on it. Whoever opens the pit hands over what fills this port.

On a ladder whoever waits meets whom the ladder chooses, on a map of their own, and each result moves two ratings. An entry is its
public key here: a name can be given back.
"""

import logging
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

from arena.errors import InputError
from arena.game.types import Team
from arena.pit.seating import Pairing, Seating
from arena.pit.seats import SlotId
from arena.policy import MatchResult
from arena.protocol.identity import to_text
from arena.protocol.messages import Closed, JoinRequest, Refusal, Wait
from arena.records.journal import identity_of, journal_name
from arena.records.journal_folder import load_journal
from arena.records.plan import MatchPlan, PitMatchId
from arena.records.replay import BrokenChainError, verify

logger = logging.getLogger(__name__)

MOST_CONSIDERED = 64
"""Entries from which an opponent is chosen: those that have waited longest, so that a crowd costs no match its turns."""
MOST_OF_OWNER = 4
"""Of these, entries of one owner: they do not meet each other, and must not keep all others from being considered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Waiting:
    """An entry that waits for an opponent."""

    entry: bytes
    """Public key."""
    since_s: float
    owner: str = ""
    """Two of one owner do not meet."""
    version: str = ""
    """As in `arena.protocol.messages.JoinRequest`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LadderMatch:
    """A match of a ladder that ended."""

    identity: str
    names: Mapping[Team, str]
    entries: Mapping[Team, bytes]
    """Public keys."""
    rules_hash: str
    result: MatchResult
    """A void match is handed over as well; it moves nothing."""


class Ladder(Protocol):
    """Who is how strong, who is to meet whom, and what came of it."""

    def identities(self) -> Collection[str]:
        """Return the matches that were counted already, by any pit that kept this ladder."""

    def choose(self, waiting: Sequence[Waiting], now_s: float) -> tuple[Waiting, Waiting] | None:
        """Return who plays blue and who plays red, if two of different owners are to meet now; all have keys of their own."""

    def count(self, match: LadderMatch) -> None:
        """Take a result, once; `ArenaError` if results cannot be kept any more."""

    def standings(self) -> list[dict[str, Any]]:
        """Return who leads, as `arena.protocol.messages.Lobby` has it."""


class Backlog(NamedTuple):
    """What a ladder has counted and not yet stored."""

    n_rows: int
    lag_s: float
    """How long the oldest of them has waited."""


@runtime_checkable
class LaggingLadder(Ladder, Protocol):
    """A ladder that stores its results behind the pit's back, and tells a monitor how far behind it is. None has to be one."""

    def backlog(self) -> Backlog:
        """Return what is not stored yet."""


OpenLadder = Callable[[str, str, str], AbstractContextManager[Ladder]]
"""Takes where it is kept (a URL or a file), the name of the pit, and the hash of the ruleset that it plays."""


class _Place(NamedTuple):
    """A slot's place in the queue."""

    name: str
    since_s: float
    version: str


class LadderSeating(Seating):
    """Whoever comes, against whom the ladder chooses."""

    plays_maps_once = True

    def __init__(
        self,
        ladder: Ladder,
        make_plan: Callable[[str, str], MatchPlan],
        n_matches: int | None,
        owner_of: Callable[[bytes], str] = to_text,
    ) -> None:
        self._ladder, self._make_plan, self._left, self._owner_of = ladder, make_plan, n_matches, owner_of
        self._waiting: dict[bytes, dict[SlotId, _Place]] = {}
        """By entry, the one that is to be looked at next first."""

    @property
    def is_done(self) -> bool:
        """Whether the last match has begun."""
        return self._left == 0

    def close(self) -> None:
        """Begin no more matches."""
        self._left = 0

    def is_planned(self, names: set[str]) -> bool:
        """No: every match is its own fixture here, on a map of its own."""
        return False

    def standings(self) -> list[dict[str, Any]]:
        """Return who leads."""
        return self._ladder.standings()

    def place(self, slot: SlotId, request: JoinRequest, now_s: float) -> Wait | Refusal | Closed:
        """Have a client wait; `pair_up` begins its match."""
        if self.is_done:
            return Closed(reason="the pit begins no more matches")
        if request.team != "any":
            return Refusal(reason="on a ladder the pit gives out the teams; join with --team any")
        slots = self._waiting.setdefault(request.entry, {})
        before = slots.get(slot) or _Place(request.name, now_s, "")
        slots[slot] = before._replace(version=request.version or before.version)
        return Wait(reason="for an opponent")

    def pair_up(self, now_s: float) -> Pairing | None:
        """Return the match of two entries that the ladder has chosen, if any."""
        if self.is_done or len(self._waiting) < len(Team):
            return None
        chosen = self._ladder.choose(list(islice(self._find_considered(), MOST_CONSIDERED)), now_s)
        if chosen is None:
            return None
        if self._left is not None:
            self._left -= 1
        (blue, blue_name), (red, red_name) = (self._take(one.entry) for one in chosen)
        return Pairing(self._make_plan(blue_name, red_name), {Team.BLUE: blue, Team.RED: red})

    def _find_considered(self) -> Iterator[Waiting]:
        n_of_owner: Counter[str] = Counter()
        for entry, slots in self._waiting.items():
            owner = self._owner_of(entry)
            n_of_owner[owner] += 1
            if n_of_owner[owner] <= MOST_OF_OWNER:
                first = next(iter(slots.values()))
                yield Waiting(entry=entry, since_s=first.since_s, owner=owner, version=first.version)

    def _take(self, entry: bytes) -> tuple[SlotId, str]:
        """Take the slot of an entry that has waited longest; its other slots line up behind the other entries."""
        slots = self._waiting.pop(entry)
        slot = next(iter(slots))
        name = slots.pop(slot).name
        if slots:
            self._waiting[entry] = slots
        return slot, name

    def forget(self, slot: SlotId) -> None:
        """Take a slot off the list."""
        slots = self._waiting.get(slot.entry, {})
        slots.pop(slot, None)
        if not slots:
            self._waiting.pop(slot.entry, None)


def is_of_ladder(identity: str, pit: str) -> bool:
    """Whether a match is of a pit's ladder."""
    try:
        match = PitMatchId.parse(identity)
    except ValueError:
        return False
    return match.is_rated and match.pit == pit


def find_uncounted(journals: Path, pit: str, counted: Collection[str]) -> Iterator[LadderMatch]:
    """Yield the ladder matches whose journal has an ending, and whose result was lost with a pit that was killed.

    Each is played again first: what is counted holds.
    """
    names = {journal_name(identity) for identity in counted}
    for path in sorted(journals.glob("*.journal")):
        if path.name in names or not is_of_ladder(identity_of(path.name), pit):
            continue
        try:
            journal = load_journal(path)
            if journal.ending is None or journal.seals is None:
                continue
            verify(journal)
        except (InputError, BrokenChainError) as error:
            logger.warning("%s is not counted: %s", path.name, error)
            continue
        header = journal.header
        yield LadderMatch(
            identity=header.identity,
            names={Team.BLUE: header.blue, Team.RED: header.red},
            entries=journal.seals.entries,
            rules_hash=header.ruleset.hash,
            result=journal.ending,
        )
