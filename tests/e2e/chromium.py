"""Headless Chromium, driven by playwright: Debian's `chromium` and the Python package; nothing is downloaded.

Without them these tests are skipped, and fail where ARENA_REQUIRE_ALL=1 promises that nothing is skipped.
"""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PATIENCE_MS = 60_000
REFUSED = "net::ERR_CONNECTION_REFUSED"
ABSENT = "status of 404"
WIDTHS = (390, 1440)


@pytest.fixture(scope="module")
def browser() -> Iterator["Browser"]:
    missing = "there is no chromium" if CHROMIUM is None else "there is no playwright" if find_spec("playwright") is None else ""
    if missing and os.environ.get("ARENA_REQUIRE_ALL") == "1":
        pytest.fail(f"{missing}, and ARENA_REQUIRE_ALL=1 allows no test to be skipped")
    if missing:
        pytest.skip(missing)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        root = ["--no-sandbox"] if os.geteuid() == 0 else []  # Chromium's sandbox refuses to serve root
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=root, timeout=PATIENCE_MS)
        yield chromium
        chromium.close()


@pytest.fixture
def visit(browser: "Browser") -> Iterator[Callable[..., "Page"]]:
    """Open pages, each in a browser profile of its own; at the end, nothing may have gone wrong on any of them.

    Nothing may have been written into the console but what the test `expects` there, as that a server is away for a while, and
    nothing asked of another host.
    """
    wrongs: list[str] = []
    hosts: set[str] = set()
    visited: set[str] = set()
    with ExitStack() as open_pages:

        def opened(url: str, *, width: int = 1440, scheme: Any = "light", script: str = "", expects: str = "") -> "Page":
            context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
            open_pages.callback(context.close)
            page = context.new_page()
            page.set_default_timeout(PATIENCE_MS)
            if script:
                page.add_init_script(script)
            page.on("console", lambda message: (expects and expects in message.text) or wrongs.append(message.text))
            page.on("pageerror", lambda error: wrongs.append(str(error)))
            page.on("request", lambda request: hosts.add(urlsplit(request.url).netloc))
            page.on("websocket", lambda socket: hosts.add(urlsplit(socket.url).netloc))
            visited.add(urlsplit(url).netloc)
            page.goto(url)
            return page

        yield opened
    assert wrongs == [], wrongs
    assert hosts <= visited, hosts - visited


def says(page: "Page", text: str) -> None:
    """Wait until a page says something in its state line."""
    page.locator(".state", has_text=text).wait_for()


@pytest.fixture(scope="session")
def axe() -> Callable[["Page", bool], str]:
    """Return what axe-core finds wrong on a page, rule by rule; of its colours alone, if it was judged in others before."""
    if find_spec("axe_playwright_python") is None:
        if os.environ.get("ARENA_REQUIRE_ALL") == "1":
            pytest.fail("there is no axe-playwright-python, and ARENA_REQUIRE_ALL=1 allows no test to be skipped")
        pytest.skip("there is no axe-playwright-python")
    from axe_playwright_python.sync_playwright import Axe

    judge = Axe()

    def find_faults(page: "Page", colours_alone: bool = False) -> str:
        options = {"resultTypes": ["violations"]}
        results = judge.run(page, options=options | ({"runOnly": ["color-contrast"]} if colours_alone else {}))
        return results.generate_report() if results.violations_count else ""

    return find_faults
