"""Show a bot again exactly what it saw in a match: stop inside it at a tick, and find where its orders first differ."""

import bdb
import pdb
import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.annotations import Annotations, read_annotations
from arena.bot_calls import stacks
from arena.console import say, say_lines
from arena.display.drawings import write_drawings
from arena.display.words import name_order, name_unit
from arena.errors import ArenaError, InputError
from arena.policy import BatchPolicy, Faults, MatchInfo, explain_refusal, read_actions
from arena.records.journal import Mark
from policies.bot_file import batch_policy, load_bot
from policies.each_seat import MakeBot, describe_error
from policies.program import PREFIX
from policies.registry import load
from tournaments.authoring.recorded_seat import RecordedSeat, Turn

_ONE_SEAT = np.zeros(1, np.intp)
_OURS = {__file__, bdb.__file__, pdb.__file__}
stacks.OURS.add(__file__)
_MOST_COLUMNS = 120
"""Of drawings side by side."""
_CUT_SHORT = ", and what came after is not recorded"


class Answer(NamedTuple):
    """What a fighter gave for a turn."""

    orders: NDArray[np.int8] | None
    """Shape (units,); None if they cannot be read."""
    why: str = ""
    """Why not."""


class _Fighter:
    """Any fighter, as a batch of one seat."""

    def __init__(self, spec: str, seat: RecordedSeat) -> None:
        self._policy: BatchPolicy = load(spec)(seat.ruleset, seat.team, 1)
        self._policy.keeps_annotations = self._policy.explains = True
        self._orders = np.zeros((1, len(seat.ruleset.team(seat.team))), np.int8)
        self._policy.start(_ONE_SEAT)

    def answer(self, turn: Turn, debugger: "_Debugger | None" = None) -> Answer:
        """Return its orders; with a debugger, which cannot enter it, say what it notes."""
        self._orders[:] = 0
        self._policy.act(turn.seen, self._orders)
        side = self._policy.ruleset.side
        notes = read_annotations(self._policy.take_annotations(0), side)
        if debugger is not None:
            told = [*(f"log: {line}" for line in notes["log"]), *write_drawings(notes["draw"], side, _MOST_COLUMNS)]
            say(*told or [f"tick {turn.tick}: it notes nothing"])
        faults: Faults = self._policy.take_faults(0)
        if (self._orders[0] < 0).any():
            return Answer(None, next((first for first, _ in faults.reasons.values()), "it gave no orders"))
        return Answer(self._orders[0].copy())


class _PythonBot:
    """A bot file, in this process, whose errors are raised."""

    def __init__(self, make: MakeBot, seat: RecordedSeat) -> None:
        self._seat = seat
        self._bot: Any = make()
        if hasattr(self._bot, "start"):
            self._bot.start(MatchInfo(ruleset=seat.ruleset, team=seat.team))

    def answer(self, turn: Turn, debugger: "_Debugger | None" = None) -> Answer:
        """Return its orders; with a debugger, stop at the first line of its `act`, and say afterwards what it logged."""
        annotations = None if debugger is None else Annotations(self._seat.ruleset.side)
        observation = turn.seen.seat(0, self._seat.ruleset, annotations)
        act, n_units = self._bot.act, len(observation.units)
        given = act(observation) if debugger is None else debugger.runcall(act, observation)
        if annotations is not None:
            say(*(f"log: {line}" for line in annotations.to_dict()["log"]))
        orders = read_actions(given, n_units)
        return Answer(orders) if orders is not None else Answer(None, f"tick {turn.tick}: {explain_refusal(given, n_units)[1]}")


