"""What commands say, and how: tables, JSON, progress."""

import json
import logging
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from datetime import UTC, datetime
from io import StringIO
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

_RATE_AFTER_S = 0.5
_LINE_EVERY_S = 5.0
_NO_WIDTH = 10_000
"""Of what is no terminal, in cells: wider than any table."""
_LONGEST_WORD = 20
"""Of a column that must become narrower, in cells: longer ones, such as paths and keys, may be broken."""
_PADDINGS = ((0, 1, 0, 1), (0, 1, 0, 0), (0, 0, 0, 0))
"""Of cells in tables: top, right, bottom, left. The first with which all fits, or else with which all words do."""
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of a table.")]
"""The option that every command which prints a table takes."""


def complete_ruleset(incomplete: str) -> list[str]:
    """Return the names of shipped rulesets that begin like `incomplete`, for the shell."""
    from arena.game.ruleset import RULESETS

    return [name for name in RULESETS if name.startswith(incomplete)]


def clean(text: str) -> str:
    """Return a text, of whose making ever, as one line that a terminal shows and does not obey.

    What cannot be seen (control characters, line breaks, marks that turn the direction of writing) is written as Python does.
    """
    return text if text.isprintable() else "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def say(*lines: str, err: bool = False, level: str = "info") -> None:
    """Print lines, cleaned: a line break within one is shown, and begins no other line.

    What goes to stderr while logs are JSON is a log record of this level.
    """
    if err and any(isinstance(handler.formatter, JsonFormatter) for handler in logging.getLogger().handlers):
        for line in lines:
            typer.echo(_to_log_line(time.time(), level, "said", line), err=True)
    else:
        typer.echo("\n".join(map(clean, lines)), err=err)


def say_lines(text: str, *, err: bool = False) -> None:
    """Print a text of several lines, each cleaned."""
    say(*text.removesuffix("\n").split("\n"), err=err)


class LineFormatter(logging.Formatter):
    """Formats log records with clean messages: what a stranger sent may stand in them."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        record.message = clean(record.message)
        return super().formatMessage(record)

    def formatException(self, ei: Any) -> str:
        return "\n".join(map(clean, super().formatException(ei).split("\n")))


class JsonFormatter(logging.Formatter):
    """Formats log records as JSON, one object a line, for what collects logs.

    A record that was given `extra={"facts": {...}}` says by `event` what happened, and to which `match` and `team`.
    """

    def format(self, record: logging.LogRecord) -> str:
        facts: dict[str, object] = {"event": "log", **getattr(record, "facts", {}), "logger": record.name}
        if record.exc_info:
            facts["traceback"] = self.formatException(record.exc_info)
        event = str(facts.pop("event"))
        return _to_log_line(record.created, record.levelname.lower(), event, record.getMessage(), **facts)


def _to_log_line(at_s: float, level: str, event: str, text: str, **facts: object) -> str:
    moment = datetime.fromtimestamp(at_s, UTC).isoformat(timespec="milliseconds")
    return to_json({"time": moment, "level": level, "event": event, **facts, "text": text}, indent=None)


def set_up_logging(verbosity: int = 0, form: str = "") -> None:
    """Log to stderr, as text or as JSON; warnings, and from a verbosity of 1 on matches, which JSON always has, then ticks.

    Without a form, as whoever started this process logs.
    """
    is_json = (form or os.environ.get("ARENA_LOG")) == "json"
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(max(verbosity, int(is_json)), 2)]
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonFormatter() if is_json else LineFormatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=level, handlers=[handler])
    if not verbosity:
        logging.getLogger("alembic").setLevel(logging.WARNING)  # which says at each start what it is made of


def to_json(value: object, *, indent: int | None = 2) -> str:
    """Return a JSON document in which what a terminal would obey is escaped, and all else is as it reads best."""
    text = json.dumps(value, indent=indent, ensure_ascii=False)
    return text if text.isprintable() else "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text)


def print_json(value: object) -> None:
    """Print one JSON document."""
    typer.echo(to_json(value))


def print_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table; numbers stand right. On a terminal it fits the width, if that breaks no word; elsewhere nothing is cut."""
    from rich.console import Console

    console = Console()
    _print_table(console, columns, rows, console.width if console.is_terminal else _NO_WIDTH)


def format_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return what `print_table` prints where nothing is cut, without colours."""
    from rich.console import Console

    console = Console(file=StringIO(), no_color=True, force_terminal=False)
    with console.capture() as capture:
        _print_table(console, columns, rows, _NO_WIDTH)
    return "".join(line.rstrip() + "\n" for line in capture.get().splitlines())


def _print_table(console: "Console", columns: Sequence[str], rows: Iterable[Sequence[object]], width: int) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.cells import cell_len
    from rich.table import Table
    from rich.text import Text

    values = [list(row) for row in rows]
    texts = [[clean(_format(value)) for value in row] for row in values]
    shown = [[column, *(row[index] for row in texts)] for index, column in enumerate(columns)]
    whole = [max(map(cell_len, cells)) for cells in shown]
    words = [min(max((cell_len(word) for cell in cells for word in cell.split()), default=0), _LONGEST_WORD) for cells in shown]
    fitting = (one for needed in (whole, words) for one in _PADDINGS if sum(needed) + _n_between(one, len(shown)) <= width)
    padding = next(fitting, _PADDINGS[-1])
    widths = _share_width(whole, words, width - _n_between(padding, len(shown)))
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=padding)
    for index, column in enumerate(columns):
        numbers = all(isinstance(row[index], int | float) and not isinstance(row[index], bool) for row in values)
        table.add_column(column, justify="right" if numbers else "left", overflow="fold", width=widths[index])
    for row in texts:
        table.add_row(*map(Text, row))
    console.width = max(width, sum(widths) + _n_between(padding, len(shown)))
    console.print(table)


def _n_between(padding: tuple[int, int, int, int], n_columns: int) -> int:
    """Return how many cells of a line are no column's: those between columns, and one at either end."""
    return (1 + padding[1] + padding[3]) * (n_columns - 1) + 2


