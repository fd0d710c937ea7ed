"""The README and the pages of docs, as the tests read them: their lines, their links, and what a reader would type or save.

A page is read from top to bottom, in a folder of its own. What a reader types stands in indented blocks, a command a line; what
they save stands in a fence behind "Save this as `NAME`". `<!-- needs: NAME -->` brings a file that another page has them save.
"""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
    if path.name != "layout.md"  # made of docstrings
}
LINES = "\n".join(PAGES.values()).replace("\\\n", " ").splitlines()
_STEP = re.compile(
    r"^<!-- needs: (?P<needs>[^ ]+) -->$"
    r"|^(?:[^\n]*Save\sthis\sas\s`(?P<file>[\w.-]+)`[^\n]*\n\n)?```(?P<language>[\w-]+)\n(?P<code>.*?)^```$"
    r"|^ {4}(?P<line>\S[^\n]*)$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True, kw_only=True)
class Step:
    """One thing that a page has its reader do."""

    needs: str | None = None
    file: str | None = None
    """What the code is saved as."""
    language: str | None = None
    code: str | None = None
    line: str | None = None
    """Of an indented block: a command, or part of a drawing."""


def steps(page: str) -> Iterator[Step]:
    """Yield what a page has its reader do, from top to bottom."""
    for found in _STEP.finditer(page.replace("\\\n", " ")):
        yield Step(**found.groupdict())


FILES = {step.file: step.code or "" for page in PAGES.values() for step in steps(page) if step.file}
"""What the pages have their readers save, by name."""


def words(command: str) -> list[str]:
    """Return a command line as its words after the first, up to where the shell ends it."""
    lexer = shlex.shlex(command.replace("$seed", "1"), posix=True, punctuation_chars=";|&")
    lexer.whitespace_split, lexer.commenters = True, ""
    found = list(lexer)
    ends = [at for at, word in enumerate(found) if set(word) <= set(";|&") or word.startswith("#")]
    return found[1 : min(ends, default=None)]
