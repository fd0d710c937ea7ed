"""The web server: one shell of a page for every address, its assets, and what the pages ask for as JSON.

A question that cannot be answered gets 200 and a sentence under `error`: it is for a person to read, and a browser writes every
other status into its console.
"""

import asyncio
import json
import logging
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict, dataclass
from functools import partial
from http import HTTPStatus
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from arena.display.replay_frames import describe_match
from arena.errors import ArenaError, InputError, LostPitError
from arena.protocol.identity import from_text
from arena.protocol.topics import is_chunk
from clients.web.guard import LOOPBACK, Guard
from clients.web.monitoring import Counted, WebMonitor
from clients.web.pit import PitClient
from clients.web.play import BrowserSeat, BrowserSeats, check_fighter, read_wish
from clients.web.providers import Leagues, Seasons
from clients.web.recordings import Recordings
from clients.web.routes import ABSENT, ASSETS, MONITORING, PAGES, QUESTIONS, RECORDINGS, SEASONS, SOCKETS, Page, render
from clients.web.seasons import SeasonHandlers
from policies import registry

logger = logging.getLogger(__name__)

_FIRST_WORD_S = 10.0
"""How long a page that opened a WebSocket may take to say what it wants."""
_GOODBYE_S = 2.0
"""How long seats have to be given up when the server ends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WebSettings:
    """What `arena web` is told."""

    pit: PitClient
    leagues: Leagues
    seasons: Seasons | None = None
    """None where none are shown."""
    players: BrowserSeats | None = None
    """None where nobody may play by this server."""
    names: tuple[str, ...] = LOOPBACK
    """By which the server may be called."""


def make_app(settings: WebSettings) -> Starlette:
    """Return the whole server as an application; its pit is looked for as long as it runs."""
    handlers = Handlers(settings)
    seasons = SeasonHandlers(settings.seasons)
    recordings = Recordings(settings.pit, settings.leagues)
    monitor = WebMonitor(settings.pit)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        listening = asyncio.create_task(settings.pit.run())
        yield
        listening.cancel()
        with suppress(asyncio.CancelledError):
            await listening
        if settings.players is not None:
            await asyncio.to_thread(settings.players.close, _GOODBYE_S)

    return Starlette(
        routes=[
            *(Route(page.path, partial(show, page)) for page in PAGES),
            *(Route(path, getattr(handlers, name)) for name, path in QUESTIONS.items()),
            *(Route(path, getattr(seasons, name)) for name, path in SEASONS.items()),
            *(Route(path, getattr(monitor, name)) for name, path in MONITORING.items()),
            Route(RECORDINGS["download"], recordings.download),
            Route(RECORDINGS["open"], recordings.open, methods=["POST"]),
            *(WebSocketRoute(path, getattr(handlers, name)) for name, path in SOCKETS.items()),
            Mount("/assets", StaticFiles(directory=ASSETS)),
        ],
        middleware=[
            Middleware(Guard, names=settings.names),
            Middleware(Counted, monitor=monitor),
            Middleware(GZipMiddleware, minimum_size=1_000, compresslevel=6),
        ],
        exception_handlers={HTTPStatus.NOT_FOUND: show_absent},
        lifespan=lifespan,
    )


async def show(page: Page, request: Request) -> Response:
    """Answer with a page."""
    return HTMLResponse(render(page, request.path_params))


async def show_absent(request: Request, _: Exception) -> Response:
    """Answer that nothing stands at an address: with a page, or with JSON where only a program asks."""
    if request.url.path.startswith(("/api/", "/assets/")):
        return JSONResponse({"error": f"there is no {request.url.path}"}, HTTPStatus.NOT_FOUND)
    return HTMLResponse(render(ABSENT, {}), HTTPStatus.NOT_FOUND)


class Handlers:
    """What each route answers, by its name in `clients.web.routes`."""

    def __init__(self, settings: WebSettings) -> None:
        self._pit, self._leagues, self._players = settings.pit, settings.leagues, settings.players

    async def lobby(self, _: Request) -> Response:
        """Answer with what everyone may know of the pit."""
        lobby = self._pit.lobby
        return JSONResponse(
            {
                "address": str(self._pit.address),
                "trouble": None if lobby else self._pit.trouble,
                "lobby": None if lobby is None else asdict(lobby),
                "results": list(self._pit.results),
            }
        )

    async def replay(self, request: Request) -> Response:
        """Answer with a match of the pit that is over, tick by tick."""
        match = request.path_params["match"]

        async def play_again() -> dict[str, Any]:
            if not is_chunk(match):
                raise InputError("no match is called so")
            journal = await self._pit.fetch_journal(match)
            return await asyncio.to_thread(describe_match, journal)

        return await _answer(play_again)

    async def leagues(self, _: Request) -> Response:
        """Answer with the names of the leagues and of the ladders in the store."""
        names = {"leagues": self._leagues.names, "ladders": self._leagues.ladders}
        return await _answer(lambda: asyncio.to_thread(lambda: {kind: ask() for kind, ask in names.items()}))

    async def league(self, request: Request) -> Response:
        """Answer with the report of a league."""
        name = request.query_params.get("name", "")
        return await _answer(lambda: asyncio.to_thread(self._leagues.report, name))

    async def head_to_head(self, request: Request) -> Response:
        """Answer with how two entries of a league fared against each other."""
        league, one, other = (request.query_params.get(key, "") for key in ("league", "a", "b"))
        return await _answer(lambda: asyncio.to_thread(self._leagues.head_to_head, league, one, other))

    async def ladder(self, request: Request) -> Response:
        """Answer with the standings of a ladder."""
        name = request.query_params.get("name", "")
        return await _answer(lambda: asyncio.to_thread(self._leagues.ladder, name))

    async def league_replay(self, request: Request) -> Response:
        """Answer with a match of a league, tick by tick."""
        name, identity = (request.query_params.get(key, "") for key in ("league", "identity"))
        return await _answer(lambda: asyncio.to_thread(lambda: describe_match(self._leagues.journal(name, identity))))

    async def watch_match(self, socket: WebSocket) -> None:
        """Tell a page all that happens in a running match; of its boards only to one that brings the spectator key."""
        await socket.accept()
        match = socket.path_params["match"]
        with suppress(WebSocketDisconnect, TimeoutError):
            try:
                key = read_key(await asyncio.wait_for(_receive(socket), _FIRST_WORD_S))
                if not is_chunk(match) or not await self._pit.runs(match):
                    await socket.send_json({"kind": "absent"})
                    await socket.close()
                    return
            except LostPitError:
                pass  # `_follow` says so, and goes on when the pit is back
            except InputError as error:
                key = None
                await socket.send_json({"kind": "wrong key", "sentence": str(error)})
            await self._follow(socket, match, key)

    async def play(self, _: Request) -> Response:
        """Answer with whether a person may play here, and the fighters that may help."""
        return JSONResponse({"is_open": self._players is not None, "fighters": registry.names()})

    async def play_match(self, socket: WebSocket) -> None:
        """Give a person a seat, or the same one again to a page that brings its token."""
        await socket.accept()
        with suppress(WebSocketDisconnect, TimeoutError):
            try:
                player = self._sit_down(await asyncio.wait_for(_receive(socket), _FIRST_WORD_S))
            except ArenaError as error:
                await socket.send_json({"kind": "refused", "sentence": str(error)})
                await socket.close()
                return
            await socket.send_json({"kind": "seat", "token": player.token})
            await self._serve(socket, player)

    def _sit_down(self, first: Any) -> BrowserSeat:
        if self._players is None:
            raise InputError("nobody can play by this server; arena web on your own machine lets you")
        if not isinstance(first, dict):
            raise InputError("the page did not say who wants to play")
        player = self._players.find(first.get("token"))
        if player is None and "token" in first:
            raise InputError("that seat is gone; ask for another")
        return player or self._players.sit_down(read_wish(first))

    async def _serve(self, socket: WebSocket, player: BrowserSeat) -> None:
        """Show a person's turns, and take what they say."""
        changed = asyncio.Event()
        hearing = asyncio.create_task(_hear(socket, player))
        with player.watch(asyncio.get_running_loop(), changed):
            try:
                while not hearing.done():
                    changed.clear()
                    await socket.send_json(player.to_json())
                    waiting = asyncio.create_task(changed.wait())
                    await asyncio.wait((waiting, hearing), return_when=asyncio.FIRST_COMPLETED)
                    waiting.cancel()
            finally:
                hearing.cancel()

    async def _follow(self, socket: WebSocket, match: str, key: bytes | None) -> None:
        with self._pit.watch(match, key) as watch:
            leaving = asyncio.create_task(_wait_for_end(socket))
            try:
                while not leaving.done():
                    telling = asyncio.create_task(watch.messages.get())
                    await asyncio.wait((telling, leaving), return_when=asyncio.FIRST_COMPLETED)
                    if telling.done():
                        await socket.send_json(telling.result())
                    telling.cancel()
            finally:
                leaving.cancel()


