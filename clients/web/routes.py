"""Every address of the web client, once: the server routes by this table, and each page is given it.

A new page is a line here, a script in `assets/` that exports `show(main, ...parameters)`, and a handler in `server` if it asks
for something of its own.
"""

import json
import re
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path

from arena.protocol.page_token import TOKEN_HEADER
from clients.web.guard import EMBEDDED

ASSETS = Path(__file__).parent / "assets"


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A page that a person can open."""

    path: str
    """`{name}` stands for a part that is handed to the script."""
    script: str
    """In `assets/`."""
    link: str = ""
    """What it is called in the navigation; it stands there only if it is called something."""


PAGES = (
    Page(path="/", script="lobby.js", link="Lobby"),
    Page(path="/match/{match}", script="match.js"),
    Page(path=f"{EMBEDDED}match/{{match}}", script="embed.js"),
    Page(path="/open", script="open.js", link="Open"),
    Page(path="/play", script="play.js", link="Play"),
    Page(path="/league", script="league.js", link="Leaderboard"),
    Page(path="/league/head-to-head", script="head_to_head.js"),
    Page(path="/seasons/{season}", script="season.js"),
    Page(path="/seasons/{season}/{entry}", script="entry.js"),
    Page(path="/rules", script="rules.js", link="Rules"),
)
ABSENT = Page(path="", script="absent.js")
"""What stands at every other address."""
QUESTIONS = {
    "lobby": "/api/lobby",
    "replay": "/api/replay/{match}",
    "play": "/api/play",
    "leagues": "/api/leagues",
    "league": "/api/league",
    "head_to_head": "/api/league/head-to-head",
    "ladder": "/api/ladder",
    "league_replay": "/api/league/replay",
}
"""What a page may ask for as JSON, by the name of the handler."""
SEASONS = {
    "seasons": "/api/seasons",
    "season": "/api/season",
    "season_entry": "/api/season/entry",
    "season_own": "/api/season/own",
}
"""What `clients.web.seasons` answers, likewise."""
RECORDINGS = {"download": "/api/download/{form}/{match}", "open": "/api/open/{form}"}
"""What `clients.web.recordings` answers by the names of its handlers; a page sends a file along to the second."""
MONITORING = {"healthz": "/healthz", "metrics": "/metrics"}
"""What `clients.web.monitoring` answers by the names of its handlers."""
SOCKETS = {"watch_match": "/ws/match/{match}", "play_match": "/ws/play"}
"""Where a page may stay connected, likewise."""
IMPORT = re.compile(r'^import \{[^}]*\} from "\./([\w.]+)";\n', re.MULTILINE)
"""A line of an asset that imports another."""


@cache
def find_modules(script: str) -> tuple[str, ...]:
    """Return an asset and all that it imports, each behind what it imports itself."""
    imported = IMPORT.findall((ASSETS / script).read_text(encoding="utf-8"))
    return tuple(dict.fromkeys([*(one for name in imported for one in find_modules(name)), script]))


def render(page: Page, parameters: dict[str, str]) -> str:
    """Return the HTML that a page begins as: its navigation, its script, and the routes that it may ask."""
    links = "".join(
        f'<a href="{other.path}"{" aria-current=page" if other is page else ""}>{other.link}</a>\n'
        for other in PAGES
        if other.link
    )
    start = {
        "script": f"/assets/{page.script}",
        "parameters": list(parameters.values()),
        "routes": QUESTIONS | SEASONS | RECORDINGS | SOCKETS,
        "tokenHeader": TOKEN_HEADER,
    }
    shell = (ASSETS / "index.html").read_text(encoding="utf-8")
    shell = shell.replace("<body>", '<body class="bare">') if page.path.startswith(EMBEDDED) else shell
    # A browser that is told of them asks for all at once, and not for one by the other.
    modules = "".join(f'<link rel="modulepreload" href="/assets/{name}">\n' for name in find_modules(page.script))
    shell = shell.replace("{modules}\n", modules)
    return shell.replace("{links}", links).replace("{start}", escape(json.dumps(start)))
