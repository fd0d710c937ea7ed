"""What the player of a replay shows: boards that fit the screen, and beside them the orders, the log and the legend."""

from collections.abc import Sequence
from textwrap import wrap
from typing import NamedTuple

from rich.console import Group
from rich.table import Table
from rich.text import Text

from arena.console import clean
from arena.display.drawings import keep_heat, mark_drawings
from arena.display.player import KEYS, Player
from arena.display.scene import Pane, Scene, UnitLine
from arena.display.text import Marks, draw_board, letter_of
from arena.game.types import HALVES, Code, Team

_GAP = 3
_ASIDE_COLUMNS = 26
"""What stands beside the boards is as wide as that, or wider."""
_LEAST_LOG_ROWS = 3
_TEAM_STYLES = {Team.BLUE: "#8fc1ff", Team.RED: "#ffb87a"}
_FATES = {"fought": "bold white on #a3217a", "fell": "bold white on #c62828", "captured the flag": "bold black on #ffe14d"}
_GRAVE = "x", "#ff6b6b"
_LEGEND = ("U A F ·  blue", "u a f :  red", "UGV UAV flag half", "# obstacle  x fell there")


class _Layout(NamedTuple):
    """How many boards of a view there is room for, and how large."""

    n_boards: int
    cell_columns: int
    aside_columns: int
    """0: nothing stands beside the boards."""


def draw_player(player: Player, width: int, height: int) -> Group:
    """Return the whole screen: `height` lines at most."""
    scene, footer = player.scene, Text(_format_footer(player), "reverse", no_wrap=True, overflow="ellipsis")
    if scene is None:
        return Group(Text("the match has no ticks"), footer)
    title = [Text(line, no_wrap=True, overflow="ellipsis") for line in scene.title.split("\n")]
    if player.shows_keys:
        return Group(*title, *_format_keys()[: height - len(title) - 1], footer)
    n_rows = max(height - len(title) - 2, 1)  # of a board: below its label, above the last line
    side = len(scene.panes[player.view.panes[0]].grid)
    layout = _lay_out(side, len(player.view.panes), width)
    player.first_row = min(player.first_row, max(side - n_rows, 0))
    rows = slice(player.first_row, player.first_row + n_rows)
    shown = player.view.panes[: layout.n_boards]
    labels = [Text(label, "bold", no_wrap=True, overflow="ellipsis") for label in shown]
    boards = [_draw_pane(player, scene, scene.panes[label], rows, layout.cell_columns) for label in shown]
    log = scene.log if player.shows_log else ()
    has_room_below = n_rows - side >= _LEAST_LOG_ROWS or not layout.aside_columns
    below = _format_log(log, width)[: max(n_rows - side, 0)] if has_room_below else []
    table = Table.grid(padding=(0, _GAP, 0, 0))
    if layout.aside_columns:
        hidden = player.view.panes[layout.n_boards :]
        aside = _format_aside(player, scene, () if has_room_below else log, layout.aside_columns, n_rows - len(below))
        labels.append(Text(f"{hidden[0]}: press v" if hidden else "orders", "italic" if hidden else "bold", no_wrap=True))
        boards.append(Text("\n", no_wrap=True, overflow="ellipsis").join(aside))
    table.add_row(*labels)
    table.add_row(*boards)
    return Group(*title, table, *below, footer)


def _lay_out(side: int, n_boards: int, width: int) -> _Layout:
    """Return the largest layout that fits: first narrower cells, then fewer boards, then nothing beside them."""
    for n_shown, cell_columns in ((n_boards, 2), (n_boards, 1), (1, 2), (1, 1)):
        left = width - n_shown * (cell_columns * side + _GAP)
        if left >= _ASIDE_COLUMNS:
            return _Layout(n_shown, cell_columns, left)
    return _Layout(1, 2 if width >= 2 * side else 1, 0)


def _draw_pane(player: Player, scene: Scene, pane: Pane, rows: slice, cell_columns: int) -> Text:
    """Return the rows of a board that there is room for."""
    marks = {(row - rows.start, column): mark for (row, column), mark in _mark(player, scene, pane, cell_columns).items()}
    dimmed = None if pane.dimmed is None else pane.dimmed[rows]
    return draw_board(pane.grid[rows], is_wide=cell_columns == 2, dimmed=dimmed, marks=marks)


def _mark(player: Player, scene: Scene, pane: Pane, cell_columns: int) -> Marks:
    """Return what stands over a board. Of what happened, a board shows what happened on the cells that it shows."""
    marks: Marks = {}
    for cell in scene.graves:
        if pane.grid[cell] in HALVES:
            marks[cell] = _GRAVE
    if player.has_numbers:
        for cell, number in pane.numbers.items():
            text = f"{letter_of(pane.grid[cell])}{number}" if cell_columns == 2 else str(number)
            if len(text) <= cell_columns:
                marks[cell] = text, ""
    if player.shows_drawings and pane.is_drawn_on:
        mark_drawings(marks, keep_heat(scene.drawings, player.heat_label), pane.grid, cell_columns)
    for fate, cells in (("fought", scene.fought), ("fell", scene.fell), ("captured the flag", scene.captured)):
        for cell in cells:
            if pane.grid[cell] != Code.HIDDEN:
                text, style = marks.get(cell, ("", ""))
                marks[cell] = text, f"{style} {_FATES[fate]}".strip()
    return marks


def _format_aside(player: Player, scene: Scene, log: Sequence[str], width: int, n_rows: int) -> list[Text]:
    """Return the lines beside the boards: the orders first, then the log, and the legend where it costs nothing of these."""
    lines = [_format_unit(unit) for unit in scene.units if unit.team in player.view.teams]
    logged = _format_log(log, width)
    legend = [*map(Text, _LEGEND), Text("  ").join(Text(fate.partition(" ")[0], style) for fate, style in _FATES.items())]
    if logged:
        lines += [Text("log", "bold"), *logged]
    if len(lines) + 1 + len(legend) <= n_rows:
        lines += [Text("")] * (n_rows - len(lines) - len(legend)) + legend
    return lines[:n_rows] if len(lines) <= n_rows else [*lines[: n_rows - 1], Text(f"... {len(lines) - n_rows + 1} more", "dim")]


def _format_unit(unit: UnitLine) -> Text:
    text = Text(f"{unit.name:<6} ", _TEAM_STYLES[unit.team]).append(unit.order, "dim" if unit.order == "fallen" else "bold")
    return text.append("  ").append(unit.fate, _FATES[unit.fate]) if unit.fate else text


def _format_log(log: Sequence[str], width: int) -> list[Text]:
    return [Text(part, no_wrap=True) for line in log for part in wrap(clean(line), width, subsequent_indent="  ") or [""]]


def _format_keys() -> list[Text]:
    return [Text(f"  {key:<12} {does}") for key, does in KEYS]


def _format_footer(player: Player) -> str:
    last = "?" if player.last is None else player.last
    state = "playing" if player.is_playing else "paused"
    shown = f"view {player.view.name}" + (f"  map {clean(player.heat_label)}" if player.heat_label else "")
    return f"{state}  tick {player.number} of {last}  {player.ticks_per_s:g} a second  {shown}  ? keys  q leave"
