"""The operator's commands: who holds the pit's own key may remove players, end matches, close the pit and free a name."""

from collections.abc import Callable

from arena.pit.admission import Admission
from arena.pit.effects import Effect
from arena.pit.matches import Matches
from arena.pit.register import Register
from arena.pit.seating import Seating
from arena.protocol.messages import AdminRequest, Done, Message, Refusal

_Outcome = tuple[str, list[Effect]]
"""What was done, in words; nothing if the target is not here."""


class Operator:
    """Carries out commands that are signed with the pit's key."""

    def __init__(self, pit_key: bytes, register: Register, seating: Seating, matches: Matches, admission: Admission) -> None:
        self._pit_key, self._register, self._seating = pit_key, register, seating
        self._matches, self._admission = matches, admission
        self._commands: dict[str, Callable[[str, float], _Outcome]] = {
            "kick": self._kick,
            "ban": self._ban,
            "close": self._close,
            "abort": self._abort,
            "release-name": self._release,
        }

    def obey(self, request: AdminRequest, now_s: float) -> tuple[Message, list[Effect]]:
        """Do what the holder of the pit's key asks for; return the answer, and what comes before it."""
        if request.entry != self._pit_key:
            return Refusal(reason="only the holder of the pit's key is obeyed"), []
        command = self._commands.get(request.command)
        if command is None:
            known = ", ".join(self._commands)
            return Refusal(reason=f"there is no command {request.command!r}; it is one of {known}"), []
        text, effects = command(request.target, now_s)
        return Done(text=text) if text else Refusal(reason=f"{request.target} is not here"), effects

    def _kick(self, target: str, now_s: float) -> _Outcome:
        """Have an entry forfeit what it plays, and forget that it waits."""
        key = self._register.find(target)
        seats = self._matches.seats_of(key, target)
        effects = [effect for seat in seats for effect in self._matches.forfeit(seat, "was removed by the operator", now_s)]
        n_dismissed, replies = self._admission.dismiss(lambda name, entry: name == target or entry == key)
        text = f"{target}: {len(seats)} seats forfeited, {n_dismissed} sent away" if seats or n_dismissed else ""
        return text, effects + replies

    def _ban(self, target: str, now_s: float) -> _Outcome:
        key = self._admission.entry_of(target) or self._matches.entry_of(target) or self._register.find(target)
        if key is None:
            return "", []
        self._register.ban(target, key)
        text, effects = self._kick(target, now_s)
        return f"{target} is banned; {text or 'it was not here'}", effects

    def _close(self, target: str, now_s: float) -> _Outcome:
        self._seating.close()
        return "the pit begins no more matches", []

    def _abort(self, target: str, now_s: float) -> _Outcome:
        effects = self._matches.void(target, "was ended by the operator", now_s)
        return f"match {target} is void" if effects else "", effects

    def _release(self, target: str, now_s: float) -> _Outcome:
        return f"the name {target} is free" if self._register.release(target) else "", []
