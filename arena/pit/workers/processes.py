"""The processes of a pit's workers: started, told, listened to, and replaced when they end.

One whose machine is lost is replaced on another, if there is one that answers, and again on its own once that does; its matches
go with it.
"""

import json
import logging
import multiprocessing
import threading
import time
from collections.abc import Callable, Sequence
from ctypes import c_longlong
from dataclasses import replace
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any

from arena.errors import ArenaError, InputError
from arena.pit.events import Event, WorkerLost, WorkerReady, WorkerSaid
from arena.pit.workers.journal_copies import JournalCopies, read_left
from arena.pit.workers.lost_machines import LostMachines
from arena.pit.workers.machines import HERE, FarProcess, Machine, hear_first
from arena.pit.workers.messages import Failed, Order, Shut, StopWork, TakeMatch, WorkerSettings, Written
from arena.pit.workers.worker import NOBODY, describe_version, work

logger = logging.getLogger(__name__)

MOST_STILLBORN = 3
"""Processes in a row that end before they take matches; after one more, the pit ends."""
HUNG_S = 10.0
"""A worker tells of itself every second; one that says nothing for so long is replaced."""
STOP_S = 5.0
"""How long workers may take to leave their matches."""
_FIRST_REST_S, _MOST_REST_S = 0.5, 16.0
"""Before a worker that died young twice in a row, or more often, is replaced."""
_YOUNG_S = 10.0


class _Place:
    """A place for one worker after another."""

    def __init__(self, settings: WorkerSettings, home: Machine) -> None:
        self.settings, self.home, self.machine = settings, home, home
        self.process: Any = None
        self.copies: JournalCopies | None = None
        """Of the journals that it writes, if it is on another machine."""
        self.mark: c_longlong
        self.orders: SimpleQueue[Order | None] = SimpleQueue()
        self.successor: FarProcess | None = None
        """On its own machine, which was lost: it has said its version, and waits until it is used."""
        self.is_ready, self.is_gone, self.is_called = False, True, False
        self.n_young_deaths = self.n_stillborn = 0
        self.started_at_s = self.heard_at_s = self.start_at_s = 0.0


