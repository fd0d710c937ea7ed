"""The fighter's side: load it, and answer for its seats, one message after another.

What it prints goes to stderr; the pipes of the messages are moved out of its way first.
"""

import faulthandler
import os
import sys
from typing import IO, Any

import numpy as np

from arena.bot_calls.marked_output import mark_prints
from arena.bot_calls.stacks import SIGNAL
from arena.errors import ArenaError
from arena.game.ruleset import Ruleset, read_rules
from arena.game.types import Team
from arena.policy import BatchFactory, MatchResult
from arena.protocol.observation_codec import ObservationReader
from policies.precompile import precompile
from policies.registry import load
from policies.workers.frames import pack, read_frame

_FIRST = np.zeros(1, np.intp)


class _Seat:
    """A policy for one seat of one match."""

    def __init__(
        self,
        make: BatchFactory,
        ruleset: Ruleset,
        team: Team,
        match: str,
        *,
        turn_time_s: float | None,
        keeps: bool,
        explains: bool,
    ) -> None:
        self._policy = make(ruleset, team, 1)
        self._policy.name_match(0, match)
        if turn_time_s is not None:
            self._policy.set_turn_time(turn_time_s)
        self._policy.keeps_annotations, self._policy.explains = keeps, explains
        self._reader = ObservationReader(ruleset, team)
        self._orders = np.zeros((1, len(ruleset.team(team))), np.int8)
        self._policy.start(_FIRST)

    def act(self, data: bytes) -> bytes:
        self._orders[:] = 0
        self._policy.act(self._reader.read(data), self._orders)
        return self._orders.tobytes()

    def end(self, result: MatchResult) -> None:
        self._policy.end(0, result)

    def notes(self) -> list[Any]:
        """Return what an answer holds beside the orders."""
        faults = self._policy.take_faults(0)
        return [
            [faults.raised, faults.illegal, faults.first_traceback, faults.reasons],
            self._policy.take_annotations(0),
        ]


def main() -> None:
    """Take the name of a fighter as `policies.registry` knows it."""
    inbox, outbox = _move_pipes()
    faulthandler.register(SIGNAL, all_threads=False)
    mark_prints()
    try:
        make = load(sys.argv[1])
        precompile(make)
    except MemoryError:
        outbox.write(pack(["failed", "it takes more memory than its limits leave"]))
        return
    except Exception as error:  # noqa: BLE001 - a stranger's code may raise anything
        words = " ".join(str(error).split())
        outbox.write(pack(["failed", words if isinstance(error, ArenaError) else f"{type(error).__name__}: {words}"]))
        return
    outbox.write(pack(["loaded"]))
    seats: dict[int, _Seat] = {}
    while (message := read_frame(inbox)) is not None:
        match message:
            case ["start", seat, rules, team, name, turn_time_s, keeps, explains]:
                options = {"turn_time_s": turn_time_s, "keeps": keeps, "explains": explains}
                seats[seat] = _Seat(make, read_rules(rules), Team(team), name, **options)
                outbox.write(pack([seat, b"", *seats[seat].notes()]))
            case ["act", seat, data]:
                orders = seats[seat].act(data)
                outbox.write(pack([seat, orders, *seats[seat].notes()]))
            case ["end", seat, result]:
                seats.pop(seat).end(MatchResult.from_dict(result))


def _move_pipes() -> tuple[IO[bytes], IO[bytes]]:
    """Return stdin and stdout under other numbers; theirs stand for nothing, and for stderr."""
    inbox, outbox = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb", buffering=0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return inbox, outbox


if __name__ == "__main__":
    main()
