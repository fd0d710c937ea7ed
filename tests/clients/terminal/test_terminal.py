"""The screen of a person in the terminal, driven by textual's pilot, in matches without a network."""

import asyncio
import threading
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
import pytest
from textual.pilot import Pilot
from textual.widgets import Static

from arena.errors import LostPitError
from arena.game.keys import MatchKeys
from arena.game.ruleset import Ruleset, load, to_dict
from arena.game.types import Action, Code, Team
from arena.match.effects import Ask, End
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.protocol.messages import Ended, Ticket, Turn
from arena.records.journal import Header
from clients.human.turn_mailbox import TurnMailbox
from clients.seat import Seat
from clients.terminal.app import Over, PitApp
from policies import registry

PATIENCE_S = 60.0
RULES = load("paper")
BOARD = RULES.with_({"board": "f...u...\nu.......\n.##.....\n........\na.......\n........\n....U...\nF.......\n"})


class Venue:
    """A match of a person, in red, against a script, on a thread of its own as a runner plays it."""

    def __init__(self, mailbox: TurnMailbox, ruleset: Ruleset, opponent: str = "patrol") -> None:
        self.mailbox, self.ruleset, self.opponent = mailbox, ruleset, opponent
        self.failure: LostPitError | None = None
        self.stopped, self.woken = threading.Event(), threading.Event()
        keys = MatchKeys(map_key=b"\x05" * 32, match_key=b"\x08" * 32)
        header = Header(identity="m", blue=opponent, red="me", ruleset=ruleset, keys=keys)
        self.match = Match(header, TimeControl(turn_time_s=None), 0.0)
        mailbox.wake = self.woken.set

    def ticket(self, team: Team) -> Ticket:
        return Ticket(
            match="m", lane=7, team=int(team), ruleset={"name": "r", **to_dict(self.ruleset)},
            opponent=self.opponent, turn_time_s=None,
            bank_s=0.0, tick=0, secret=bytes(32), commitment=b"",
        )  # fmt: skip

    def stop(self) -> None:
        self.stopped.set()
        self.woken.set()

    def run(self) -> None:
        if self.failure is not None:
            raise self.failure
        makes = {Team.BLUE: registry.load(self.opponent), Team.RED: self.mailbox.make}
        seats = {team: Seat(self.ticket(team), bytes(32), make) for team, make in makes.items()}
        self.mailbox.on_seat(seats[Team.RED])
        events = [event for team in Team for event in self.match.ready(team, 0.0)]
        while events and not self.stopped.is_set():
            event = events.pop(0)
            if isinstance(event, Ask):
                answer: Any = self._ask(seats[event.team], Turn(tick=event.tick, observation=event.observation))
                if answer is not None:
                    events += self.match.submit(event.team, answer.tick, answer.actions, 0.0)
            elif isinstance(event, End):
                seats[Team.RED].receive(Ended(match="m", **event.result.to_dict()))

    def _ask(self, seat: Seat, turn: Turn) -> Any:
        said = seat.receive(turn)
        while not (said or self.stopped.is_set()):
            assert self.woken.wait(PATIENCE_S)
            self.woken.clear()
            said = seat.think()
        return said[0] if said else None


Play = Callable[["Pilot[None]", PitApp, TurnMailbox], Awaitable[None]]


def on_screen(play: Play, *, ruleset: Ruleset = BOARD, size: tuple[int, int] = (100, 30), autopilot: str = "") -> PitApp:
    """Run a screen, and return it once it has ended."""
    mailbox = TurnMailbox(autopilot)
    venue = Venue(mailbox, ruleset)
    app = PitApp(mailbox, venue.run, venue.stop)

    async def run() -> None:
        async with app.run_test(size=size) as pilot:
            await until(pilot, lambda: mailbox.view_model() is not None)
            await play(pilot, app, mailbox)

    try:
        asyncio.run(asyncio.wait_for(run(), PATIENCE_S))
    finally:
        app.close()
    return app


async def until(pilot: "Pilot[None]", is_so: Callable[[], bool]) -> None:
    """Let the screen work until something holds; `on_screen` ends it if that takes too long."""
    while not is_so():
        await pilot.pause()
    await pilot.pause()


def text_of(app: PitApp, part: str) -> str:
    return str(app.query_one(f"#{part}", Static).render())


def units(mailbox: TurnMailbox) -> list[Any]:
    view = mailbox.view_model()
    assert view is not None
    return list(view.units)


def test_units_are_chosen_by_number_and_sent_by_arrows_and_letters() -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        await pilot.press("0", "right", "1", "d", "2", "down")
        await until(pilot, lambda: mailbox.commander is not None and mailbox.commander.tick == 1)  # the last order ended the turn
        assert [unit.cell for unit in units(mailbox)] == [(0, 5), (1, 1), (7, 0)]
        assert [unit.action for unit in units(mailbox)] == [Action.EAST, Action.EAST, Action.SOUTH]
        await pilot.press("1", "x", "enter")
        await until(pilot, lambda: mailbox.commander is not None and mailbox.commander.tick == 2)
        assert [unit.cell for unit in units(mailbox)] == [(0, 6), (1, 1), (7, 0)]
        await pilot.press("0", "space", "tab", "s")
        assert [unit.action for unit in units(mailbox)] == [Action.STAY, Action.STAY, Action.SOUTH]
        assert "it may not go south" in text_of(app, "news")

    on_screen(play)


