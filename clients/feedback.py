"""What the author of a policy hears while it plays in a pit: why its units stayed, and which of its turns were late."""

from collections.abc import Iterator

from arena.console import quantity
from arena.policy import Faults
from clients.seat import Seat

_MOST_LATE = 5
"""Late turns of a match that are told one by one; so with those that the bank paid for."""

_SOON = 3
"""Turns that a late answer may take to come, before it is told that there is none."""


class Feedback:
    """Tells each reason once, however many matches are played, and late turns one by one; counts all, match by match."""

    def __init__(self) -> None:
        self._told: set[str] = set()
        """Kinds of reasons, and tracebacks."""
        self._playing: list[_Played] = []

    def begin(self, seat: Seat) -> None:
        """A match begins; there is nothing more to tell of those that are gone."""
        self._playing = [*(played for played in self._playing if not played.seat.is_gone), _Played(seat)]

    def news(self) -> Iterator[str]:
        """Yield, in sentences, what became known since the last call."""
        for played in self._playing:
            played.look()
            match = played.seat.ticket.match
            for kind, (sentence, _) in played.faults.reasons.items():
                if self._is_new(kind):
                    yield f"match {match}: {sentence}"
            yield from (f"match {match}: {sentence}" for sentence in played.late_turns())

    def end(self, seat: Seat) -> tuple[list[str], str]:
        """A match is over; return a line for each kind of what went wrong, and a traceback that was not shown before."""
        played = next((played for played in self._playing if played.seat is seat), _Played(seat))
        if played in self._playing:
            self._playing.remove(played)
        played.look()
        traceback = played.faults.first_traceback or ""
        return played.summary(), traceback if traceback and self._is_new(traceback) else ""

    def _is_new(self, what: str) -> bool:
        is_new = what not in self._told
        self._told.add(what)
        return is_new


class _Played:
    """One match."""

    def __init__(self, seat: Seat) -> None:
        self.seat = seat
        self.faults = Faults()
        self._turn_time_s, self._bank_s = seat.ticket.turn_time_s, seat.ticket.bank_s
        self._n_judged = 0
        """Ticks whose charge was looked at."""
        self._late: list[int] = []
        self._untold: dict[int, str] = {}
        """Late ticks that are told of once the policy has answered, or does not soon; and the time that they had."""
        self._n_slow = 0

    def look(self) -> None:
        """Take what the policy failed at since the last look."""
        self.faults.add(self.seat.faults())

    def late_turns(self) -> Iterator[str]:
        """Yield a sentence for each turn, of those charged since the last call, that was late or that the bank paid for."""
        turn_time_s = self._turn_time_s
        if turn_time_s is None:
            return
        charges = self.seat.charges_us
        for tick in range(self._n_judged, len(charges)):
            charged_s = charges[tick] / 1e6
            allowed = f"of {_ms(turn_time_s)}{f' and {_ms(self._bank_s)} in the bank' if self._bank_s > 0 else ''}"
            most_us = (turn_time_s + self._bank_s) * 1e6
            if abs(charges[tick] - most_us) <= 1 + self._n_slow:  # all that it had; each charge is rounded
                self._bank_s = 0.0
                self._late.append(tick)
                if len(self._late) <= _MOST_LATE:
                    self._untold[tick] = allowed
            elif charged_s > turn_time_s and self._bank_s > 0:
                self._bank_s = max(self._bank_s - (charged_s - turn_time_s), 0.0)
                self._n_slow += 1
                if self._n_slow <= _MOST_LATE:
                    yield f"tick {tick} took {_ms(charged_s)} ms {allowed}, which paid"
        self._n_judged = len(charges)
        for tick, allowed in list(self._untold.items()):
            took_s = self.seat.took_s.get(tick)
            if took_s is None and tick > len(charges) - _SOON:
                continue
            del self._untold[tick]
            if took_s is None:
                how = f"no answer yet, {allowed}"
            elif took_s < turn_time_s:
                how = f"{_ms(took_s)} ms, begun too late"
            else:
                how = f"{_ms(took_s)} ms {allowed}"
            yield f"tick {tick} was late: {how}; all its units stayed"

    def summary(self) -> list[str]:
        """Return a line for each kind of what went wrong in the match."""
        lines = [f"{sentence} ({quantity(n, 'turn')})" for sentence, n in self.faults.reasons.values()]
        if self._late:
            slowest = max(self._late, key=lambda tick: self.seat.took_s.get(tick, 0.0))
            took_s = self.seat.took_s.get(slowest)
            lines.append(
                f"{quantity(len(self._late), 'turn')} late"
                + ("" if took_s is None else f", the worst {_ms(took_s)} ms, at tick {slowest}")
            )
        if self._n_slow:
            lines.append(f"{quantity(self._n_slow, 'turn')} paid by the bank, which has {_ms(self._bank_s)} ms left")
        return lines


def _ms(seconds: float) -> str:
    return f"{seconds * 1000:,.0f}"
