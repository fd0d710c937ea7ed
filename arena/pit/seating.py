"""Who plays whom: from slots that wait for a seat to matches of two. Without I/O."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from arena.game.ruleset import Ruleset
from arena.game.types import RULES_VERSION, Team
from arena.pit.seats import SlotId
from arena.protocol import topics
from arena.protocol.messages import Closed, JoinRequest, Refusal, Wait
from arena.records.plan import MatchPlan

MOST_SLOTS = 256
"""Seats that one client process may ask for at once."""


@dataclass(frozen=True, slots=True)
class Pairing:
    """A match that can begin."""

    plan: MatchPlan
    slots: dict[Team, SlotId]


class Seating(Protocol):
    """Decides who plays whom."""

    plays_maps_once: bool = False
    """Whether no map is played a second time; only then may boards of matches that run be shown to everyone."""
    has_versions: bool = False
    """Whether entries play under labels, as mine.2. Where anyone may play, such a name would pass for another's."""

    def place(self, slot: SlotId, request: JoinRequest, now_s: float) -> Pairing | Wait | Refusal | Closed:
        """Take a request, perhaps one that was taken before; a pairing may hold other slots that waited."""

    def pair_up(self, now_s: float) -> Pairing | None:
        """Return a match that can begin though nobody new came, of slots that were placed; asked again and again."""
        return None

    def dismissal(self, name: str) -> Closed | None:
        """Return what those are told who wait under a name and are to wait no longer; None while they may."""
        return Closed(reason="the pit begins no more matches") if self.is_done else None

    def forget(self, slot: SlotId) -> None:
        """A slot that waited is gone."""

    def close(self) -> None:
        """Begin no more matches."""

    def is_planned(self, names: set[str]) -> bool:
        """Whether two entries are to meet again, on a map that they may know then."""

    def standings(self) -> list[dict[str, Any]]:
        """Return who leads, as the lobby lists it; nothing where nobody is rated as matches end."""
        return []

    @property
    def is_done(self) -> bool:
        """Whether no match will begin any more."""


def object_to(request: JoinRequest, ruleset: Ruleset, *, has_versions: bool) -> str:
    """Return why a request cannot be met whatever seats are free, or nothing."""
    if request.rules_version != RULES_VERSION:
        return f"the client knows version {request.rules_version} of the rules, the pit {RULES_VERSION}; install the same"
    if request.rules_hash and request.rules_hash != ruleset.hash:
        ours, theirs = ruleset.hash[:12], request.rules_hash[:12]
        return f"the pit plays ruleset {ruleset.name} ({ours}), the client wants {theirs}"
    if request.team not in ("red", "blue", "any"):
        return f"there is no team {request.team!r}; red, blue or any"
    is_name = topics.is_label if has_versions else topics.is_chunk
    if not is_name(request.name) or not topics.is_chunk(request.client):
        return "a name is 1 to 64 letters, digits, - or _"
    if request.version and not topics.is_chunk(request.version):
        return "a version is 1 to 64 letters, digits, - or _"
    if not 0 <= request.slot < MOST_SLOTS:
        return f"there is no slot {request.slot}; a client has slots 0 to {MOST_SLOTS - 1}"
    return ""


class OpenSeating(Seating):
    """Whoever comes: a match begins when a red and a blue seat are taken."""

    plays_maps_once = True

    def __init__(self, make_plan: Callable[[str, str], MatchPlan], n_matches: int | None) -> None:
        self._make_plan, self._left = make_plan, n_matches
        self._waiting: dict[Team, tuple[SlotId, str]] = {}
        self._in_line: dict[SlotId, tuple[Team, str]] = {}
        """Slots that want a team which another slot of the same entry waits on, the first first."""

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

    def place(self, slot: SlotId, request: JoinRequest, now_s: float) -> Pairing | Wait | Refusal | Closed:
        """Seat a client on the team that it wants, if it is free."""
        if self.is_done:
            return Closed(reason="the pit begins no more matches")
        own = next((team for team, (other, _) in self._waiting.items() if other == slot), None)
        if own is None:
            wanted = list(Team) if request.team == "any" else [Team[request.team.upper()]]
            free = [team for team in wanted if team not in self._waiting]
            if not free:
                holder, name = self._waiting[wanted[0]]
                if holder.entry == slot.entry:
                    self._in_line.setdefault(slot, (wanted[0], request.name))
                    return Wait(reason="for an opponent")
                other = wanted[0].other.name.lower()
                hint = "it is free" if wanted[0].other not in self._waiting else "it is taken as well"
                return Refusal(reason=f"{wanted[0].name.lower()} is taken, by {name}; try {other}: {hint}")
            self._in_line.pop(slot, None)
            self._waiting[free[0]] = (slot, request.name)
        return self._pair() or Wait(reason="for an opponent")

    def pair_up(self, now_s: float) -> Pairing | None:
        """Seat slots that stood in line for teams that are free now, and return the match that can begin by that."""
        for slot, (team, name) in list(self._in_line.items()):
            if team not in self._waiting and not self.is_done:
                del self._in_line[slot]
                self._waiting[team] = (slot, name)
        return self._pair()

    def _pair(self) -> Pairing | None:
        if len(self._waiting) < len(Team):
            return None
        (blue, blue_name), (red, red_name) = self._waiting[Team.BLUE], self._waiting[Team.RED]
        self._waiting.clear()
        if self._left is not None:
            self._left -= 1
        return Pairing(self._make_plan(blue_name, red_name), {Team.BLUE: blue, Team.RED: red})

    def forget(self, slot: SlotId) -> None:
        """Free the team that a slot waited on."""
        self._waiting = {team: waiting for team, waiting in self._waiting.items() if waiting[0] != slot}
        self._in_line.pop(slot, None)