def debug(seat: RecordedSeat, spec: str, tick: int | None) -> bool:
    """Show a bot what a seat saw, from tick 0 on; say where its orders first differ from those that were played.

    Parameters
    ----------
    spec
        The bot, as `policies.registry.load` takes it.
    tick
        Stop here inside its `act`, in Python's debugger, or where it raises before; of a fighter that is no bot file, say what it
        notes here. None stops nowhere, and ends at the first difference.

    Returns
    -------
    bool
        Whether its orders differ, or cannot be read where those that were played could.

    Raises
    ------
    InputError
        There is no such tick.
    """
    is_bot_file = spec.endswith(".py") and not spec.startswith(PREFIX)
    if tick is not None and not 0 <= tick < seat.n_turns:
        there = f"ticks 0 to {seat.n_turns - 1}" if seat.n_turns else "no ticks"
        raise InputError(f"--tick is {tick}; the seat was asked for orders at {there}{'' if seat.is_whole else _CUT_SHORT}")
    say(f"{seat.title}: {seat.n_turns} ticks{'' if seat.is_whole else _CUT_SHORT}")
    with _interrupts_as_before():
        try:
            make = load_bot(spec) if is_bot_file else None
            fighter = _Fighter(spec, seat) if make is None or batch_policy(make) else _PythonBot(make, seat)
        except ArenaError:
            raise
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - an author's code may raise anything
            say(f"before tick 0: {describe_error(error, -1)[1]}")
            if tick is not None:
                _examine(error)
            return True
        return _play_again(seat, fighter, tick)


def _play_again(seat: RecordedSeat, fighter: "_PythonBot | _Fighter", tick: int | None) -> bool:
    difference, n_late, has_failed = "", 0, False
    for turn in seat.turns:
        debugger = _Debugger() if turn.tick == tick else None
        try:
            answer = fighter.answer(turn, debugger)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - as above
            answer = Answer(None, describe_error(error, turn.tick)[1])
            if tick is not None and turn.tick <= tick:
                say(answer.why)
                _examine(error)
                return True
        if debugger is not None and debugger.has_quit:
            break
        n_late += Mark.LATE in turn.mark
        found = _compare(seat, turn, answer)
        if found and not difference:
            difference = found
            say(difference)
        elif not found and answer.orders is None and not has_failed:
            has_failed = True
            say(f"{answer.why}; so it was in the match")
        if difference and (tick is None or turn.tick >= tick):
            break
    else:
        late = f"; {n_late} came too late to count" if n_late else ""
        if not difference:
            say(f"its orders are those that were played, at all {seat.n_turns} ticks{late}")
    return bool(difference)


def _compare(seat: RecordedSeat, turn: Turn, answer: Answer) -> str:
    """Return in what an answer differs from what was played; nothing where it does not, or where that is not known."""
    if Mark.LATE in turn.mark or (Mark.UNREADABLE in turn.mark and answer.orders is None):
        return ""
    units = [unit for unit in turn.seen.seat(0, seat.ruleset).units if unit.alive]
    if answer.orders is None:
        return f"{answer.why}; it was {', '.join(f'{name_unit(unit)} {name_order(turn.played[unit.index])}' for unit in units)}"
    given = {unit: (name_order(int(answer.orders[unit.index])), name_order(turn.played[unit.index])) for unit in units}
    if Mark.UNREADABLE in turn.mark:
        told = ", ".join(f"{name_unit(unit)} {new}" for unit, (new, _) in given.items())
        return f"tick {turn.tick}: {told}; in the match its answer could not be read, and all stayed"
    changed = [f"{name_unit(unit)} {new}, it was {old}" for unit, (new, old) in given.items() if new != old]
    return f"tick {turn.tick}: {'; '.join(changed)}" if changed else ""


def _examine(error: BaseException) -> None:
    """Show where a bot raised, and let its author look around there."""
    frames = error.__traceback__
    while frames is not None and frames.tb_next is not None and frames.tb_frame.f_code.co_filename in _OURS:
        frames = frames.tb_next
    say_lines("".join(traceback.format_exception(type(error), error, frames)))
    pdb.post_mortem(frames)


@contextmanager
def _interrupts_as_before() -> Iterator[None]:
    """Put back the handler of Ctrl-C, which the debugger replaces."""
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class _Debugger(pdb.Pdb):
    """Python's own debugger, which remembers that somebody wants no more."""

    has_quit = False

    def __init__(self) -> None:
        super().__init__()
        self.cmdqueue.append("list")  # so that the first that is seen is the code

    def set_quit(self) -> None:
        """Leave."""
        self.has_quit = True
        super().set_quit()
