"""A match in the terminal: stepped through with keys, played like a film, or printed; of a journal, or as one seat saw it."""

import os
import select
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import islice

from rich.console import Console, ConsoleDimensions, Group, RenderableType
from rich.live import Live
from rich.text import Text

from arena.console import clean
from arena.display.drawings import write_drawings
from arena.display.player import Player, Recording
from arena.display.player_screen import draw_player
from arena.display.scene import Scene, View
from arena.display.terminal_keys import KeyReader, keys_at_once
from arena.display.text import draw_row, is_live
from arena.errors import InputError

_MOST_COLUMNS = 120
"""Of drawings side by side, where a file has as many columns as anyone likes."""


def has_keys(console: Console) -> bool:
    """Whether somebody can press keys and see what they do: both ends are a terminal, and one that can be drawn on."""
    return is_live(console) and sys.stdin.isatty()


def play_with_keys(
    console: Console, recording: Recording, views: Sequence[View], ticks_per_s: float, *, is_playing: bool = True
) -> None:
    """Let somebody step through a match on a screen of its own, until they leave it.

    Raises
    ------
    ArenaError
        What the match broke off with, once they have left and if they came that far.
    """
    player = Player(recording, views, ticks_per_s, time.monotonic(), is_playing=is_playing)
    player.has_numbers = not console.no_color  # a number in a narrow cell tells its team by colour alone
    keys, descriptor = KeyReader(), sys.stdin.fileno()
    with (
        keys_at_once(descriptor) as signalled,
        Live(console=console, screen=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False) as live,
    ):
        while not player.is_over:
            console.size = size = ConsoleDimensions(*os.get_terminal_size(descriptor))  # COLUMNS may say what was once so
            live.update(draw_player(player, *size), refresh=True)
            ready, _, _ = select.select([descriptor, signalled], [], [], player.wait_s(time.monotonic()))
            if signalled in ready:
                os.read(signalled, 1 << 10)
            if descriptor in ready:
                sent = os.read(descriptor, 1 << 10)
                for key in keys.feed(sent) if sent else ["q"]:
                    player.press(key, time.monotonic())
            player.advance(time.monotonic())
    if recording.error is not None:
        raise recording.error


def print_scenes(
    console: Console, scenes: Iterator[Scene], view: View, last: int, tick: int | None, ticks_per_s: float, *, has_orders: bool
) -> None:
    """Print one tick, or every tick; on a terminal each takes the place of the one before, at that speed.

    Raises
    ------
    InputError
        There is no such tick.
    """
    if tick is not None:
        if not 0 <= tick <= last:
            there = f"ticks 0 to {last}" if last >= 0 else "no ticks"
            raise InputError(f"--tick is {tick}; the match has {there}")
        scenes = islice(scenes, tick, tick + 1)
    if tick is not None or not is_live(console):
        for scene in scenes:
            console.print(_draw(console, scene, view, None, has_orders=has_orders))
        return
    with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
        for scene in scenes:
            live.update(_draw(console, scene, view, console.height, has_orders=has_orders), refresh=True)
            time.sleep(1 / ticks_per_s)


def _draw(console: Console, scene: Scene, view: View, height: int | None, *, has_orders: bool) -> RenderableType:
    """Return a tick as it is printed: what the bot noted under the boards, its drawings as letters."""
    title, aside = scene.title, ""
    told = [f"{unit.name} {unit.order}" for unit in scene.units] if has_orders else []
    if told and is_live(console):  # a line each, beside boards that fill the height of a small screen
        aside = "\n".join(("orders", *told))
    elif told:
        title += f"\norders: {', '.join(told)}"
    boards = [(label, scene.panes[label].grid) for label in view.panes]
    drawn = draw_row(title, boards, console.width, height=height, dimmed=scene.panes[view.panes[-1]].dimmed, aside=aside)
    notes = [f"log: {clean(line)}" for line in scene.log]
    notes += write_drawings(scene.drawings, len(boards[0][1]), min(console.width, _MOST_COLUMNS))
    return Group(drawn, *map(Text, notes))
