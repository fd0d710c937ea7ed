"""Play a bot against any fighter from a test, and see what came of it; the rest of the test kit is `arena.testing`."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from arena.game.keys import secret_from_seed
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_ruleset
from arena.local.venue import play
from arena.policy import BatchFactory, Faults
from policies.registry import load, make_factory
from tournaments.fixture import plan_fixture, tally

_MINE, _OTHER = "bot", "opponent"
"""Names in the matches: they do not depend on who plays, so that all play on the same maps."""
Fighter = str | Path | Callable[..., Any]
"""A fighter's name, a bot file, `exec:COMMAND`, a function `act(observation)`, or a class with `act`."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Score:
    """How a bot did in some pairs; `str` says it, for the message of an assertion, and why its turns failed."""

    wins: int
    draws: int
    losses: int
    score: float
    """Points per match: 1 for a win, 0.5 for a draw."""
    interval: tuple[float, float]
    """In which the true score lies with 95% certainty; computed over pairs."""
    faults: Faults
    """What went wrong in the bot's own turns: its units stayed."""
    opponent_faults: Faults
    endings: dict[str, int]
    """Matches by how they ended: capture, elimination, tick_limit."""
    ticks: int
    """Of all matches."""

    @property
    def n_faults(self) -> int:
        """Turns in which the bot raised, or did not answer with one action per unit."""
        return self.faults.raised + self.faults.illegal

    def __repr__(self) -> str:
        low, high = self.interval
        counts = f"{self.wins} wins, {self.draws} draws, {self.losses} losses, {self.n_faults} failed turns"
        return f"{counts}: score {self.score:.3f} ({low:.3f} to {high:.3f})"

    def __str__(self) -> str:
        reasons = [f"{first} ({count} times)" for first, count in self.faults.reasons.values()]
        return "\n".join([repr(self), *reasons, *([self.faults.first_traceback] if self.faults.first_traceback else [])])


def play_pairs(bot: Fighter, opponent: Fighter, pairs: int = 20, *, rules: str | Ruleset = "paper", seed: int = 0) -> Score:
    """Play a bot against another in this process, and count from the bot's side.

    Parameters
    ----------
    bot, opponent
        A fighter's name as in `arena policies`, a bot file, `exec:COMMAND`, a function `act(observation)`, or a class with `act`.
    pairs
        Maps; each is played twice, with the sides swapped.
    rules
        A shipped ruleset by name, a TOML file, or a ruleset.
    seed
        Decides the maps and all chance: the same seed gives the same matches, and the same maps to every bot.

    Raises
    ------
    InputError
        There is no such fighter, or no such ruleset.

    Examples
    --------
    >>> def act(observation):
    ...     return [0 for _ in observation.units]
    >>> score = play_pairs(act, "rush", pairs=2)
    >>> assert score.n_faults == 0, str(score)
    >>> assert score.score < 0.5, str(score)
    """
    fighters = {_MINE: _find(bot), _OTHER: _find(opponent)}
    ruleset = load_ruleset(rules) if isinstance(rules, str) else rules
    plans = plan_fixture("test", _MINE, _OTHER, pairs, secret_from_seed(seed))
    counted = tally(_MINE, _OTHER, play(ruleset, plans, fighters.__getitem__, n_workers=1))
    return Score(
        wins=counted.wins,
        draws=counted.draws,
        losses=counted.losses,
        score=counted.score,
        interval=(counted.score_low, counted.score_high),
        faults=counted.faults[_MINE],
        opponent_faults=counted.faults[_OTHER],
        endings=counted.endings,
        ticks=counted.ticks,
    )


def _find(fighter: Fighter) -> BatchFactory:
    return load(str(fighter)) if isinstance(fighter, str | Path) else make_factory(getattr(fighter, "__name__", "given"), fighter)
