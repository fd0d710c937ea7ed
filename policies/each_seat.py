"""Play a bot, which thinks about one seat at a time, wherever a `BatchPolicy` is wanted."""

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import arena.policy
from arena.annotations import Annotations
from arena.bot_calls import current, stacks
from arena.bot_calls.current import END, START, Place
from arena.game.observation import Observation, Observations
from arena.game.ruleset import Ruleset
from arena.game.types import Action, Team
from arena.policy import Act, BatchPolicy, Faults, MatchInfo, MatchResult, Orders, explain_refusal, read_actions

MakeBot = Callable[[], Any]
"""Makes a bot for one seat of one match: anything with `act`, and if it likes `start` and `end`."""
UNREADABLE = -1
"""Written into all orders of a seat that gave none: its units stay, and the referee counts it."""
stacks.OURS |= {__file__, arena.policy.__file__}
_MOST_FRAMES, _MOST_LETTERS, _MOST_WORDS_LETTERS = 20, 4000, 200


class BotError(Exception):
    """What went wrong with a bot whose author has nothing of Python's to read: its sentence stands alone, without a traceback."""


class EachSeat(BatchPolicy):
    """One bot per seat and match. What a bot raises, or gives instead of orders, costs its own seat alone.

    All but Ctrl-C counts as raising, `sys.exit` too: a bot may end its own thinking, not the match.
    """

    def __init__(self, ruleset: Ruleset, team: Team, n_seats: int, *, make: MakeBot) -> None:
        super().__init__(ruleset, team, n_seats)
        self._make = make
        self._bots: list[Any] = [None] * n_seats
        self._faults = [Faults() for _ in range(n_seats)]
        self._is_started = np.zeros(n_seats, np.bool_)
        self._is_over = np.zeros(n_seats, np.bool_)
        self._annotations = [b""] * n_seats
        self._places = [Place("", team)] * n_seats

    def name_match(self, seat: int, match: str) -> None:
        """Hear what the match of `seat` is called."""
        self._places[seat] = Place(match, self.team)

    def start(self, seats: NDArray[np.intp]) -> None:
        """Make a fresh bot for each of `seats`, and start its match."""
        for seat in np.arange(self.n_seats)[seats].tolist():
            self._is_started[seat], self._is_over[seat] = True, False
            self._faults[seat] = Faults()
            self._bots[seat] = self._call(seat, self._make)
            self._notify(seat, "start", MatchInfo(ruleset=self.ruleset, team=self.team), START)

    def act(self, observations: Observations, orders: Orders) -> None:
        """Ask each bot; a seat without a readable answer gets UNREADABLE, and one whose match has ended is not asked."""
        self.start(np.flatnonzero(~self._is_started & ~self._is_over))
        for seat in range(len(observations)):
            if self._is_over[seat]:
                orders[seat] = Action.STAY
                continue
            annotations = Annotations(self.ruleset.side) if self.keeps_annotations else None
            observation = observations.seat(seat, self.ruleset, annotations)
            actions = self._call(seat, self._actions, seat, observation, orders.shape[1], tick=observation.tick)
            orders[seat] = UNREADABLE if actions is None else actions
            if annotations is not None:
                self._annotations[seat] = annotations.pack()

    def end(self, seat: int, result: MatchResult) -> None:
        """End the match of the bot of `seat`, and drop the bot."""
        self._notify(seat, "end", result, END)
        self._bots[seat] = None
        self._is_started[seat], self._is_over[seat] = False, True

    def take_faults(self, seat: int) -> Faults:
        """Return what went wrong on `seat` since its match began, and forget it."""
        faults, self._faults[seat] = self._faults[seat], Faults()
        return faults

    def take_annotations(self, seat: int) -> bytes:
        """Return what the bot of `seat` noted in the last `act`, and forget it."""
        taken, self._annotations[seat] = self._annotations[seat], b""
        return taken

    def _actions(self, seat: int, observation: Observation, n_units: int) -> NDArray[np.int8] | None:
        bot = self._bots[seat]
        if bot is None:  # its constructor raised, which was shown then
            self._faults[seat].raised += 1
            return None
        answer = bot.act(observation)
        actions = read_actions(answer, n_units)
        if actions is None:
            note_refusal(self._faults[seat], answer, n_units, observation.tick)
        return actions

    def _notify(self, seat: int, event: str, message: MatchInfo | MatchResult, tick: int) -> None:
        if hasattr(self._bots[seat], event):
            self._call(seat, getattr(self._bots[seat], event), message, tick=tick)

    def _call(self, seat: int, method: Callable[..., Any], *arguments: Any, tick: int = START) -> Any:
        """Return what a method of a bot returns, or None with the fault noted."""
        return call_bot(self._places[seat], [(self._faults[seat], tick)], method, *arguments)


def note_refusal(faults: Faults, answer: Any, n_units: int, tick: int) -> None:
    """Note why an answer is no orders."""
    kind, why = explain_refusal(answer, n_units)
    faults.illegal += 1
    faults.note(kind, f"tick {tick}: {why}; all its units stay")


def call_bot(place: Place, faults: Sequence[tuple[Faults, int]], method: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a method of a bot returns, or None with the fault noted.

    Parameters
    ----------
    place
        Of the first seat that is meant.
    faults
        Those of each seat that is meant, and at which tick it is.
    """
    current.begin(place, faults[0][1] if faults else START)
    try:
        return method(*arguments)
    except KeyboardInterrupt as error:
        stacks.add_stack(error)
        raise
    except BaseException as error:  # noqa: BLE001 - a stranger's code may raise anything
        for one, tick in faults:
            one.raised += 1
            one.note(*describe_error(error, tick))
            if one.first_traceback is None:
                one.first_traceback = _bots_own(error)
        return None
    finally:
        current.end()


class WithoutMemory:
    """A plain function as a bot."""

    def __init__(self, act: Act) -> None:
        self.act = act


@dataclass(frozen=True, slots=True)
class EachSeatFactory:
    """The `BatchFactory` of a bot."""

    make: MakeBot
    most_seats: int = 32
    """A bot may be large and slow: this many at once, so that the first matches end soon."""

    def __call__(self, ruleset: Ruleset, team: Team, n_seats: int) -> BatchPolicy:
        """Return the bots of some seats."""
        return EachSeat(ruleset, team, n_seats, make=self.make)


def describe_error(error: BaseException, tick: int) -> tuple[str, str]:
    """Return what kind of mistake an exception is, by the line of the bot that raised it, and a sentence that tells it."""
    when = f"tick {tick}: " if tick >= 0 else ""
    if isinstance(error, BotError):
        return type(error).__name__, f"{when}{error}; all its units stay"
    what = " ".join(traceback.format_exception_only(error)[-1].split())[:_MOST_WORDS_LETTERS]
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename not in stacks.OURS]
    where = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}{where}", f"{when}{what}{where}; all its units stay"


def _bots_own(error: BaseException) -> str:
    """Return the traceback of an error from the first frame that is not ours; no error's text is too long for a journal."""
    if isinstance(error, BotError):
        return str(error)
    frames = error.__traceback__
    while frames is not None and frames.tb_frame.f_code.co_filename in stacks.OURS:
        frames = frames.tb_next
    text = "".join(traceback.format_exception(type(error), error, frames, limit=-_MOST_FRAMES))
    return text if len(text) <= _MOST_LETTERS else text[: _MOST_LETTERS // 2] + "\n...\n" + text[-_MOST_LETTERS // 2 :]
