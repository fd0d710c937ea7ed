"""Orders that a seat did not give: whatever is put on its key, its own take effect and all else is counted.

Both seats are played here, so that it is known what was sent, and when the referee had it.
"""

import os
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from arena.game.types import Team
from arena.protocol import topics
from arena.protocol.codec import MOST_BYTES, encode
from arena.protocol.messages import Ended, Orders, Ready, Turn
from arena.protocol.sealing import Direction, Sealer, seat_context
from arena.records.journal import Journal
from arena.records.journal_folder import load_journal
from arena.records.replay import verify

Start = Callable[..., Any]
PATIENCE_S = 60.0
NAMES = [team.name.lower() for team in Team]
Seats = dict[Team, Any]
N_UNITS, N_TICKS = 6, 12
OPTIONS = ("--set", f"tick_limit={N_TICKS}", "--turn-time", 60)


def genuine(team: Team, tick: int) -> bytes:
    """Return what a seat orders; another thing in every tick, and for every unit."""
    return bytes((tick * (team + 2) + unit) % 5 for unit in range(N_UNITS))


def forged(team: Team, tick: int) -> bytes:
    """Return orders of which none is what the seat orders."""
    return bytes((action + 1) % 5 for action in genuine(team, tick))


def sit_down(strangers: Start, identities: dict[Team, Any] | None = None) -> Seats:
    """Begin a match of two strangers, and hear its first turn."""
    seats = {team: strangers(**({"identity": identities[team]} if identities else {})) for team in Team}
    with ThreadPoolExecutor() as pool:
        waiting = [pool.submit(seats[team].sit, name=f"the-{name}", team=name) for team, name in zip(Team, NAMES, strict=True)]
        for seat in waiting:
            seat.result(PATIENCE_S)
    for seat in seats.values():
        seat.say(Ready(known_ticks=0))
    hear(seats, 0)
    return seats


def hear(seats: Seats, tick: int) -> None:
    for seat in seats.values():
        while seat.next(Turn).tick != tick:
            pass


def order(seats: Seats, tick: int) -> dict[Team, bytes]:
    """Return each seat's orders, sealed and not sent."""
    return {team: seats[team].seal(Orders(tick=tick, actions=genuine(team, tick)), tick) for team in Team}


def give(seats: Seats, orders: dict[Team, bytes], tick: int) -> None:
    """Give the orders of a tick, and hear the next."""
    for team, data in orders.items():
        seats[team].put(data)
    if tick + 1 < N_TICKS:
        hear(seats, tick + 1)


class Forger:
    """Puts on a seat's key what the seat did not."""

    def __init__(self, session: Any, seats: Seats) -> None:
        self._session, self._seats = session, seats
        self.sent = {team: Counter[str]() for team in Team}
        """How often the referee is to count what, against whom."""

    def put(self, team: Team, data: bytes) -> None:
        """Put what another made."""
        self.put_again(team, data)
        self.sent[team]["forged"] += 1

    def put_again(self, team: Team, data: bytes) -> None:
        """Put what the seat itself has made at some time, which counts for nothing."""
        seat = self._seats[team]
        self._session.put(data, topics.action(seat.pit, seat.lane, team))

    def settle(self) -> None:
        """Wait until the referee has dealt with all of it.

        It takes up what was put before it answers what was asked, and one link keeps the order: whatever came before the first
        of two questions was dealt with before the answer to the second.
        """
        for _ in range(2):
            assert self._session.query(topics.lobby("pit"), b"")


