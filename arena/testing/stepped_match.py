"""A match that is stepped by hand: on a drawn board, or on one that the rules draw."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arena.game.board import format_board
from arena.game.drawn_board import rules_on_board
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys, derive_map_key, derive_match_key, secret_from_seed
from arena.game.observation import Observation, OwnUnit
from arena.game.philox import Purpose
from arena.game.ruleset import Ruleset, load
from arena.game.types import Action, Team, Termination
from arena.policy import MatchInfo, MatchResult, explain_refusal, read_actions
from arena.records.replay import match_result

_IDENTITY = "stepped"
_MOST_LUCKS = 10_000
Bot = Any
"""A function `act(observation)`, a class with `act`, or an object of such a class."""


class SteppedMatch:
    """A match whose orders are given tick by tick, by the real engine.

    Parameters
    ----------
    rules
        A shipped ruleset by name, a TOML file, or a ruleset.
    seed
        Decides all chance: the board, where the rules draw it, who wins a contested cell, who falls, the observations' seeds.
        The same seed and orders give the same match.

    Examples
    --------
    >>> match = SteppedMatch("paper", seed=3)
    >>> match.step(blue=[1, 1, 1, 1, 0, 0])
    >>> match.tick
    1
    """

    def __init__(self, rules: str | Ruleset = "paper", *, seed: int = 0) -> None:
        self.ruleset = load(rules) if isinstance(rules, str) else rules
        self._games = BatchedGame(self.ruleset, 1)
        secret = secret_from_seed(seed)
        keys = MatchKeys(map_key=derive_map_key(secret, _IDENTITY, 0), match_key=derive_match_key(secret, _IDENTITY))
        self._games.start([0], [keys])

    @property
    def tick(self) -> int:
        """Ticks played so far."""
        return match_result(self._games, 0).ticks

    @property
    def ending(self) -> Termination:
        """How the match ended; `Termination.RUNNING` while it goes on."""
        return match_result(self._games, 0).ending

    @property
    def is_over(self) -> bool:
        """Whether the match has ended."""
        return self._games.has_ended(0)

    @property
    def result(self) -> MatchResult | None:
        """How the match ended, with blue's score; None while it goes on."""
        return match_result(self._games, 0) if self.is_over else None

    def score(self, team: Team) -> int:
        """Return a team's score, in -100 .. 100."""
        return match_result(self._games, 0).seen_by(team).score

    def observe(self, team: Team) -> Observation:
        """Return what a team is shown now, as its bot would be."""
        return self._games.observe()[team].seat(0, self.ruleset)

    def units(self, team: Team) -> tuple[OwnUnit, ...]:
        """Return a team's units as they truly are, the fallen ones where they fell."""
        return self.observe(team).units

    def text(self, team: Team | None = None) -> str:
        """Return the board as text, as it truly is; for a `team`, as that one sees it, with `?` where it sees nothing."""
        return format_board(self._games.truth(0) if team is None else self.observe(team).grid)

    def step(
        self,
        blue: Sequence[int] | None = None,
        red: Sequence[int] | None = None,
        *,
        falls: Mapping[Team, Collection[int]] | None = None,
    ) -> None:
        """Play one tick.

        Parameters
        ----------
        blue, red
            One action for each of a team's units, in the order of `units`; without them, all of that team stay.
        falls
            Who is to fall in this tick, by the units' indices: `{Team.RED: [0]}` for red's first unit and nobody else, `{}` for
            nobody. Of all the luck that units may have in their fights, one that brings it is taken. Without it the seed decides.

        Raises
        ------
        ValueError
            The match is over, orders are not one action per unit, or no luck lets exactly these units fall.

        Examples
        --------
        >>> match = DrawnMatch('''
        ...     F..f
        ...     ..Uu
        ...     ....
        ...     ....
        ... ''')
        >>> match.step(falls={Team.RED: [0]})
        >>> match.result.describe()
        'blue wins by elimination after 1 ticks, score +100 for blue'
        """
        if self.is_over:
            raise ValueError(f"the match ended by {self.ending.name.lower()} after {self.tick} ticks; there is no step more")
        orders = np.concatenate([self._orders(Team.BLUE, blue), self._orders(Team.RED, red)])[None]
        if falls is None:
            self._games.step(orders)
        else:
            self._step_until(orders, falls)

    def play(self, blue: Bot | None = None, red: Bot | None = None, *, ticks: int | None = None) -> MatchResult | None:
        """Let bots play to the end, or for some ticks; return `result`.

        What a bot raises is raised here. An answer that is not one action per unit raises `ValueError`, where a pit would let the
        units stay.

        Parameters
        ----------
        blue, red
            A function `act(observation)`, a class with `act`, of which one is made and started, or an object of such a class,
            which is taken as it is; without it, all units stay.

        Examples
        --------
        >>> def east(observation):
        ...     return [2 for _ in observation.units]
        >>> match = DrawnMatch('''
        ...     FU.f
        ...     ....
        ...     ....
        ...     ...u
        ... ''')
        >>> match.play(blue=east).describe()
        'blue wins by capture after 2 ticks, score +100 for blue'
        """
        players = (Team.BLUE, blue), (Team.RED, red)
        bots = {team: make_bot(bot, self.ruleset, team) for team, bot in players if bot is not None}
        last = self.ruleset.tick_limit if ticks is None else self.tick + ticks
        while not self.is_over and self.tick < last:
            given = {team: bot.act(self.observe(team)) for team, bot in bots.items()}
            self.step(given.get(Team.BLUE), given.get(Team.RED))
        result = self.result
        if result is not None:
            for team, bot in bots.items():
                if hasattr(bot, "end"):
                    bot.end(result.seen_by(team))
        return result

    def _orders(self, team: Team, given: Sequence[int] | None) -> NDArray[np.int8]:
        n_units = self._games.n_units[team]
        if given is None:
            return np.full(n_units, Action.STAY, np.int8)
        orders = read_actions(given, n_units)
        if orders is None:
            raise ValueError(f"tick {self.tick}, {team.name.lower()}: {explain_refusal(given, n_units)[1]}")
        return orders

    def _step_until(self, orders: NDArray[np.int8], falls: Mapping[Team, Collection[int]]) -> None:
        """Play the tick with one luck after another, until those fall who are to."""
        state, first_red = self._games.state, self._games.n_units[Team.BLUE]
        arrays: Sequence[NDArray[Any]] = state
        before, fight_keys = [array.copy() for array in arrays], state.key[0, Purpose.FIGHT]
        key, lucks = fight_keys.copy(), np.random.default_rng(0)
        alive = state.alive[0].copy()
        for team, units in falls.items():
            for unit in units:
                if not (0 <= unit < self._games.n_units[team] and alive[unit + first_red * team]):
                    raise ValueError(f"tick {self.tick}: {team.name.lower()} has no living unit {unit}, so it cannot fall")
                alive[unit + first_red * team] = False
        wanted = alive.tobytes()
        for _ in range(_MOST_LUCKS):
            self._games.step(orders)
            if state.alive[0].tobytes() == wanted:
                fight_keys[:] = key
                return
            for array, old in zip(arrays, before, strict=True):
                array[:] = old
            fight_keys[:] = lucks.integers(0, 2**32, key.shape, dtype=np.uint32)
        fight_keys[:] = key
        names = [f"{team.name.lower()} {unit}" for team, units in sorted(falls.items()) for unit in sorted(units)]
        raise ValueError(f"tick {self.tick}: no luck of {_MOST_LUCKS:,} lets exactly {', '.join(names) or 'nobody'} fall")