class WorkerProcesses:
    """Workers, each in a process that `spawn` starts; their keys and secrets go through its pipe alone.

    Parameters
    ----------
    settings
        Of each worker.
    hand_over
        Takes what makes an event, for the thread of the pit; called from others. It raises `ArenaError` there if the pit cannot
        go on.
    target
        What a worker of this machine does.
    machines
        Where each of them is to run; all of them here without it.
    """

    def __init__(
        self,
        settings: list[WorkerSettings],
        hand_over: Callable[[Callable[[], Event]], None],
        target: Callable[[Connection, c_longlong], None] = work,
        machines: Sequence[Machine] = (),
    ) -> None:
        self._hand_over, self._target = hand_over, target
        self._context = multiprocessing.get_context("spawn")
        homes = machines or [HERE] * len(settings)
        self._places = {one.number: _Place(one, home) for one, home in zip(settings, homes, strict=True)}
        self._machines = LostMachines(homes, is_right)
        self._has_opened, self._is_stopping = False, False
        self._looked_at_s = time.monotonic()

    def start(self) -> None:
        """Start all of them; each tells by an event that it is ready."""
        for place in self._places.values():
            self._start(place)

    def tell(self, worker: int, order: Order) -> None:
        """Tell a worker something; nobody waits for it to listen."""
        place = self._places[worker]
        if isinstance(order, TakeMatch) and order.is_resumed and place.copies is not None:
            order = replace(order, left=read_left(order, place.settings.journals))
        place.orders.put(order)
        self._is_stopping |= isinstance(order, StopWork)

    def look(self) -> None:
        """Replace workers that have ended, and end those that hang, or whose own machine answers again.

        To be called by the thread that called `start`.

        Raises
        ------
        ArenaError
            A worker does not come as far as taking matches, however often it is started.
        """
        now_s = time.monotonic()
        slept_s, self._looked_at_s = now_s - self._looked_at_s, now_s
        if not self._is_stopping:
            self._machines.ask()
        for number, place in self._places.items():
            if slept_s > 1.0:
                place.heard_at_s = now_s  # this process was stopped itself
            if place.is_gone and not self._is_stopping:
                if place.n_stillborn > MOST_STILLBORN and not (self._has_opened and place.home.host):
                    raise describe_stillborn(place.machine, number, place.n_stillborn)
                if now_s >= place.start_at_s:
                    self._start_again(place)
            elif place.is_ready and now_s - place.heard_at_s > HUNG_S:
                logger.warning("worker %d has said nothing for %g s; it is replaced", number, HUNG_S)
                place.heard_at_s = now_s
                place.process.kill()
            elif place.is_ready and not self._is_stopping:
                self._see_home(place)

    def _see_home(self, place: _Place) -> None:
        """Have a worker return to its own machine, once that answers again: when another is ready there to take its place."""
        is_away = place.machine != place.home
        if place.successor is not None and is_away:
            place.process.kill()
        elif place.successor is not None:
            place.successor.kill()
            place.successor = None
        elif is_away and not place.is_called and place.home in self._machines.answering:
            place.is_called = True
            name = f"caller of worker {place.settings.number}"
            threading.Thread(target=self._call_home, args=(place,), name=name, daemon=True).start()

    def _call_home(self, place: _Place) -> None:
        try:
            successor = FarProcess(place.home, place.settings.endpoint)
        except InputError:  # no process can be started here
            self._machines.note_lost(place.home)
        else:
            said = hear_first(successor.pipe)
            if said and not self._is_stopping and is_right(place.home, said):
                logger.warning("worker %d returns to %s", place.settings.number, place.home)
                place.successor = successor
            else:
                successor.kill()
                successor.join()
                self._machines.note_lost(place.home)
        place.is_called = False

    @property
    def has_ended(self) -> bool:
        """Whether no worker is left."""
        return all(place.is_gone for place in self._places.values())

    def close(self) -> None:
        """End all of them."""
        self._is_stopping = True
        for place in self._places.values():
            for process in (place.process, place.successor):
                if process is not None:
                    process.kill()
                    process.join()

    def _start_again(self, place: _Place) -> None:
        """Start the next worker of a place; what fails for now, as for want of memory or files, is tried again."""
        try:
            self._start(place)
        except (OSError, InputError) as error:
            said = error.strerror if isinstance(error, OSError) else error
            logger.warning("worker %d cannot be started for now: %s", place.settings.number, said)
            self._note_end(place, is_cut_off=False)

    def _start(self, place: _Place) -> None:
        number = place.settings.number
        place.mark = self._context.RawValue(c_longlong, NOBODY)
        place.orders = SimpleQueue()
        place.is_gone = place.is_ready = False
        place.started_at_s = time.monotonic()
        successor, place.successor = place.successor, None
        place.machine = self._choose_machine(place) if successor is None else place.home
        settings = place.settings
        if place.machine.host:
            place.process = afar = successor or FarProcess(place.machine, settings.endpoint)
            place.copies = JournalCopies(settings.journals, fsync=settings.fsync)
            pipe, settings = afar.pipe, replace(settings, endpoint=afar.endpoint)
        else:
            place.copies = None
            pipe, theirs = self._context.Pipe()
            process = self._context.Process(target=self._target, args=(theirs, place.mark), name=f"worker {number}", daemon=True)
            process.start()
            place.process = process
            theirs.close()
        name = f"listener of worker {number}"
        said = describe_version() if successor is not None else b""
        threading.Thread(target=self._listen, args=(place, pipe, settings, said), name=name, daemon=True).start()

    def _choose_machine(self, place: _Place) -> Machine:
        """Return where the next worker of a place runs: at home, unless that was lost and another machine was not."""
        answering = self._machines.answering
        if place.home in answering:
            return place.home
        if answering:
            chosen = min(answering, key=[one.machine for one in self._places.values() if not one.is_gone].count)
        else:
            chosen = self._machines.longest_lost
            if chosen == place.home:
                return chosen
        logger.warning("worker %d goes on: it is started on %s for %s", place.settings.number, chosen, place.home)
        return chosen

    def _listen(self, place: _Place, pipe: Connection, settings: WorkerSettings, said: bytes) -> None:
        """Hand over all that a worker says, of which something may have been heard, and that it has ended."""
        number, orders = place.settings.number, place.orders
        try:
            said = said or hear_first(pipe)
            if said and said != describe_version():
                place.process.kill()
                sentence = describe_difference(number, said, place.machine)
                self._hand_over(lambda: _fail(sentence))
            elif said:
                pipe.send(settings)
                threading.Thread(target=_tell, args=(orders, pipe), name=f"teller of worker {number}", daemon=True).start()
                while True:
                    self._note(place, pipe.recv())
        except (EOFError, OSError):
            pass
        finally:
            orders.put(None)
            is_cut_off = isinstance(place.process, FarProcess) and place.process.is_cut_off
            place.process.kill()  # it may be within its last words
            place.process.join()
            if place.copies is not None:
                place.copies.close()
            self._note_end(place, is_cut_off=is_cut_off)

    def _note(self, place: _Place, report: Any) -> None:
        number, place.heard_at_s = place.settings.number, time.monotonic()
        if not place.is_ready:
            place.is_ready, place.n_stillborn = True, 0
            self._machines.note_answer(place.machine)
            self._has_opened = self._has_opened or all(one.is_ready for one in self._places.values())
            self._hand_over(lambda: WorkerReady(number))
        if isinstance(report, Failed):
            self._hand_over(lambda: _fail(report.reason))
        elif isinstance(report, Written):
            self._write(place, report)
        else:
            if isinstance(report, Shut) and place.copies is not None:
                place.copies.shut(report.match)
            self._hand_over(lambda: WorkerSaid(number, report))

    def _write(self, place: _Place, written: Written) -> None:
        assert place.copies is not None
        try:
            place.orders.put(place.copies.write(written))
        except ArenaError as error:
            reason = str(error)
            self._hand_over(lambda: _fail(reason))

    def _note_end(self, place: _Place, *, is_cut_off: bool) -> None:
        now_s, was_ready, is_returning = time.monotonic(), place.is_ready, place.successor is not None
        if is_cut_off and not self._is_stopping and not is_returning:
            logger.warning("%s is not reached", place.machine)
            self._machines.note_lost(place.machine)
        is_young = now_s - place.started_at_s < _YOUNG_S and not is_returning
        place.n_young_deaths = place.n_young_deaths + 1 if is_young else 0
        place.n_stillborn += not was_ready
        rest_s = min(_FIRST_REST_S * 2 ** (place.n_young_deaths - 2), _MOST_REST_S) if place.n_young_deaths > 1 else 0.0
        place.start_at_s = now_s + rest_s
        lane = None if place.mark.value == NOBODY else int(place.mark.value)
        if was_ready and not self._is_stopping:
            is_blameless = is_cut_off or is_returning
            self._hand_over(lambda: WorkerLost(place.settings.number, lane, is_cut_off=is_blameless))
        place.is_ready, place.is_gone = False, True


