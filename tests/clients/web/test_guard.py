"""Who may ask the web server, and what a browser may do with its answers."""

import asyncio
from collections.abc import MutableMapping
from pathlib import Path
from typing import Any

import pytest

from clients.web.guard import HEADERS, LOOPBACK, Guard, is_same_origin
from clients.web.routes import ASSETS

MOST_FIRST_LOAD_BYTES = 150_000


def ask(kind: str, **headers: str) -> tuple[bool, list[MutableMapping[str, Any]]]:
    """Return whether the guarded server was reached, and what was sent."""
    sent: list[MutableMapping[str, Any]] = []
    reached = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        reached.append(scope["type"])
        if kind == "http":
            await send({"type": "http.response.start", "status": 200, "headers": [(b"x", b"y")]})

    async def receive() -> MutableMapping[str, Any]:
        return {"type": "websocket.connect"}

    async def send(message: MutableMapping[str, Any]) -> None:
        sent.append(message)

    scope = {"type": kind, "headers": [(name.encode(), value.encode()) for name, value in headers.items()]}
    asyncio.run(Guard(app, LOOPBACK)(scope, receive, send))
    return bool(reached), sent


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost", "LOCALHOST:1", "[::1]:8000", "[::1]"])
def test_the_server_answers_by_its_own_names_under_a_strict_policy(host: str) -> None:
    reached, sent = ask("http", host=host)

    assert reached
    headers = dict(sent[0]["headers"])
    assert headers[b"x"] == b"y"
    assert {name: headers[name.encode()].decode() for name in HEADERS} == HEADERS
    assert headers[b"content-security-policy"].startswith(b"default-src 'none'; script-src 'self';")
    assert b"unsafe" not in headers[b"content-security-policy"]


@pytest.mark.parametrize("host", ["evil.example:8000", "", "127.0.0.1.evil.example", "::1"])
def test_a_strangers_name_that_was_made_to_point_here_is_refused(host: str) -> None:
    reached, sent = ask("http", host=host)

    assert not reached
    assert sent[0]["status"] == 421


def test_a_websocket_comes_from_a_page_of_this_server() -> None:
    reached, sent = ask("websocket", host="127.0.0.1:8000", origin="http://127.0.0.1:8000")

    assert reached
    assert sent == []


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "127.0.0.1:8000", "origin": "http://evil.example"},
        {"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8001"},
        {"host": "127.0.0.1:8000", "origin": "null"},
        {"host": "127.0.0.1:8000"},
        {"host": "evil.example", "origin": "http://evil.example"},
    ],
)
def test_a_websocket_from_anywhere_else_is_closed_before_it_is_open(headers: dict[str, str]) -> None:
    reached, sent = ask("websocket", **headers)

    assert not reached
    assert [message["type"] for message in sent] == ["websocket.close"]


@pytest.mark.parametrize(
    "origin",
    ["", "null", "file://", "http://", "http://127.0.0.1:8000/a", "ftp://127.0.0.1:8000", "http://[", "127.0.0.1:8000"],
)
def test_what_is_no_origin_of_a_page_here_is_none(origin: str) -> None:
    assert is_same_origin("http://127.0.0.1:8000", "127.0.0.1:8000")
    assert not is_same_origin(origin, "127.0.0.1:8000")


def test_all_that_any_page_loads_is_small() -> None:
    assert sum(path.stat().st_size for path in ASSETS.iterdir()) < MOST_FIRST_LOAD_BYTES


@pytest.mark.parametrize("path", sorted(ASSETS.iterdir()), ids=lambda path: path.name)
def test_no_asset_makes_markup_of_text_or_names_another_host(path: Path) -> None:
    text = path.read_text(encoding="utf-8").replace("http://www.w3.org/", "")  # the names of SVG, which nobody fetches

    assert not [word for word in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(") if word in text]
    assert "//" not in "".join(line.partition("// ")[0].replace("://${location.host}", "") for line in text.splitlines())
