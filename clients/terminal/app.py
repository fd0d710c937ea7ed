"""The terminal app of a person who plays: it draws what is in the `TurnMailbox`, and passes keys and clicks on."""

import threading
from collections.abc import Callable
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container
from textual.message import Message
from textual.screen import ModalScreen
from textual.widgets import Static

from arena.display.text import LEGEND
from arena.errors import ArenaError
from arena.game.types import Action
from clients.human.commander import Commander
from clients.human.turn_mailbox import TurnMailbox
from clients.terminal import panel
from clients.terminal.board import BoardView
from policies.registry import SCRIPTS

_PANEL_COLUMNS = 36
_CLOCK_S = 0.25
_DIRECTIONS = {
    "up,w": Action.NORTH,
    "right,d": Action.EAST,
    "down,s": Action.SOUTH,
    "left,a": Action.WEST,
    "space": Action.STAY,
}


class Over(ModalScreen[None]):
    """How a match ended, until the person has read it."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("enter,escape,q,ctrl+c,ctrl+q", "dismiss", "go on")]
    DEFAULT_CSS = """
    Over { align: center middle; }
    Over Static { width: 70%; min-width: 36; height: auto; max-height: 100%; border: round $accent; padding: 1 2; }
    """

    def __init__(self, mailbox: TurnMailbox) -> None:
        super().__init__()
        self._mailbox = mailbox

    def compose(self) -> ComposeResult:
        """Lay out the screen."""
        result, commander = self._mailbox.result, self._mailbox.commander
        if result is not None and commander is not None:
            ending = panel.format_ending(commander.team, result, self._mailbox.seen)
            yield Static(ending.append("\nPress Enter to go on."))


class PitApp(App[None]):
    """One person's screen, for as many matches as the client plays."""

    ENABLE_COMMAND_PALETTE = False
    CSS = """
    Screen { layout: vertical; }
    #turn { height: 1; }
    #middle { layout: horizontal; height: 1fr; overflow: auto; }
    #panel { width: 1fr; min-width: 30; height: auto; padding-left: 2; }
    #goal, #units { margin-bottom: 1; }
    #legend, #help { color: $text-muted; }
    #news { height: 1; text-style: bold; }
    #middle.narrow { layout: vertical; }
    #middle.narrow #panel { padding-left: 0; }
    #help { height: auto; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        *(Binding(str(number), f"choose({number})", show=False) for number in range(10)),
        *(Binding(keys, f"head({int(action)})", show=False) for keys, action in _DIRECTIONS.items()),
        Binding("tab", "next(1)", show=False, priority=True),
        Binding("shift+tab", "next(-1)", show=False, priority=True),
        Binding("enter", "end_turn", show=False),
        Binding("x", "release", show=False),
        Binding("p", "autopilot", show=False),
        Binding("m", "memory", show=False),
        Binding("q,ctrl+c,ctrl+q", "leave", show=False, priority=True),
    ]

    class Changed(Message):
        """There is something new in the mailbox."""

    class Left(Message):
        """The app is to end."""

    class Stopped(Message):
        """The client has stopped playing."""

    def __init__(self, mailbox: TurnMailbox, run: Callable[[], object], stop: Callable[[], None]) -> None:
        super().__init__()
        self.failure: ArenaError | None = None
        """Why the client gave up."""
        self._mailbox, self._run_matches, self._stop = mailbox, run, stop
        self._has_stopped = self._is_leaving = False
        self._shown_over = ""
        self._news = ""
        self._thread = threading.Thread(target=self._play, name="runner")
        self.board = BoardView()
        # Held, not queried: a tick of the clock may still fall into the end, when the screen has let its widgets go.
        self._turn, self._goal, self._units, self._options, self._news_line = (
            Static(id=part) for part in ("turn", "goal", "units", "options", "news")
        )
        self._middle = Container(
            self.board,
            Container(self._goal, self._units, self._options, Static(LEGEND, id="legend"), id="panel"),
            id="middle",
        )

    def compose(self) -> ComposeResult:
        """Lay out the screen."""
        yield self._turn
        yield self._middle
        yield self._news_line
        yield Static(panel.HELP, id="help", markup=False)

    def on_mount(self) -> None:
        """Begin to play."""
        self._mailbox.on_change = self._post_change
        self.set_interval(_CLOCK_S, self._draw_turn)
        self.draw()
        self._thread.start()

    def on_resize(self) -> None:
        """Fit the board to the new size."""
        self.draw()

    def leave(self) -> None:
        """End, whatever is shown; from a signal."""
        self._stop()
        self.post_message(self.Left())

    def on_pit_app_left(self) -> None:
        """End."""
        self.exit()

    def close(self) -> None:
        """Wait for the client to leave the pit."""
        self._stop()
        if self._thread.ident is not None:
            self._thread.join()

    def on_pit_app_changed(self) -> None:
        """Show what is new."""
        self.draw()

    def on_pit_app_stopped(self) -> None:
        """Leave, once the last result was read."""
        self._has_stopped = True
        self.draw()
        if self.failure is not None or not isinstance(self.screen, Over):
            self.exit()

    def on_board_view_pointed(self, message: BoardView.Pointed) -> None:
        """Select the unit that was clicked, or send the selected one there."""
        self._command(lambda commander: commander.point(message.row, message.column), "no way is known to that cell")

    def action_choose(self, index: int) -> None:
        """Select a unit by its index, from 0."""
        self._command(lambda commander: commander.select(index), f"you have no living unit {index}")

    def action_next(self, step: int) -> None:
        """Select the next unit, or the one before."""
        self._command(lambda commander: commander.select_next(step))

    def action_head(self, action: int) -> None:
        """Order the selected unit in a direction."""
        self._command(lambda commander: commander.order(Action(action)), f"it may not go {Action(action).name.lower()}")

    def action_release(self) -> None:
        """Cancel the selected unit's order."""
        self._command(lambda commander: commander.release())

    def action_end_turn(self) -> None:
        """Send the orders."""
        self._news = ""
        self._mailbox.end_turn()
        self.draw()

    def action_autopilot(self) -> None:
        """Choose the next script for units without orders; after the last, none."""
        choices = ["", *SCRIPTS]
        now = self._mailbox.autopilot
        following = choices[(choices.index(now) + 1) % len(choices) if now in choices else 0]
        self._news = f"autopilot: {following or 'off'}"
        self.run_worker(lambda: self._set_autopilot(following), thread=True, exclusive=True)  # which may have to be compiled

    def action_memory(self) -> None:
        """Show the ground that is remembered, or what is in sight alone."""
        self.board.shows_memory = not self.board.shows_memory
        self._news = "" if self.board.shows_memory else "remembered ground is not shown"
        self.draw()

    def action_leave(self) -> None:
        """Leave; in a match, only when asked twice."""
        if isinstance(self.screen, Over):
            self.screen.dismiss()
        elif self._is_leaving or self._has_stopped or not self._mailbox.is_playing:
            self.exit()
        else:
            self._is_leaving = True
            self._news = "press q again to leave: the match is lost then"
            self.draw()

    def draw(self) -> None:
        """Show what is in the mailbox."""
        view, mailbox = self._mailbox.view_model(), self._mailbox
        self._draw_turn()
        self._news_line.update(Text(f"waiting {mailbox.waiting_for}" if mailbox.waiting_for else self._news))
        if view is None:
            return
        side = len(view.grid)
        self.board.is_wide = self.size.width >= 2 * side + _PANEL_COLUMNS
        self._middle.set_class(self.size.width < side + _PANEL_COLUMNS, "narrow")
        self.board.show(view)
        self._goal.update(panel.format_goal(view.team, mailbox.opponent))
        self._units.update(panel.format_units(view, mailbox.autopilot))
        self._options.update(panel.format_options(view))
        if mailbox.result is not None and self._shown_over != mailbox.match:
            self._shown_over = mailbox.match
            self.push_screen(Over(mailbox), self._on_read)

    def _draw_turn(self) -> None:
        view = self._mailbox.view_model()
        text: str | Text = (
            "looking for the pit"
            if view is None
            else panel.format_turn(view, self._mailbox.opponent, is_my_turn=self._mailbox.is_my_turn)
        )
        self._turn.update(text)

    def _on_read(self, _: None) -> None:
        if self._has_stopped or self._mailbox.result is not None:
            self.exit()

    def _command(self, act: Callable[[Commander], bool | None], complaint: str = "") -> None:
        self._is_leaving = False

        def act_and_report(commander: Commander) -> None:
            self._news = complaint if act(commander) is False else ""

        self._mailbox.command(act_and_report)
        self.draw()

    def _set_autopilot(self, autopilot: str) -> None:
        self._mailbox.set_autopilot(autopilot)
        self._post_change()

    def _post_change(self) -> None:
        self.post_message(self.Changed())

    def _play(self) -> None:
        try:
            self._run_matches()
        except ArenaError as error:
            self.failure = error
        finally:
            self.post_message(self.Stopped())