@pytest.mark.parametrize(("size", "columns"), [((100, 30), 2), ((40, 40), 1)])
def test_a_click_chooses_a_unit_and_sends_it_to_the_cell(size: tuple[int, int], columns: int) -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        await pilot.click(app.board, offset=(0, 1))
        assert mailbox.commander is not None
        assert mailbox.commander.selected == 1
        await pilot.click(app.board, offset=(3 * columns, 3))
        assert units(mailbox)[1].target == (3, 3)
        await pilot.click(app.board, offset=(1 * columns, 2))
        assert "no way is known to that cell" in text_of(app, "news")
        assert units(mailbox)[1].target == (3, 3)

    on_screen(play, size=size)


def test_the_screen_says_what_to_do_what_a_unit_may_do_and_what_time_is_left() -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        await pilot.press("1")
        assert "You are red against patrol. Find their flag F" in text_of(app, "goal").replace("\n", " ")
        assert "your turn, no clock" in text_of(app, "turn")
        options = text_of(app, "options")
        assert "unit 1 (ugv) sees 3 cells, fights within 2" in options
        assert "south an obstacle" not in options
        assert "west  the board ends" in options
        assert "east  to 1,1" in options
        help_lines = text_of(app, "help")
        for key in ("0-9", "Tab", "arrows", "WASD", "click", "space", "Enter", "x:", "p:", "m:", "q:"):
            assert key in help_lines

    on_screen(play)


def test_everything_fits_80_columns_and_24_rows() -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        await pilot.press("1")
        for part in ("turn", "goal", "units", "options", "news", "help", "legend"):
            region = app.query_one(f"#{part}").region
            assert region.height > 0, part
            assert region.bottom <= 24, part
            assert region.right <= 80, part
        assert (app.board.region.width, app.board.region.height) == (40, 20)
        assert max(map(len, text_of(app, "help").splitlines())) <= 80

    on_screen(play, ruleset=RULES, size=(80, 24))


def test_memory_is_shown_until_it_is_put_away() -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        for _ in range(6):
            tick = mailbox.commander.tick if mailbox.commander else 0
            await pilot.press("enter")
            await until(pilot, lambda tick=tick: not mailbox.is_playing or mailbox.commander.tick > tick)  # type: ignore[misc, union-attr]
        view = mailbox.view_model()
        assert view is not None
        remembered = np.argwhere((view.known != Code.HIDDEN) & (view.grid == Code.HIDDEN))
        assert len(remembered)
        row, column = (int(value) for value in remembered[0])
        with_memory = app.board.render().plain.split("\n")[row][2 * column]
        await pilot.press("m")
        without = app.board.render().plain.split("\n")[row][2 * column]
        assert (with_memory != " ", without) == (True, " ")

    on_screen(play, ruleset=RULES, autopilot="rush")


def test_a_whole_match_is_played_with_enter_and_an_autopilot_and_its_result_is_shown() -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        while mailbox.is_playing:
            await pilot.press("enter")
        await until(pilot, lambda: isinstance(app.screen, Over))
        assert mailbox.result is not None
        told = str(app.screen.query_one(Static).render())
        assert f"after {mailbox.result.ticks} ticks" in told
        assert "as red by" in told
        assert "Press Enter" in told
        assert app.is_running
        await pilot.press("enter")
        await until(pilot, lambda: not app.is_running)

    assert on_screen(play, ruleset=RULES, autopilot="rush").failure is None


def test_the_autopilot_is_changed_by_a_key() -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        await pilot.press("p")
        await until(pilot, lambda: mailbox.autopilot == registry.SCRIPTS[0])
        assert all(unit.is_autopilot for unit in units(mailbox))
        assert f"autopilot: {mailbox.autopilot}" in text_of(app, "news")

    on_screen(play)


def test_a_match_is_left_only_when_asked_twice() -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        await pilot.press("q")
        assert "press q again to leave" in text_of(app, "news")
        await pilot.press("1", "q")
        assert app.is_running
        assert app.return_value is None
        await pilot.press("q")
        await until(pilot, lambda: not app.is_running)

    on_screen(play)


def test_a_clock_that_falls_into_the_end_of_the_screen_does_not_break_it() -> None:
    async def play(pilot: "Pilot[None]", app: PitApp, mailbox: TurnMailbox) -> None:
        await app.screen.remove_children()  # as the end does, with the clock still ticking
        app.draw()
        await pilot.pause(0.3)

    on_screen(play)


def test_a_pit_that_is_lost_ends_the_screen_and_says_why() -> None:
    mailbox = TurnMailbox()
    venue = Venue(mailbox, BOARD)
    venue.failure = LostPitError("no pit answers")
    app = PitApp(mailbox, venue.run, venue.stop)

    async def run() -> None:
        async with app.run_test() as pilot:
            await until(pilot, lambda: not app.is_running)

    asyncio.run(asyncio.wait_for(run(), PATIENCE_S))
    app.close()

    assert app.failure is venue.failure
