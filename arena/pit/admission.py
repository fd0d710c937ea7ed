"""Who may play, waits for an opponent, and is seated."""

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from arena.game.ruleset import Ruleset
from arena.pit.authenticator import PendingRequest
from arena.pit.effects import Drop, Effect
from arena.pit.matches import Matches
from arena.pit.register import Register
from arena.pit.seating import Pairing, Seating, object_to
from arena.pit.seats import Client, Seat, SlotId, SlotsByClient
from arena.protocol.messages import JoinRequest, Refusal, Wait

HOLD_QUESTION_S = 4.0
"""How long a client that waits for a seat is kept without an answer."""
FORGET_WAITING_S = 15.0
"""How long a place in the queue is kept for a client that does not ask again."""
MOST_QUEUED = 4_096
"""Clients that may wait for a seat at once."""
MOST_RUNNING = 2_000
"""Matches at once, where nothing else was said; each costs some 50 kB, and fewer begin where no journal can be opened."""


@dataclass(slots=True)
class QueuedClient:
    """A client that waits for a seat."""

    name: str
    """Of its entry."""
    pending: PendingRequest | None
    """None once it was answered with Wait, until it asks again."""
    asked_at_s: float


class Admission:
    """The queue of those who are not seated yet."""

    def __init__(
        self, ruleset: Ruleset, seating: Seating, register: Register, matches: Matches, most_running: int | None = None
    ) -> None:
        self._most_running = most_running
        self._ruleset, self._seating, self._register, self._matches = ruleset, seating, register, matches
        self._queue: dict[SlotId, QueuedClient] = {}
        self._by_client = SlotsByClient()
        """Those in the queue."""
        self._sessions: dict[Client, tuple[str, float]] = {}
        """The connection of each client whose request was accepted, and when."""
        self._gone: OrderedDict[str, float] = OrderedDict()
        """When client processes went, the last ones: what they had asked before may be opened after that."""
        self.n_journals: float = math.inf
        """Matches that may begin before more journals can be opened."""

    @property
    def _has_room(self) -> bool:
        most = MOST_RUNNING if self._most_running is None else self._most_running
        return len(self._matches.running) < most and self.n_journals > 0

    @property
    def _wait(self) -> Wait:
        """What those are told who wait for long."""
        if self._has_room:
            return Wait(reason="for an opponent")
        if self.n_journals > 0:
            return Wait(reason=f"for room: the pit plays {len(self._matches.running)} matches, and takes no more at once")
        return Wait(reason="for room: the pit can open no journal for another match now")

    @property
    def n_waiting(self) -> int:
        """Clients that wait for a seat."""
        return len(self._queue)

    @property
    def names(self) -> list[str]:
        """Names of those who wait, the one that has waited longest first."""
        return [client.name for client in self._queue.values()]

    def entry_of(self, name: str) -> bytes | None:
        """Return the public key that waits under a name, if any."""
        return next((slot.entry for slot, client in self._queue.items() if client.name == name), None)

    def receive(self, pending: PendingRequest, request: JoinRequest, now_s: float) -> list[Effect]:
        """Seat an entry, or let it wait, or refuse it."""
        has_versions = self._seating.has_versions
        refusal = object_to(request, self._ruleset, has_versions=has_versions) or self._register.object_to(request)
        if refusal:
            return [pending.reply(Refusal(reason=refusal))]
        if pending.asked_at_s <= self._gone.get(request.client, -math.inf):
            return [Drop(pending.question)]  # a seat that it were given would never be vacant
        self._register.admit(request)
        slot = SlotId(request.entry, request.client, request.slot)
        self._note_session(slot, pending.session, now_s)
        seat = self._matches.find_seat(slot, request)
        if seat is not None:
            self._forget(slot)
            return self._matches.issue_ticket(seat, slot, pending, now_s)
        if request.match:
            ending = self._matches.find_ending(request.match)
            return [pending.reply(ending or Wait(reason="for another match, since that one is over"))]
        return self._enqueue(slot, pending, request, now_s)

    def find_sessions(self, now_s: float) -> tuple[set[str], set[str]]:
        """Return the connections of those who hold seats, and of those whose requests were accepted lately."""
        holders = self._matches.holders
        seated = {session for client, (session, _) in self._sessions.items() if client in holders}
        lately = {session for session, accepted_at_s in self._sessions.values() if now_s - accepted_at_s < FORGET_WAITING_S}
        return seated, lately

    def _note_session(self, slot: SlotId, session: str, now_s: float) -> None:
        self._sessions[slot[:2]] = session, now_s
        if len(self._sessions) > 2 * MOST_QUEUED:
            holders = self._matches.holders
            self._sessions = {
                client: (session, accepted_at_s)
                for client, (session, accepted_at_s) in self._sessions.items()
                if client in holders or now_s - accepted_at_s < FORGET_WAITING_S
            }

    def welcome(self, client: str) -> None:
        """Note that a client process is there, and may have been away."""
        self._gone.pop(client, None)

    def lose(self, client: str, now_s: float) -> None:
        """Forget who waited, since its process is gone."""
        self._gone[client] = now_s
        if len(self._gone) > MOST_QUEUED:
            self._gone.popitem(last=False)
        for slot in self._by_client.find(client):
            self._forget(slot)

    def advance(self, now_s: float) -> list[Effect]:
        """Begin what can begin; answer those who have waited for long that they still wait, or that it is of no use."""
        effects: list[Effect] = []
        while self._has_room and (pairing := self._seating.pair_up(now_s)) is not None:
            effects += self._begin(pairing, now_s)
        for slot, client in list(self._queue.items()):
            waited_s = now_s - client.asked_at_s
            dismissal = self._seating.dismissal(client.name)
            if client.pending is not None and (dismissal is not None or waited_s >= HOLD_QUESTION_S):
                effects.append(client.pending.reply(dismissal or self._wait))
                client.pending = None
                if dismissal is not None:
                    self._forget(slot)
            elif waited_s >= FORGET_WAITING_S:
                self._forget(slot)
        return effects

    def dismiss(self, is_meant: Callable[[str, bytes], bool]) -> tuple[int, list[Effect]]:
        """Send away whoever waits under a name and a public key that are meant; return how many."""
        meant = [(slot, client.pending) for slot, client in self._queue.items() if is_meant(client.name, slot.entry)]
        for slot, _ in meant:
            self._forget(slot)
        refusal = Refusal(reason="the operator sent this client away")
        return len(meant), [pending.reply(refusal) for _, pending in meant if pending is not None]

    def _enqueue(self, slot: SlotId, pending: PendingRequest, request: JoinRequest, now_s: float) -> list[Effect]:
        effects: list[Effect] = []
        before = self._queue.get(slot)
        if before is None and len(self._queue) >= MOST_QUEUED:
            return [pending.reply(Refusal(reason=f"{MOST_QUEUED} clients wait already; come again later"))]
        if before is not None and before.pending is not None:
            effects.append(before.pending.reply(self._wait))
        self._queue[slot] = QueuedClient(request.name, pending, now_s)
        self._by_client.add(slot)
        if not self._has_room:
            given_up = self._matches.give_up_unready(now_s)
            if not given_up or self.n_journals <= 0:
                return effects + given_up  # the client gets Wait in time, and asks again
            effects += given_up
        answer = self._seating.place(slot, request, now_s)
        if isinstance(answer, Pairing):
            effects += self._begin(answer, now_s)
        elif not isinstance(answer, Wait):
            self._forget(slot)
            effects.append(pending.reply(answer))
        return effects

    def _begin(self, pairing: Pairing, now_s: float) -> list[Effect]:
        """Begin a match, and seat those of its clients who are asking just now; the others ask again in a moment."""
        match, effects = self._matches.begin(pairing, now_s)
        self.n_journals -= 1
        for team, slot in pairing.slots.items():
            pending = self._queue.pop(slot).pending
            self._by_client.remove(slot)
            if pending is not None:
                effects += self._matches.issue_ticket(Seat(match, team), slot, pending, now_s)
        return effects

    def _forget(self, slot: SlotId) -> None:
        if self._queue.pop(slot, None) is not None:
            self._by_client.remove(slot)
            self._seating.forget(slot)
