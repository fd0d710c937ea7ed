"""What the player of a replay shows: boards that fit the screen, and beside them the orders, the legend and the keys."""

from collections.abc import Iterator
from typing import NamedTuple

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from arena.display.player import KEYS, Player
from arena.display.scene import Cell, Pane, Scene, UnitLine
from arena.display.text import LEGEND, draw_board
from arena.game.types import Team

_GAP = 3
_ASIDE_COLUMNS = 26
"""What stands beside the boards is as wide as that, or wider."""
_TEAM_STYLES = {Team.BLUE: "#8fc1ff", Team.RED: "#ffb87a"}
_FATE_STYLES = {"fought": "bold white on #a3217a", "fell": "bold white on #c62828", "captured the flag": "bold black on #ffe14d"}
_GRAVE = ("x", "#ff6b6b")


class _Layout(NamedTuple):
    """How many boards of a view there is room for, and how large."""

    n_boards: int
    cell_columns: int
    aside_columns: int
    """0: nothing stands beside the boards."""


def draw_player(player: Player, width: int, height: int) -> Group:
    """Return the whole screen, of `height` lines at most."""
    scene = player.scene
    if scene is None:
        return Group(Text("the match has no ticks"), _draw_footer(player, width))
    title = [Text(line, no_wrap=True, overflow="ellipsis") for line in scene.title.split("\n")]
    n_rows = max(height - len(title) - 2, 1)
    if player.shows_keys:
        return Group(*title, _draw_keys(), _draw_footer(player, width))
    side = len(next(iter(scene.panes.values())).grid)
    layout = _lay_out(side, len(player.view.panes), width)
    player.first_row = min(player.first_row, max(side - n_rows, 0))
    table = Table.grid(padding=(0, _GAP, 0, 0))
    labels, boards = [], []
    for label in player.view.panes[: layout.n_boards]:
        labels.append(Text(_shorten(label, side * layout.cell_columns), "bold"))
        boards.append(_draw_pane(player, scene, scene.panes[label], layout.cell_columns, n_rows))
    if layout.aside_columns:
        n_shown = min(side, n_rows)
        aside = list(_write_aside(player, scene, layout))[:n_shown]
        table.add_row(*labels, Text("orders", "bold"))
        table.add_row(*boards, Text("\n").join(aside))
    else:
        table.add_row(*labels)
        table.add_row(*boards)
    return Group(*title, table, _draw_footer(player, width))


def _lay_out(side: int, n_boards: int, width: int) -> _Layout:
    """Return the largest layout that fits: first fewer columns for a cell, then fewer boards, then nothing beside them."""
    for n_shown, cell_columns in ((n_boards, 2), (n_boards, 1), (1, 2), (1, 1)):
        left = width - n_shown * (cell_columns * side + _GAP)
        if left >= _ASIDE_COLUMNS:
            return _Layout(n_shown, cell_columns, left)
    return _Layout(1, 2 if width >= 2 * side else 1, 0)


def _draw_pane(player: Player, scene: Scene, pane: Pane, cell_columns: int, n_rows: int) -> Text:
    """Return the rows of a board that there is room for."""
    rows = slice(player.first_row, player.first_row + n_rows)
    marks = {(row - rows.start, column): mark for (row, column), mark in _mark(player, scene, pane, cell_columns).items()}
    dimmed = None if pane.dimmed is None else pane.dimmed[rows]
    return draw_board(pane.grid[rows], is_wide=cell_columns == 2, dimmed=dimmed, marks=marks)


def _mark(player: Player, scene: Scene, pane: Pane, cell_columns: int) -> dict[Cell, tuple[str, str]]:
    """Return what stands over a board; where it is hidden, nothing of what happened is shown."""
    marks: dict[Cell, tuple[str, str]] = {}
    for cell in scene.graves:
        if pane.grid[cell] in GROUNDS:
            marks[cell] = _GRAVE
    for fate, cells in (("fought", scene.fought), ("fell", scene.fell), ("captured the flag", scene.captured)):
        for cell in cells:
            if pane.grid[cell] != Code.HIDDEN:
                marks[cell] = marks.get(cell, ("", ""))[0], _FATE_STYLES[fate]
    return marks
