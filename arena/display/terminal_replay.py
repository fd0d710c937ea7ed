"""A match in the terminal, tick by tick: from a journal, or as one seat saw it."""

import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from rich.console import Console, RenderableType
from rich.live import Live
from rich.text import Text

from arena.console import clean
from arena.display.text import GroundMemory, draw_row, format_last_tick, format_losses, format_orders, is_live
from arena.errors import InputError
from arena.game.engine import BatchedGame
from arena.game.state import StateField
from arena.game.types import Team
from arena.records.journal import Journal, load_journal
from arena.records.replay import replay
from arena.records.transcript import load_transcript


def show_journal(console: Console, file: Path, team: str, tick: int | None, speed: float) -> None:
    """Show a team's view of every tick beside the truth, or of one."""
    journal = load_journal(file)
    height = console.height if is_live(console) and tick is None else None
    frames = (_frame(journal, games, Team[team.upper()], console.width, height) for games in replay(journal))
    _play(console, frames, len(journal.ticks), tick, speed)
    if journal.ending is not None and tick is None:
        console.print(Text(clean(journal.ending.describe())))


def show_transcript(console: Console, file: Path, tick: int | None, speed: float) -> None:
    """Show what a seat saw and remembered of every tick, or of one, and at the end what befell it."""
    transcript = load_transcript(file)
    header, seen = transcript.header, list(transcript.observations())
    memory = GroundMemory(header.ruleset.side)

    def draw(number: int) -> RenderableType:
        now = seen[number]
        seat = f"pit {header.pit}, match {header.match}: {header.name} plays {header.team.name.lower()} against {header.opponent}"
        title = (
            f"{clean(seat)}\n"
            f"tick {number} of {header.ruleset.tick_limit}   score {now.score:+d}   units {now.living[0]}:{now.living[1]}"
            f"{'' if now.clock_s is None else f'   bank {now.clock_s:.1f} s'}"
        )
        charged_us = transcript.charges_us[number]
        if charged_us is not None:
            title += f"   charged {charged_us / 1e6:.3f} s"
        orders = f"orders: {format_orders(now, transcript.ticks[number][1])}"
        if is_live(console):  # a line each, beside boards that fill the height of a small screen
            aside, height = orders.replace(", ", "\n").replace(": ", "\n"), console.height if tick is None else None
            return memory.draw_pair(title, now, console.width, aside, height=height)
        return memory.draw_pair(f"{title}\n{orders}", now, console.width)

    _play(console, map(draw, range(len(seen))), len(seen) - 1, tick, speed)
    if tick is not None:
        return
    lines = list(format_losses(seen))
    if transcript.ending is None:
        how = "stops" if transcript.is_whole else "was cut short"
        team = header.team.name.lower()
        lines += [f"the transcript {how} after {len(seen)} ticks, without an ending", f"unfinished as {team}"]
    else:
        result = transcript.ending
        lines += [format_last_tick(seen, result), result.describe(header.team)]
    for line in lines:
        console.print(Text(clean(line)))


def _play(console: Console, frames: Iterator[RenderableType], last: int, tick: int | None, speed: float) -> None:
    """Show the frame of one tick, or of each in its turn."""
    if tick is not None:
        if not 0 <= tick <= last:
            there = f"ticks 0 to {last}" if last >= 0 else "no ticks"
            raise InputError(f"--tick is {tick}; the match has {there}")
        console.print(next(islice(frames, tick, None)))
    elif not is_live(console):
        for frame in frames:
            console.print(frame)
    else:
        with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
            for frame in frames:
                live.update(frame, refresh=True)
                time.sleep(1 / speed)


def _frame(journal: Journal, games: BatchedGame, team: Team, width: int, height: int | None) -> RenderableType:
    field = games.state.field[0]
    header = journal.header
    title = (
        f"blue {header.blue} against red {header.red}   tick {field[StateField.TICK]} of {header.ruleset.tick_limit}   "
        f"score {field[StateField.SCORE]:+d}   units {field[StateField.BLUE_LIVING]}:{field[StateField.RED_LIVING]}"
    )
    boards = [(f"what {team.name.lower()} sees", games.grids()[team, 0]), ("the truth", games.truth(0))]
    return draw_row(clean(title), boards, width, height=height)
