"""The web server in this process, with whatever pit a test has."""

import asyncio
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import uvicorn

from arena.errors import ArenaError
from arena.network.address import Address
from clients.web.pit import PitClient
from clients.web.providers import Leagues, Seasons
from clients.web.server import WebSettings, listen, make_app

if TYPE_CHECKING:
    from playwright.sync_api import Page

PATIENCE_S = 30.0
EVIL = "<script>window.evil = 1</script><img src=x onerror='window.evil = 1'>"
"""What must be text wherever a page shows it."""


class Archive(PitClient):
    """A pit that is asked for the journals of matches that are over, and has them at hand."""

    def __init__(self, journals: Mapping[str, bytes]) -> None:
        super().__init__(Address(), None, lambda _: None)
        self._journals = journals

    async def run(self) -> None:
        await asyncio.Event().wait()

    async def runs(self, match: str) -> bool:
        return False

    async def fetch_journal(self, match: str) -> bytes:
        if match not in self._journals:
            raise ArenaError(f"there is no journal of a match {match}")
        return self._journals[match]


class NoLeagues:
    """A store without leagues."""

    def names(self) -> list[str]:
        return []

    def report(self, name: str) -> dict[str, Any]:
        raise ArenaError(f"there is no league {name}")

    def journal(self, name: str, identity: str) -> bytes:
        raise ArenaError(f"there is no league {name}")


@contextmanager
def serving(pit: PitClient, leagues: Leagues | None = None, seasons: Seasons | None = None) -> Iterator[str]:
    """Serve the pages, and give their address."""
    with listen("127.0.0.1", 0) as listening:
        app = make_app(WebSettings(pit=pit, leagues=leagues or NoLeagues(), seasons=seasons))
        server = uvicorn.Server(uvicorn.Config(app, log_level="error", ws="websockets-sansio"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        server.should_exit = True
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


def is_harmless(page: "Page") -> bool:
    """Whether nothing of `EVIL` became markup."""
    return bool(page.evaluate("window.evil === undefined")) and page.locator("main script, main img:not([role])").count() == 0
