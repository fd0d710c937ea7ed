"""A match as one HTML file: scripts and style of the pages with the match in it. It opens from a disk, without a network."""

import gzip
import json
import re
from base64 import b64encode
from functools import cache
from hashlib import sha256
from html import escape
from typing import Any

from clients.web.routes import ASSETS, IMPORT, find_modules

STYLES = ("style.css", "player.css")
_EXPORT = re.compile(r"^export (?=(async )?function|class|const)", re.MULTILINE)


def page_file(match: dict[str, Any]) -> str:
    """Return the file of a match, or of a transcript, as `arena.display.replay_frames` describes it."""
    title = escape(f"{match['names'][0]} against {match['names'][1]} - Arena")
    return _fill(_shell()[0], {"{title}": title, "{match}": pack(match)})


def pack(match: dict[str, Any]) -> str:
    """Return a match as it stands in a file."""
    return b64encode(gzip.compress(json.dumps(match, separators=(",", ":")).encode(), mtime=0)).decode()


def player_page() -> tuple[str, str]:
    """Return a file without its match, which its owner puts in the place of `{match}`; and the source that its policy allows.

    A page with such files in frames must allow that source too.
    """
    shell, source = _shell()
    return shell.replace("{title}", "A match - Arena"), source


@cache
def _shell() -> tuple[str, str]:
    # A file has no modules to import, so all of them become one, and no two may name the same.
    script = "\n" + "".join(_EXPORT.sub("", IMPORT.sub("", _read(name))) for name in find_modules("file.js"))
    style = "\n" + "".join(_read(name) for name in STYLES)
    source = _hash(script)
    policy = f"default-src 'none'; script-src '{source}'; style-src '{_hash(style)}'; base-uri 'none'; form-action 'none'"
    return _fill(_read("file.html"), {"{policy}": policy, "{style}": style, "{script}": script}), source


def _fill(text: str, blanks: dict[str, str]) -> str:
    return re.sub("|".join(map(re.escape, blanks)), lambda found: blanks[found[0]], text)


def _read(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"