class PlannedSeating(Seating):
    """The matches of a league, in its order as far as those who play them are present.

    Parameters
    ----------
    is_open
        Whether matches and entries may yet be added. An entry whose matches have all begun waits then for more, until `finish`.
    """

    has_versions = True

    def __init__(self, plans: Iterable[MatchPlan] = (), *, is_open: bool = False) -> None:
        self._plans: list[MatchPlan] = []
        self._entries: set[str] = set()
        self._dismissed: set[str] = set()
        self._waiting: dict[SlotId, str] = {}
        self._begun: list[str] = []
        self._is_open = is_open
        self._has_news = False
        """Whether matches were added that slots may wait for."""
        self.add(plans)

    @property
    def is_done(self) -> bool:
        """Whether every match has begun, and none can be added."""
        return not self._plans and not self._is_open

    @property
    def waiting(self) -> set[str]:
        """The entries that wait for a match."""
        return set(self._waiting.values())

    def add(self, plans: Iterable[MatchPlan], entries: Iterable[str] = ()) -> None:
        """Put matches at the end of the plan, and let entries in that may have none yet."""
        added = list(plans)
        self._plans += added
        self._entries.update(entries, (name for plan in added for name in (plan.blue, plan.red)))
        self._has_news = self._has_news or bool(added)

    def finish(self) -> None:
        """Add nothing more: an entry whose matches have all begun is sent home."""
        self._is_open = False

    def dismiss(self, name: str) -> None:
        """Send an entry home; its matches wait for it until it is called."""
        self._dismissed.add(name)
        self._waiting = {slot: other for slot, other in self._waiting.items() if other != name}

    def call(self, name: str) -> None:
        """Seat an entry again that was dismissed."""
        self._dismissed.discard(name)

    def drop(self, names: Collection[str]) -> list[str]:
        """Take off the plan what entries have not begun to play; return the identities."""
        dropped = [plan.identity for plan in self._plans if plan.blue in names or plan.red in names]
        self.withdraw(dropped)
        return dropped

    def dismissal(self, name: str) -> Closed | None:
        """Return what those are told who wait under a name and are to wait no longer; None while they may."""
        if name in self._dismissed:
            return Closed(reason=f"{name} is not needed for now")
        return Closed(reason=f"all matches of {name} have begun") if self.is_done else None

    def take_begun(self) -> list[str]:
        """Return the identities of the matches that have begun since the last call."""
        begun, self._begun = self._begun, []
        return begun

    def close(self) -> None:
        """Begin no more matches."""
        self._plans.clear()
        self._is_open = False

    def is_planned(self, names: set[str]) -> bool:
        """Whether the fixture of two entries has matches that are still to begin."""
        return any({plan.blue, plan.red} == names for plan in self._plans)

    def withdraw(self, identities: Iterable[str]) -> None:
        """Take matches off the plan, as those that run already."""
        gone = set(identities)
        self._plans = [plan for plan in self._plans if plan.identity not in gone]

    def place(self, slot: SlotId, request: JoinRequest, now_s: float) -> Pairing | Wait | Refusal | Closed:
        """Begin the first match for whose entries slots are waiting."""
        name = request.name
        if name not in self._entries:
            return Refusal(reason=f"{name} is no entry of this league")
        if (dismissal := self.dismissal(name)) is not None:
            return dismissal
        self._waiting[slot] = name
        pairing = self._pair(name)
        if pairing is not None:
            return pairing
        if not self._is_open and not any(name in (plan.blue, plan.red) for plan in self._plans):
            self._waiting.pop(slot)
            return Closed(reason=f"all matches of {name} have begun")
        return Wait(reason="for an opponent")

    def pair_up(self, now_s: float) -> Pairing | None:
        """Return a match that was added while slots of both its entries waited."""
        if not self._has_news:
            return None
        pairing = self._pair()
        self._has_news = pairing is not None
        return pairing

    def _pair(self, name: str = "") -> Pairing | None:
        """Take the first match off the plan, of an entry if one is named, for whose entries slots are waiting."""
        waiting = self.waiting
        for index, plan in enumerate(self._plans):
            if (not name or name in (plan.blue, plan.red)) and waiting.issuperset((plan.blue, plan.red)):
                slots = self._find(plan)
                if slots:
                    del self._plans[index]
                    for taken in slots.values():
                        del self._waiting[taken]
                    self._begun.append(plan.identity)
                    return Pairing(plan, slots)
        return None

    def _find(self, plan: MatchPlan) -> dict[Team, SlotId] | None:
        """Return slots of both entries of a plan, if they are waiting."""
        blue = next((slot for slot, name in self._waiting.items() if name == plan.blue), None)
        red = next((slot for slot, name in self._waiting.items() if name == plan.red and slot != blue), None)
        return {Team.BLUE: blue, Team.RED: red} if blue and red else None

    def forget(self, slot: SlotId) -> None:
        """Take a slot off the list."""
        self._waiting.pop(slot, None)
