"""Who may ask the web server, and what a browser may do with its answers."""

import asyncio
from collections.abc import Iterable, MutableMapping
from pathlib import Path
from typing import Any

import pytest
from starlette.requests import Request

from arena.errors import InputError
from clients.web.guard import HEADERS, LOOPBACK, Guard, is_same_origin, list_names
from clients.web.recordings import read_body
from clients.web.routes import ASSETS

MOST_FIRST_LOAD_BYTES = 150_000


def ask(
    kind: str, method: str = "GET", path: str = "/", names: Iterable[str] = LOOPBACK, **headers: str
) -> tuple[bool, list[MutableMapping[str, Any]]]:
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

    scope = {
        "type": kind,
        "method": method,
        "path": path,
        "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
    }
    asyncio.run(Guard(app, names)(scope, receive, send))
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


@pytest.mark.parametrize(("host", "name"), [("fd00::5", ""), ("FD00:0::5", ""), ("::", "fd00::5"), ("0.0.0.0", "[fd00::5]")])
def test_a_server_is_reached_by_a_number_of_ipv6(host: str, name: str) -> None:
    names = list_names(host, [name] if name else [])

    assert [ask("http", names=names, host=asked)[0] for asked in ("[fd00::5]:8000", "[fd00::6]:8000")] == [True, False]


def test_pages_of_others_may_show_an_embedded_match_and_nothing_else() -> None:
    policies = {
        path: dict(ask("http", path=path, host="localhost")[1][0]["headers"])[b"content-security-policy"].decode()
        for path in ("/", "/match/1", "/embed/match/1", "/embedded", "/api/open/frames")
    }

    assert {path for path, policy in policies.items() if "frame-ancestors 'none'" not in policy} == {"/embed/match/1"}
    assert policies["/embed/match/1"].replace("frame-ancestors *", "frame-ancestors 'none'") == policies["/"]


@pytest.mark.parametrize(
    ("origin", "is_let_in"), [("http://localhost:8000", True), ("http://evil.example", False), ("null", False), ("", False)]
)
def test_only_a_page_of_this_server_may_send_something_along(origin: str, is_let_in: bool) -> None:
    reached, sent = ask("http", method="POST", host="localhost:8000", origin=origin)

    assert reached == is_let_in
    assert sent[0]["status"] == (200 if is_let_in else 403)


@pytest.mark.parametrize(
    ("site", "mode", "is_let_in"),
    [
        ("cross-site", "no-cors", False),
        ("same-site", "cors", False),
        ("cross-site", "navigate", True),
        ("same-origin", "cors", True),
        ("none", "navigate", True),
    ],
)
def test_no_page_of_others_loads_a_part_of_this_server(site: str, mode: str, is_let_in: bool) -> None:
    fetch = {"sec-fetch-site": site, "sec-fetch-mode": mode}
    reached, _ = ask("http", path="/api/download/gif/1", host="localhost", **fetch)

    assert reached == is_let_in


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


@pytest.mark.parametrize(("said", "sentence"), [(None, "did not arrive within 0 s"), ("http.disconnect", "the page went away")])
def test_a_file_that_never_arrives_is_given_up(said: str | None, sentence: str) -> None:
    async def receive() -> dict[str, Any]:
        if said is None:
            await asyncio.Event().wait()
        return {"type": said}

    with pytest.raises(InputError, match=sentence):
        asyncio.run(read_body(Request({"type": "http"}, receive), 0 if said is None else 30))