def _share_width(whole: Sequence[int], least: Sequence[int], width: int) -> list[int]:
    """Return the widths of columns: as wide as their longest cells, or the widest narrower, though none than its least."""
    widths = list(whole)
    while sum(widths) > width:
        widest = max(range(len(widths)), key=lambda index: (widths[index] > least[index], widths[index]))
        if widths[widest] <= least[widest]:
            break
        widths[widest] -= 1
    return widths


def _format(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1_000 else f"{value:.4g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


@contextmanager
def progress_bar(total: int, what: str, *, each: str = "matches") -> Iterator[Callable[[int], None]]:
    """Show how far long work is, on stderr: a bar on a terminal, a plain line every few seconds elsewhere.

    What is yielded counts further. The line says the rate of `each` per second, and the time left.
    """
    if not sys.stderr.isatty():
        yield _Lines(total, what, each).advance
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    rate = _Rate()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=total, rate="")

        def advance(n: int) -> None:
            progress.advance(task, n)
            per_s = rate.count(n)
            if per_s:
                progress.update(task, rate=f"{per_s:,.1f} {each}/s")

        yield advance


@contextmanager
def compiling_bar(n_kernels: int, expected_s: float) -> Iterator[Callable[[], None]]:
    """Say at once on stderr that kernels are compiled, and on a terminal how far that is; what is yielded counts one further."""
    what = "compiling the rules and the fighters, once"
    if not sys.stderr.isatty():
        typer.echo(f"{what}: {quantity(n_kernels, 'kernel')}, about {expected_s:.0f} s", err=True)
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("kernels"),
        TimeElapsedColumn(),
        TextColumn(f"of about {expected_s:.0f} s"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=n_kernels)
        yield lambda: progress.advance(task)


def quantity(n: int, one: str, more: str = "") -> str:
    """Return a number of things, as in "1 turn" and "1,000 turns"; `more` is the plural, where it is not `one` with an s."""
    return f"{n:,} {one if n == 1 else more or f'{one}s'}"


class JsonProgress:
    """Progress for machines, on stderr: one JSON object a line, whose `event` says what happened."""

    def __init__(self, total: int, done: int = 0) -> None:
        self._total, self._done, self._rate = total, done, _Rate()

    def say(self, event: str, **facts: object) -> None:
        """Say something that is no step further."""
        typer.echo(to_json({"event": event, **facts}, indent=None), err=True)

    def advance(self, event: str, **facts: object) -> None:
        """Count one further, and say so; rate and time left are null while nothing can be said."""
        self._done += 1
        per_s = self._rate.count(1)
        pace = {"per_s": round(per_s, 2), "left_s": round((self._total - self._done) / per_s, 1)} if per_s else {}
        self.say(event, played=self._done, of=self._total, **{"per_s": None, "left_s": None} | pace, **facts)


class _Rate:
    """How many there are a second, from the first on: the time before it went into getting ready."""

    def __init__(self) -> None:
        self._n = 0
        self._first_s: float | None = None

    def count(self, n: int) -> float:
        """Count further; 0 while nothing can be said."""
        now_s = time.monotonic()
        if self._first_s is None:
            self._first_s = now_s
            return 0.0
        self._n += n
        took_s = now_s - self._first_s
        return self._n / took_s if took_s > _RATE_AFTER_S else 0.0


class _Lines:
    """Progress where there is no terminal."""

    def __init__(self, total: int, what: str, each: str) -> None:
        self._total, self._what, self._each = total, what, each
        self._done, self._rate = 0, _Rate()
        self._said_s = time.monotonic()

    def advance(self, n: int) -> None:
        """Count further, and say so if it is time."""
        self._done += n
        per_s, now_s = self._rate.count(n), time.monotonic()
        if now_s - self._said_s < _LINE_EVERY_S:
            return
        self._said_s = now_s
        pace = f", {per_s:,.1f} per s, {(self._total - self._done) / per_s:,.0f} s left" if per_s else ""
        say(f"{self._what}: {self._done:,} of {self._total:,} {self._each}{pace}", err=True)


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Send all that is printed to stderr, by whatever means, so that a stranger's code cannot spoil what the command says."""
    error = sys.stderr
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        sys.stderr = error  # which it may have replaced, as stdout
        sys.stdout.flush()  # who kept hold of it may have written
        os.dup2(kept, 1)
        os.close(kept)
