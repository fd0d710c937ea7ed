"""The board that a person commands on: own units by their numbers, where the selected one may go, and its way."""

from rich.text import Text
from textual import events
from textual.message import Message
from textual.widget import Widget

from arena.display.text import draw_board
from arena.game.types import Action, Code
from clients.human.routes import Cell
from clients.human.view_model import UnitView, ViewModel

_CHOSEN, _OTHER, _MAY, _WAY, _GOAL = "reverse", "", "underline bold", "bold", "reverse bold"


class BoardView(Widget):
    """Draws the view that it was given last; a click on a cell is a `Pointed`."""

    DEFAULT_CSS = "BoardView { width: auto; height: auto; }"

    class Pointed(Message):
        """A cell was clicked."""

        def __init__(self, row: int, column: int) -> None:
            super().__init__()
            self.row, self.column = row, column

    def __init__(self, *, is_wide: bool = True) -> None:
        super().__init__()
        self.view: ViewModel | None = None
        self.is_wide = is_wide
        self.shows_memory = True

    def show(self, view: ViewModel) -> None:
        """Draw another view."""
        self.view = view
        self.refresh(layout=True)

    def render(self) -> Text:
        """Return the board."""
        view = self.view
        if view is None:
            return Text("no board yet")
        grid = view.known if self.shows_memory else view.grid
        dimmed = view.grid == Code.HIDDEN
        return draw_board(grid, is_wide=self.is_wide, dimmed=dimmed, marks=find_marks(view, is_wide=self.is_wide))

    def get_content_width(self, container: object, viewport: object) -> int:
        """Return the columns of the board."""
        return 12 if self.view is None else len(self.view.grid) * (2 if self.is_wide else 1)

    def get_content_height(self, container: object, viewport: object, width: int) -> int:
        """Return the rows of the board."""
        return 1 if self.view is None else len(self.view.grid)

    def on_click(self, event: events.Click) -> None:
        """Post the cell."""
        if self.view is not None:
            self.post_message(self.Pointed(event.y, event.x // (2 if self.is_wide else 1)))


def find_marks(view: ViewModel, *, is_wide: bool) -> dict[Cell, tuple[str, str]]:
    """Return what is drawn over the letters of a board: the way of the selected unit, its choices, and the numbers of the own."""
    marks: dict[Cell, tuple[str, str]] = {}
    chosen = next((unit for unit in view.units if unit.index == view.selected), None)
    if chosen is not None:
        marks |= dict.fromkeys(chosen.route, ("\u2022", _WAY))
        if chosen.target is not None:
            marks[chosen.target] = ("x", _GOAL)
        for option in view.options:
            if option.is_open and option.action is not Action.STAY and option.to not in marks:
                marks[option.to] = ("", _MAY) if view.grid[option.to] > Code.RED_HALF else (ARROWS[option.action], _MAY)
    for unit in sorted((unit for unit in view.units if unit.alive), key=lambda unit: unit.index == view.selected):
        marks[unit.cell] = (_number(unit, is_wide), _CHOSEN if unit.index == view.selected else _OTHER)
    return marks


ARROWS = {Action.STAY: "\u00b7", Action.NORTH: "\u2191", Action.EAST: "\u2192", Action.SOUTH: "\u2193", Action.WEST: "\u2190"}


def _number(unit: UnitView, is_wide: bool) -> str:
    """Return the number of a unit, and in a wide cell whether it flies."""
    number = str(unit.index)
    return f"{number}{'^' if unit.flies else ' '}" if is_wide and len(number) == 1 else number
