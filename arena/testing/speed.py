"""How long a bot thinks at most, as something that a test can assert."""

import time
from collections.abc import Callable, Sequence

from arena.game.observation import Observation
from arena.game.ruleset import Ruleset
from arena.game.types import Team
from arena.policy import MatchResult
from arena.testing.stepped_match import Bot, SteppedMatch, make_bot

_PLAYS = 3


def assert_never_slower_than(
    bot: Bot,
    milliseconds: float,
    *,
    rules: str | Ruleset = "paper",
    opponent: Bot | None = None,
    matches: int = 4,
    seed: int = 0,
    clock: Callable[[], float] = time.thread_time,
) -> float:
    """Play a bot in real matches, and fail if any turn of its thinking takes longer; return the longest, in milliseconds.

    Measured is the processor time of the thread that calls `act`, so that a busy machine does not count; waiting (for a disk, for
    sleep, for other threads and processes) does not count either: `clock=time.perf_counter` counts it, as a pit does. A turn that
    takes too long is given the same match twice more, by a bot made anew, and the least of its three times counts. So what a bot
    does once in a process is forgiven; `start` is not measured.

    Parameters
    ----------
    bot
        A function `act(observation)`, or a class with `act`.
    rules
        A ruleset by name, a TOML file, or a ruleset.
    opponent
        Who plays against it; without one, the bot plays itself, and is measured on both sides.
    matches
        How many are played, on maps that follow from `seed`. Against an opponent the bot is blue in one, red in the next.

    Raises
    ------
    AssertionError
        A turn takes longer; it says which, of which match.

    Examples
    --------
    >>> def act(observation):
    ...     return [0 for _ in observation.units]
    >>> longest_ms = assert_never_slower_than(act, 50, matches=1)
    """
    longest_s = 0.0
    for number in range(seed, seed + matches):
        match = SteppedMatch(rules, seed=number)
        measured = Team(number % 2) if opponent is not None else None
        seats = {team: _TimedBot(bot if measured in (team, None) else opponent, match.ruleset, team, clock) for team in Team}
        match.play(seats[Team.BLUE], seats[Team.RED])
        for seat in seats.values() if measured is None else [seats[measured]]:
            for _ in range(_PLAYS - 1):
                if max(seat.took_s) * 1000 > milliseconds:
                    seat.took_s = [min(pair) for pair in zip(seat.took_s, seat.again(), strict=True)]
            worst_s = max(seat.took_s)
            if worst_s * 1000 > milliseconds:
                where = f"as {seat.team.name.lower()}, rules {seat.ruleset.name}, seed {number}"
                raise AssertionError(
                    f"tick {seat.took_s.index(worst_s)} takes {worst_s * 1000:.1f} ms of thinking, the least of {_PLAYS} plays, "
                    f"{where}; {milliseconds:g} ms are allowed"
                )
            longest_s = max(longest_s, worst_s)
    return longest_s * 1000


class _TimedBot:
    """A bot in one match, what it was shown there, and how long it thought about each."""

    def __init__(self, bot: Bot, ruleset: Ruleset, team: Team, clock: Callable[[], float]) -> None:
        self.ruleset, self.team = ruleset, team
        self.took_s: list[float] = []
        self._bot, self._clock = bot, clock
        self._made = make_bot(bot, ruleset, team)
        self._seen: list[Observation] = []
        self._result: MatchResult | None = None

    def act(self, observation: Observation) -> Sequence[int]:
        """Let it act, and measure."""
        self._seen.append(observation)
        before_s = self._clock()
        orders: Sequence[int] = self._made.act(observation)
        self.took_s.append(self._clock() - before_s)
        return orders

    def end(self, result: MatchResult) -> None:
        """Tell it how the match ended."""
        self._result = result
        if hasattr(self._made, "end"):
            self._made.end(result)

    def again(self) -> list[float]:
        """Return how long a bot that is made anew thinks about the same."""
        twin = _TimedBot(self._bot, self.ruleset, self.team, self._clock)
        for observation in self._seen:
            twin.act(observation)
        if self._result is not None:
            twin.end(self._result)
        return twin.took_s