async def _receive(socket: WebSocket) -> Any:
    """Return what a page says; None for what is no JSON."""
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message["code"])
    try:
        return json.loads(message.get("text") or "")
    except (ValueError, RecursionError):
        return None


async def _hear(socket: WebSocket, player: BrowserSeat) -> None:
    """Carry out what a person says, until the page goes away or the person leaves."""
    with suppress(WebSocketDisconnect):
        while True:
            word = await _receive(socket)
            try:
                if isinstance(word, dict) and word.get("do") == "leave":
                    player.leave()
                elif isinstance(word, dict) and word.get("do") == "autopilot":
                    await asyncio.to_thread(player.fly_by, check_fighter(word.get("name")))
                else:
                    player.do(word)
            except InputError:
                logger.info("the page of %s said what no person can say", player.wish.name)


async def _wait_for_end(socket: WebSocket) -> None:
    """Return when the page goes away; what it says until then is of no interest."""
    with suppress(WebSocketDisconnect):
        while True:
            await _receive(socket)


def read_key(message: Any) -> bytes | None:
    """Return the spectator key that a page brings, as the 43 letters of its file; None if it brings none."""
    text = message.get("key") if isinstance(message, dict) else None
    if not isinstance(text, str) or not text.strip():
        return None
    try:
        return from_text(text.strip())
    except InputError:
        raise InputError("this is no spectator key: one has 43 letters, digits, - and _") from None


async def _answer(ask: Callable[[], Awaitable[dict[str, Any]]]) -> Response:
    try:
        return JSONResponse(await ask())
    except ArenaError as error:
        return JSONResponse({"error": str(error)})


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens; `InputError` if that cannot be."""
    listening = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen()  # whoever comes before the server runs is kept waiting, not turned away
    except OSError as error:
        listening.close()
        said = error.strerror or error
        raise InputError(f"the web page cannot listen at {host}:{port}: {said}; choose another address or port") from error
    return listening
