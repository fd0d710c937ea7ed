"""The terms of a season, `[season]` of a league's file, and its phases. The league stays open, and authors submit its entries."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from arena.errors import InputError, UnknownNameError
from arena.records.journal import journal_name
from arena.records.plan import LeagueMatchId

FINAL_SUFFIX = "-final"
"""Of the name of a season's final, behind the season's."""
_MOST = {"final_pairs": 1_000, "most_kb": 60_000, "entries_per_owner": 100, "per_day": 10_000}
_LEAST = {"final_pairs": 0}
_MOST_CHUNK_LETTERS, _MOST_FILE_NAME_BYTES = 64, 255


def most_name_letters(league: str) -> int:
    """Return how long the name of an entry may be: a journal's file is named by two, one of them twice, and the league."""
    of_one = LeagueMatchId(league=league, one="x.9999", other="x.9999", pair=99_999, blue="x.9999")
    room = _MOST_FILE_NAME_BYTES - len(f"{journal_name(str(of_one))}.99")
    return min(1 + room // 3, _MOST_CHUNK_LETTERS)


class Phase(StrEnum):
    """What a season is at; each follows from the one before it."""

    OPEN = "open"
    """Submissions are taken and played, and everyone sees the table."""
    FROZEN = "frozen"
    """The same, but the public table stands still."""
    FINAL = "final"
    """No submission is taken any more, and a league of all entries is played on fresh maps."""
    OVER = "over"
    """The final is played, or there is none, and the secrets are known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeasonTerms:
    """What a season's file says of submissions and of its end; times are seconds since 1970."""

    submissions: str = "tcp/127.0.0.1:7448"
    """Endpoint where authors submit, as Zenoh writes it."""
    page: str = ""
    """Address of the web page that shows the season, for the links that its authors are given."""
    deadline_s: float | None = None
    """Submissions that come later are refused, and the final begins; None is never."""
    freeze_s: float | None = None
    """From then until the final, the public table stands still."""
    final_pairs: int = 10
    """Of each fixture of the final, a league of all entries on fresh maps under a secret of its own; 0 plays none."""
    most_kb: int = 10_000
    """Of a submission."""
    entries_per_owner: int = 1
    per_day: int = 50
    """Submissions of one owner in 24 hours."""
    invites: Path | None = None
    """File of the codes that let owners in, one a line; whoever comes is let in without it."""

    def is_open(self, now_s: float) -> bool:
        """Whether submissions are taken."""
        return self.deadline_s is None or now_s < self.deadline_s

    def is_frozen(self, now_s: float) -> bool:
        """Whether the public table stands still."""
        return self.freeze_s is not None and self.freeze_s <= now_s


def parse_terms(given: Any, folder: Path) -> SeasonTerms:
    """Return the terms that `[season]` of a file holds; paths in it begin at `folder`.

    Raises
    ------
    InputError
        Something in it is no term of a season; the sentence does not name the season.
    """
    if not isinstance(given, Mapping):
        raise InputError(f"says season = {json.dumps(given, default=str)}; write its terms below [season]")
    known = [field.name.removesuffix("_s") for field in fields(SeasonTerms)]
    values: dict[str, Any] = {}
    for key, value in given.items():
        if key not in known:
            raise UnknownNameError("term of the season", key, known)
        if key in ("deadline", "freeze"):
            values[f"{key}_s"] = _time(key, value)
        elif key == "invites":
            values[key] = _file(key, value, folder)
        elif key == "submissions":
            values[key] = _endpoint(key, value)
        elif key == "page":
            values[key] = _page(key, value)
        else:
            values[key] = _whole(key, value)
    return SeasonTerms(**values)


def _time(key: str, value: Any) -> float:
    if not isinstance(value, datetime):
        raise InputError(
            f"says {key} = {json.dumps(value, default=str)}; write a time such as 2027-01-31T18:00:00Z, without quotes"
        )
    return (value if value.tzinfo is not None else value.replace(tzinfo=UTC)).timestamp()


def _file(key: str, value: Any, folder: Path) -> Path:
    if not isinstance(value, str) or not (folder / value).is_file():
        raise InputError(f"says {key} = {json.dumps(value, default=str)}; it must be a file with a code on each line")
    return (folder / value).absolute()


def _page(key: str, value: Any) -> str:
    try:
        parts = urlsplit(value if isinstance(value, str) else "")
    except ValueError:
        parts = urlsplit("")
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise InputError(
            f"says {key} = {json.dumps(value, default=str)}; it must be an address such as https://arena.example.org"
        )
    return str(value)


def _endpoint(key: str, value: Any) -> str:
    port = str(value).rpartition(":")[2]
    if not (str(value).startswith("tcp/") and port.isdecimal() and 0 < int(port) < 2**16):
        raise InputError(f"says {key} = {json.dumps(value, default=str)}; it must be an endpoint such as tcp/0.0.0.0:7448")
    return str(value)


def _whole(key: str, value: Any) -> int:
    low, high = _LEAST.get(key, 1), _MOST[key]
    if type(value) is not int or not low <= value <= high:
        raise InputError(f"says {key} = {json.dumps(value, default=str)}; it must be a whole number from {low} to {high}")
    return value
