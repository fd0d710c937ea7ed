"""The matches of a worker as a state machine without I/O: orders of the pit, actions of seats and the time go in."""

from collections.abc import Callable
from dataclasses import replace

from arena.errors import ForgedError
from arena.game.ruleset import Ruleset
from arena.match.match import Phase
from arena.match.time_control import TimeControl
from arena.pit.effects import Effect, TellPit
from arena.pit.events import (
    MORE_MAY_FOLLOW,
    ActionReceived,
    ActionsTaken,
    BundleReceived,
    Event,
    MatchTaken,
    Ordered,
    Stopped,
    TimePassed,
)
from arena.pit.match_session import PitContext
from arena.pit.match_sessions import MatchClosed, MatchOver, MatchSessions, NewMatch
from arena.pit.workers.messages import (
    ForfeitSeat,
    GiveSeat,
    Gone,
    LeaveSeat,
    MatchProgress,
    Order,
    Over,
    SeatGiven,
    Shut,
    TakeMatch,
    VoidMatch,
)


class WorkerCore:
    """All of a worker but its network, its files, its pipe and its clock.

    Parameters
    ----------
    lanes, note_lane
        See `MatchSessions`.
    """

    def __init__(
        self,
        context: PitContext,
        ruleset: Ruleset,
        time_control: TimeControl,
        lanes: range,
        note_lane: Callable[[int], None] = lambda lane: None,
    ) -> None:
        self._ruleset = ruleset
        self._sessions = MatchSessions(context, time_control, _report_over, _report_closed, lanes, note_lane)
        self.n_taken = 0
        """Matches so far."""

    @property
    def n_running(self) -> int:
        """Matches that are not over."""
        return len(self._sessions.running)

    def tell_progress(self) -> dict[str, MatchProgress]:
        """Return where each match stands."""
        return {one.id: MatchProgress(one.tick, one.match.phase is Phase.WAITING, one.faults()) for one in self._sessions.running}

    @property
    def holds_bundles(self) -> bool:
        """Whether something was gathered for clients."""
        return self._sessions.holds_bundles

    def receive(self, event: Event, now_s: float) -> list[Effect]:
        """Take an event; return what is to be done."""
        effects = self._take(event, now_s)
        if type(event) not in MORE_MAY_FOLLOW and self._sessions.holds_bundles:
            effects = [*effects, *self._sessions.take_bundles(now_s)]
        return effects

    def _take(self, event: Event, now_s: float) -> list[Effect]:
        match event:
            case ActionReceived():
                return self._sessions.receive(event, now_s)
            case BundleReceived():
                return self._sessions.receive_bundle(event, now_s)
            case ActionsTaken():
                return []
            case TimePassed(received_until_s):
                return self._sessions.advance(received_until_s)
            case Ordered(order):
                return self._obey(order, now_s)
            case MatchTaken(found, lane):
                self.n_taken += 1
                effects = self._sessions.resume(found, lane, now_s)
                return effects or [TellPit(Gone(found.journal.name, "its journal does not hold"))]
            case Stopped():
                return self._sessions.stop(now_s)
        raise ValueError(f"a worker knows no {event}")

    def _obey(self, order: Order, now_s: float) -> list[Effect]:
        match order:
            case TakeMatch(new=new):
                self.n_taken += 1
                return self._sessions.begin(self._share_rules(new), now_s)
            case GiveSeat():
                return [TellPit(SeatGiven(order.question, self._seal_ticket(order)))]
            case LeaveSeat(seat):
                return self._sessions.leave(seat, now_s)
            case ForfeitSeat(seat, why):
                return self._sessions.forfeit(seat, why, now_s)
            case VoidMatch(match, why, only_unready):
                one = self._sessions.find(match)
                has_begun = one is not None and one.match.phase is not Phase.WAITING
                return [] if only_unready and has_begun else self._sessions.void(match, why, now_s)
        raise ValueError(f"a worker knows no {order}")

    def _seal_ticket(self, order: GiveSeat) -> bytes | None:
        session = self._sessions.find(order.seat.match)
        if session is None:
            return None
        try:
            return order.caller.answer(self._sessions.make_ticket(session, order.seat.team, order.caller))
        except ForgedError:
            return None

    def _share_rules(self, new: NewMatch) -> NewMatch:
        """Return a match with the ruleset that this process has, where it is the same: each came with a copy of its own."""
        header = new.header
        return replace(new, header=replace(header, ruleset=self._ruleset)) if header.ruleset == self._ruleset else new


def _report_over(over: MatchOver) -> list[Effect]:
    return [TellPit(Over(over.match, over.ended.result, over.ended.seats, over.ending))]


def _report_closed(closed: MatchClosed) -> list[Effect]:
    return [TellPit(Shut(closed.match, closed.header is not None))]
