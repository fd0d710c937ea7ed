"""The board that a person commands on: own units by their numbers, where the chosen one may go, and the way it was sent."""

from rich.text import Text
from textual import events
from textual.message import Message
from textual.widget import Widget

from arena.display.text import draw_board
from arena.game.types import Action, Code
from clients.human.routes import Cell
from clients.human.view_model import Picture, UnitPicture

_CHOSEN, _OTHER, _MAY, _WAY, _GOAL = "reverse", "", "underline bold", "bold", "reverse bold"


class BoardView(Widget):
    """Draws the picture that it was given last; a click on a cell is a `Pointed`."""

    DEFAULT_CSS = "BoardView { width: auto; height: auto; }"

    class Pointed(Message):
        """A cell was clicked."""

        def __init__(self, row: int, column: int) -> None:
            super().__init__()
            self.row, self.column = row, column

    def __init__(self, *, is_wide: bool = True) -> None:
        super().__init__()
        self.picture: Picture | None = None
        self.is_wide = is_wide
        self.shows_memory = True

    def show(self, picture: Picture) -> None:
        """Draw another picture."""
        self.picture = picture
        self.refresh(layout=True)

    def render(self) -> Text:
        """Return the board."""
        picture = self.picture
        if picture is None:
            return Text("no board yet")
        grid = picture.known if self.shows_memory else picture.grid
        dimmed = picture.grid == Code.HIDDEN
        return draw_board(grid, is_wide=self.is_wide, dimmed=dimmed, marks=find_marks(picture, is_wide=self.is_wide))

    def get_content_width(self, container: object, viewport: object) -> int:
        """Return the columns of the board."""
        return 12 if self.picture is None else len(self.picture.grid) * (2 if self.is_wide else 1)

    def get_content_height(self, container: object, viewport: object, width: int) -> int:
        """Return the rows of the board."""
        return 1 if self.picture is None else len(self.picture.grid)

    def on_click(self, event: events.Click) -> None:
        """Say which cell it was."""
        if self.picture is not None:
            self.post_message(self.Pointed(event.y, event.x // (2 if self.is_wide else 1)))


def find_marks(picture: Picture, *, is_wide: bool) -> dict[Cell, tuple[str, str]]:
    """Return what is drawn over the letters of a board: the way of the chosen unit, its choices, and the numbers of the own."""
    marks: dict[Cell, tuple[str, str]] = {}
    chosen = next((unit for unit in picture.units if unit.index == picture.selected), None)
    if chosen is not None:
        marks |= dict.fromkeys(chosen.route, ("\u2022", _WAY))
        if chosen.target is not None:
            marks[chosen.target] = ("x", _GOAL)
        for option in picture.options:
            if option.is_open and option.action is not Action.STAY and option.to not in marks:
                marks[option.to] = ("", _MAY) if picture.grid[option.to] > Code.RED_HALF else (ARROWS[option.action], _MAY)
    for unit in sorted((unit for unit in picture.units if unit.alive), key=lambda unit: unit.index == picture.selected):
        marks[unit.cell] = (_number(unit, is_wide), _CHOSEN if unit.index == picture.selected else _OTHER)
    return marks


ARROWS = {Action.STAY: "\u00b7", Action.NORTH: "\u2191", Action.EAST: "\u2192", Action.SOUTH: "\u2193", Action.WEST: "\u2190"}


def _number(unit: UnitPicture, is_wide: bool) -> str:
    """Return the number of a unit, and in a wide cell whether it flies."""
    number = str(unit.index)
    return f"{number}{'^' if unit.flies else ' '}" if is_wide and len(number) == 1 else number