def _tell(orders: "SimpleQueue[Order | None]", pipe: Connection) -> None:
    while (order := orders.get()) is not None:
        try:
            pipe.send(order)
        except OSError:
            return  # it has ended


def is_right(machine: Machine, said: bytes) -> bool:
    """Return whether a worker that says this first is of this version; a sentence is logged if it is not."""
    if said != describe_version():
        logger.warning("%s", describe_difference(0, said, machine))
    return said == describe_version()


def _fail(reason: str) -> Event:
    raise ArenaError(reason)


def describe_stillborn(machine: Machine, number: int, n_deaths: int) -> ArenaError:
    """Return what ends a pit one of whose workers never comes as far as taking matches."""
    if not machine.host:
        return ArenaError(f"worker {number} died {n_deaths} times in a row before it took a match")
    command = f"ssh {machine.host} {machine.program} --version"
    return InputError(f"{machine} runs no worker, {n_deaths} times in a row; `{command}` must answer, and ask for no password")


def describe_difference(number: int, said: bytes, machine: Machine = HERE) -> str:
    """Return a sentence on a worker that is not of this version.

    Parameters
    ----------
    said
        What it said first.
    """
    ours = json.loads(describe_version())
    try:
        theirs = {name: json.loads(said)[name] for name in ours}
    except (ValueError, KeyError, TypeError):
        theirs = {}
    differing = ", ".join(f"{name} {theirs[name]} for {ours[name]}" for name in theirs if theirs[name] != ours[name])
    what = f": {differing}" if differing else ""
    if machine.host:
        return f"{machine} has an arena of another version{what}; install there what is here, and start arena serve again"
    return f"worker {number} is a worker of another version{what}; the arena was installed anew: start arena serve again"
