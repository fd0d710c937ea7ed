"""What pages ask for of seasons: their tables, their entries, and what the owner of an entry alone may see."""

import asyncio
from collections.abc import Callable
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from arena.errors import ArenaError, InputError
from arena.protocol.page_token import TOKEN_HEADER
from clients.web.providers import Seasons

_NEVER_KEPT = {"cache-control": "no-store"}


class SeasonHandlers:
    """What each route of `clients.web.routes.SEASONS` answers, by its name."""

    def __init__(self, seasons: Seasons | None) -> None:
        self._seasons = seasons

    async def seasons(self, _: Request) -> Response:
        """Answer with the names of the seasons in the store."""
        seasons = self._seasons
        return await _answer(lambda: {"seasons": [] if seasons is None else seasons.names()})

    async def season(self, request: Request) -> Response:
        """Answer with the table of a season."""
        name = request.query_params.get("name", "")
        return await _answer(lambda: self._find().season(name))

    async def season_entry(self, request: Request) -> Response:
        """Answer with what everyone may know of an entry."""
        season, entry = (request.query_params.get(key, "") for key in ("season", "entry"))
        return await _answer(lambda: self._find().entry(season, entry))

    async def season_own(self, request: Request) -> Response:
        """Answer with what the owner of an entry sees, to a page that brings the owner's token in its header."""
        season, entry = (request.query_params.get(key, "") for key in ("season", "entry"))
        token, host = (request.headers.get(name, "") for name in (TOKEN_HEADER, "host"))
        answer = await _answer(lambda: self._find().own(season, entry, token, host))
        answer.headers.update(_NEVER_KEPT)
        return answer

    def _find(self) -> Seasons:
        if self._seasons is None:
            raise InputError("this server shows no seasons")
        return self._seasons


async def _answer(ask: Callable[[], dict[str, Any]]) -> Response:
    try:
        return JSONResponse(await asyncio.to_thread(ask))
    except ArenaError as error:
        return JSONResponse({"error": str(error)})