def check(pit: Any, arena_here: Start, folder: Path, seats: Seats, forger: Forger) -> Journal:
    """Check that the match is of the genuine orders alone, and that each forgery was counted where it was put."""
    for team, seat in seats.items():
        faults = seat.next(Ended).faults
        for other in Team:
            assert Counter({what: n for what, n in faults[other.name.lower()].items() if n}) == forger.sent[other], (team, other)
    pit.wait_for("pit/000000/")
    (line,) = (line for line in pit.said.splitlines() if line.startswith("pit/000000/"))
    for team, sent in forger.sent.items():
        for what, n in sent.items():
            assert f"{team.name.lower()} {n} {what}" in line
    (path,) = (path for path in (folder / "journals").glob("*.journal") if "000000" in path.name)
    assert pit.finish() == 0
    journal = load_journal(path)
    assert verify(journal) == N_TICKS
    assert [tick.orders for tick in journal.ticks] == [genuine(Team.BLUE, t) + genuine(Team.RED, t) for t in range(N_TICKS)]
    assert not any(mark for tick in journal.ticks for mark in tick.marks)
    exit_code, said = arena_here("replay", "verify", path)
    assert exit_code == 0, said
    assert "Traceback" not in pit.said
    return journal


def test_only_what_a_seat_itself_orders_takes_effect_and_all_else_is_counted(
    serve: Start, arena_here: Start, stranger: Start, tmp_path: Path
) -> None:
    pit = serve("--matches", 2, *OPTIONS)
    seats = sit_down(stranger)
    twins = sit_down(stranger, {team: seat.identity for team, seat in seats.items()})  # the same entries in another match
    forger = Forger(stranger(), seats)
    said: list[dict[Team, bytes]] = []

    for tick in range(N_TICKS):
        orders, elsewhere = order(seats, tick), order(twins, tick)
        for team in Team:
            seat, lie = seats[team], Orders(tick=tick, actions=forged(team, tick))
            guess = Sealer(os.urandom(32), seat_context("pit", seat.match, team, Direction.ACTION))
            for _ in range(tick + 1):
                guess.close(b"", tick)  # on to a counter that could be the next
            own = orders[team]
            for data in (
                b"",
                os.urandom(100),
                bytes(MOST_BYTES),
                encode(lie),
                guess.close(encode(lie), tick),
                seats[team.other].seal(lie, tick),  # the other seat's key
                twins[team].seal(lie, tick),  # the same entry's and team's key, in another match
                elsewhere[team],
                orders[team.other],
                seat.raw[-1][1],  # what the referee said, sent back
                own[:-1],
                own + b"\0",
                own[:-1] + bytes([own[-1] ^ 1]),
                own[:12] + bytes([own[12] ^ 1]) + own[13:],
                own[:7] + bytes([own[7] + 1]) + own[8:],  # another counter
                own[:11] + bytes([own[11] ^ 1]) + own[12:],  # another tick
                *(earlier[team.other] for earlier in said),
            ):
                forger.put(team, data)
            for earlier in said:
                forger.put_again(team, earlier[team])
        forger.settle()
        give(seats, orders, tick)
        give(twins, elsewhere, tick)
        said.append(orders)

    check(pit, arena_here, tmp_path, seats, forger)


def test_what_was_sealed_before_a_seat_was_taken_anew_does_not_open(
    serve: Start, arena_here: Start, stranger: Start, tmp_path: Path
) -> None:
    pit = serve("--matches", 1, *OPTIONS)
    seats = sit_down(stranger)
    forger = Forger(stranger(), seats)
    blue = seats[Team.BLUE]
    given: list[bytes] = []
    before: list[bytes] = []

    for tick in range(N_TICKS):
        orders = order(seats, tick)
        if tick in (4, 8):
            never_given = [blue.seal(Orders(tick=t, actions=forged(Team.BLUE, t)), t) for t in range(tick, N_TICKS)]
            before += [*given, orders[Team.BLUE], *never_given]
            given.clear()
            assert blue.sit(name="the-blue", team="blue", match=blue.match).tick == tick
            blue.say(Ready(known_ticks=tick))
            hear({Team.BLUE: blue}, tick)
            orders[Team.BLUE] = blue.seal(Orders(tick=tick, actions=genuine(Team.BLUE, tick)), tick)
        for data in before:
            forger.put_again(Team.BLUE, data)
        forger.put(Team.BLUE, orders[Team.RED])
        forger.settle()
        give(seats, orders, tick)
        given.append(orders[Team.BLUE])

    check(pit, arena_here, tmp_path, seats, forger)