class DrawnMatch(SteppedMatch):
    """A match on a drawn board.

    Parameters
    ----------
    board
        Letters, one a cell: `F U A` blue's flag, UGVs and UAVs, `f u a` red's, `#` an obstacle, `.` land; blue's half is the left
        one. Indentation and empty lines mean nothing. The board sets the side and the number of units.
    changes
        Rules to change: `tick_limit=10`, `random_combat=False`, `units={"ugv": {"sight": 5}}`.

    Raises
    ------
    BoardError
        The board cannot be played on.

    Examples
    --------
    >>> match = DrawnMatch('''
    ...     F...
    ...     U#.f
    ...     .u..
    ...     ....
    ... ''', random_combat=False)
    >>> match.step(blue=[3], red=[0])
    >>> print(match.text())
    F...
    .#.f
    U...
    ....
    >>> match.score(Team.BLUE), match.ending.name
    (100, 'ELIMINATION')
    """

    def __init__(self, board: str, rules: str | Ruleset = "paper", *, seed: int = 0, **changes: Any) -> None:
        super().__init__(rules_on_board(board, rules, **changes), seed=seed)


def make_bot(bot: Bot, ruleset: Ruleset, team: Team) -> Any:
    """Return what is asked to act in one match: of a class a new object, started."""
    if not isinstance(bot, type):
        return bot if hasattr(bot, "act") else _Function(bot)
    made = bot()
    if hasattr(made, "start"):
        made.start(MatchInfo(ruleset=ruleset, team=team))
    return made


class _Function:
    """A plain function as a bot."""

    def __init__(self, act: Any) -> None:
        self.act = act
