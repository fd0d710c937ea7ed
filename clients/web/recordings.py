"""What pages ask for of a journal or a transcript: its frames, moving pictures of some ticks, or all of it as one HTML file.

The recording is a match of the pit or of a league that is over, or a file that the page sends along: its reader's own, of which
nothing is kept here. Each costs a while of a core, so only some are made at a time.
"""

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from io import BytesIO
from itertools import islice

from starlette.datastructures import QueryParams
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from arena.display.image import draw, frames_of, save_gif
from arena.display.replay_frames import MOST_TICKS, describe_recording
from arena.errors import ArenaError, InputError
from arena.game.types import Team
from arena.protocol.topics import is_chunk
from arena.records.recording import read_recording
from clients.web.page_file import page_file
from clients.web.pit import PitClient
from clients.web.providers import Leagues

MOST_BYTES = 1 << 24
"""Of a file that a page sends."""
_UPLOAD_S = 60.0
"""How long a page may take to send it."""
MOST_GIF_TICKS = 200
_GIF_BOARD_PIXELS = 240
_GIF_TICKS_PER_S = 4.0
MOST_AT_ONCE = 10
"""Whoever asks while so many are asked for is told to come again; files that pages send are counted by themselves."""
_MADE_AT_ONCE = 2
_VIEWS = ("blue", "red")


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """What a recording is made into."""

    make: Callable[[bytes, QueryParams], bytes]
    media_type: str


class Recordings:
    """Answers requests for recordings, each as one of `FORMS`."""

    def __init__(self, pit: PitClient, leagues: Leagues) -> None:
        self._pit, self._leagues = pit, leagues
        self._making = asyncio.Semaphore(_MADE_AT_ONCE)
        self._n_asked = Counter[str]()
        """Requests that were not answered yet, by their method."""

    async def download(self, request: Request) -> Response:
        """Answer with a match of the pit, or of a league, that is over."""

        async def fetch() -> bytes:
            query, match = request.query_params, request.path_params["match"]
            if "league" in query:
                return await asyncio.to_thread(self._leagues.journal, query["league"], query.get("identity", ""))
            if not is_chunk(match):
                raise InputError("no match is called so")
            return await self._pit.fetch_journal(match)

        return await self._answer(request, fetch)

    async def open(self, request: Request) -> Response:
        """Answer with what is made of the file that was sent."""
        return await self._answer(request, lambda: read_body(request, _UPLOAD_S))

    async def _answer(self, request: Request, fetch: Callable[[], Awaitable[bytes]]) -> Response:
        try:
            form = FORMS.get(request.path_params["form"])
            if form is None:
                raise InputError(f"a recording can be had as {', '.join(FORMS)}")
            if self._n_asked[request.method] >= MOST_AT_ONCE:
                raise InputError("the server has its hands full with other recordings; try again in a moment")
            self._n_asked[request.method] += 1
            try:
                data = await fetch()
                async with self._making:
                    made = await asyncio.to_thread(form.make, data, request.query_params)
            finally:
                self._n_asked[request.method] -= 1
            return Response(made, media_type=form.media_type)
        except ArenaError as error:
            return JSONResponse({"error": str(error)})


async def read_body(request: Request, limit_s: float) -> bytes:
    """Return what a request carries; of what is too much, nothing is kept, and `InputError` says so once it has been sent.

    It says so too of what has not arrived within `limit_s`: whoever sends nothing must not keep others waiting.
    """
    kept, n_bytes = bytearray(), 0
    try:
        async with asyncio.timeout(limit_s):
            async for chunk in request.stream():
                n_bytes += len(chunk)
                if n_bytes <= MOST_BYTES:
                    kept += chunk
    except TimeoutError:
        raise InputError(f"the file did not arrive within {limit_s:.0f} s") from None
    except ClientDisconnect:
        raise InputError("the page went away before its file had arrived") from None
    if n_bytes > MOST_BYTES:
        raise InputError(f"the file has {n_bytes:,} bytes, and one of {MOST_BYTES:,} at most can be opened here")
    return bytes(kept)


def make_gif(data: bytes, query: QueryParams) -> bytes:
    """Return moving pictures of the ticks `first` to `last`, seen as `team` sees them."""
    team = query.get("team", "")
    first, last = (_read_tick(name, query.get(name, "")) for name in ("first", "last"))
    if team not in ("", *_VIEWS):
        raise InputError(f"the team is {team!r}; it must be blue or red")
    if not 0 <= last - first < MOST_GIF_TICKS:
        raise InputError(f"a GIF is made of 1 to {MOST_GIF_TICKS} ticks, and ticks {first} to {last} are not so many")
    if last > MOST_TICKS:
        raise InputError(f"a GIF shows ticks up to {MOST_TICKS:,} here; arena replay export has no bound")
    pictures = []
    for frame in islice(frames_of(read_recording(data), Team[team.upper()] if team else None), first, last + 1):
        side = len(frame.boards[0][1])
        pictures.append(draw(frame, max(_GIF_BOARD_PIXELS // side, 4)))
    if not pictures:
        raise InputError(f"the match was over before tick {first}")
    made = BytesIO()
    save_gif(pictures, made, _GIF_TICKS_PER_S)
    return made.getvalue()


def _read_tick(name: str, text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise InputError(f"{name} is {text[:20]!r}; it must be the number of a tick")
    return int(text)


def make_frames(data: bytes, _: QueryParams) -> bytes:
    """Return what a page draws, as JSON."""
    return bytes(JSONResponse(describe_recording(data)).body)


FORMS: dict[str, Form] = {
    "frames": Form(make=make_frames, media_type="application/json"),
    "journal": Form(make=lambda data, _: data, media_type="application/octet-stream"),
    "gif": Form(make=make_gif, media_type="image/gif"),
    "html": Form(make=lambda data, _: page_file(describe_recording(data)).encode(), media_type="text/html"),
}
