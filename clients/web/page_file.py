"""A match as one HTML file: scripts and style of the pages with the match in it. It opens from a disk, without a network."""

import gzip
import json
import re
from base64 import b64encode
from hashlib import sha256
from html import escape
from typing import Any

from clients.web.routes import ASSETS

SCRIPTS = (
    "dom.js",
    "board.js",
    "events.js",
    "scene.js",
    "timeline.js",
    "legend.js",
    "player.js",
    "address.js",
    "replay.js",
    "file.js",
)
"""Each behind those that it imports. A file has no modules to import, so all of them become one, and no two may name the same."""
STYLES = ("style.css", "player.css")
_IMPORT = re.compile(r'^import \{[^}]*\} from "\./[\w.]+";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(async )?function|class|const)", re.MULTILINE)


def page_file(match: dict[str, Any]) -> str:
    """Return the file of a match, or of a transcript, as `arena.display.replay_frames` describes it."""
    script = "\n" + "".join(_EXPORT.sub("", _IMPORT.sub("", _read(name))) for name in SCRIPTS)
    style = "\n" + "".join(_read(name) for name in STYLES)
    packed = gzip.compress(json.dumps(match, separators=(",", ":")).encode(), mtime=0)
    policy = f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; base-uri 'none'; form-action 'none'"
    blanks = {
        "{policy}": policy,
        "{title}": escape(f"{match['names'][0]} against {match['names'][1]} - Arena"),
        "{style}": style,
        "{script}": script,
        "{match}": b64encode(packed).decode(),
    }
    return re.sub("|".join(map(re.escape, blanks)), lambda found: blanks[found[0]], _read("file.html"))


def _read(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"
