"""What is taken along from a replay: its journal, a GIF, a file that plays without a network, and a frame on another page."""

import asyncio
import subprocess
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.request import Request, urlopen

import pytest
from chromium import browser, says, visit
from PIL import Image
from serving import EVIL, PATIENCE_S, Archive, is_harmless, serving

from arena.annotations import Annotations
from arena.records.journal import Journal
from clients.web.recordings import MOST_AT_ONCE, MOST_GIF_TICKS

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "visit"]

Visit = Callable[..., "Page"]
Run = Callable[..., subprocess.CompletedProcess[str]]
MATCH = "0123456789abcdef"


def take(page: "Page", button: str, folder: Path) -> Path:
    with page.expect_download() as taken:
        page.get_by_role("button", name=button, exact=True).click()
    path = folder / taken.value.suggested_filename
    taken.value.save_as(path)
    return path


def test_a_replay_is_taken_along_as_journal_gif_and_page(
    replayed: str, data: bytes, journal: Journal, visit: Visit, tmp_path: Path
) -> None:
    page = visit(replayed)
    page.get_by_label("First tick of the GIF").fill("3")
    page.get_by_label("Last tick of the GIF").fill("7")

    assert take(page, "Journal", tmp_path).read_bytes() == data
    with Image.open(take(page, "GIF", tmp_path)) as image:
        assert (image.format, getattr(image, "n_frames", 1)) == ("GIF", 5)
    saved = take(page, "One HTML file", tmp_path)
    assert saved.name == f"{journal.header.blue}-against-{journal.header.red}.html"
    page.get_by_label("Last tick of the GIF").fill("2")
    page.get_by_role("button", name="GIF", exact=True).click()
    page.get_by_text("ticks 3 to 2 are not so many").wait_for()

    file = visit(saved.as_uri())
    says(file, "Every tick was played again and holds.")
    file.keyboard.press("ArrowRight")
    file.get_by_label("The truth at tick 1:").wait_for()
    file.wait_for_url("**?tick=1")
    for _ in range(4):
        file.keyboard.press("+")
    file.keyboard.press("Space")
    file.get_by_label(f"The truth at tick {len(journal.ticks)}:").wait_for()


def test_a_transcript_is_exported_as_a_page_with_what_its_bot_noted(
    here: Run, transcribe: Callable[..., Path], data: bytes, visit: Visit, tmp_path: Path
) -> None:
    def note(notes: Annotations, tick: int) -> None:
        notes.log(f"</main></script>{EVIL}", tick)

    transcript, out = transcribe(tmp_path / "a.transcript", note, data), tmp_path / "match.html"
    done = here("replay", "export", transcript, "--out", out)
    assert (done.returncode, done.stderr) == (0, "")
    page = visit(out.as_uri())

    page.get_by_role("list", name="The bot's log").get_by_text(f"</main></script>{EVIL} 0", exact=True).wait_for()
    assert is_harmless(page)
    assert "default-src 'none'" in (page.locator("meta[http-equiv]").get_attribute("content") or "")


@pytest.fixture
def other_page(tmp_path: Path) -> Iterator[Callable[[str], str]]:
    """Serve a page of somebody else that shows an address in a frame."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=tmp_path))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()

    def show(address: str) -> str:
        (tmp_path / "index.html").write_text(f'<!doctype html><link rel="icon" href="data:,"><iframe src="{address}"></iframe>')
        return f"http://127.0.0.1:{server.server_port}/"

    yield show
    server.shutdown()
    thread.join()
    server.server_close()


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None:
        pass


def test_a_match_is_embedded_in_a_page_of_another(
    home: str, browser: Any, other_page: Callable[[str], str], journal: Journal
) -> None:
    page = browser.new_page()
    page.goto(other_page(f"{home}/embed/match/{MATCH}?tick=4"))
    frame = page.frame_locator("iframe")

    frame.get_by_label("The truth at tick 4:").wait_for()
    frame.get_by_role("button", name="One tick on").click()
    frame.get_by_label("The truth at tick 5:").wait_for()
    assert frame.get_by_role("link").all_text_contents() == ["This match in the arena"]
    page.close()


@pytest.mark.parametrize(
    ("path", "sentence"),
    [
        ("gif/{match}", "first is ''; it must be the number of a tick"),
        ("gif/{match}?first=0&last=1e9", "last is '1e9'"),
        (f"gif/{{match}}?first=0&last={MOST_GIF_TICKS}", f"a GIF is made of 1 to {MOST_GIF_TICKS} ticks"),
        ("gif/{match}?first=900&last=910", "the match was over before tick 900"),
        ("gif/{match}?first=299999&last=300000", "a GIF shows ticks up to 20,000 here"),
        ("gif/{match}?first=0&last=1&team=green", "the team is 'green'"),
        ("exe/{match}", "a recording can be had as frames, journal, gif, html"),
        ("html/nobody", "there is no journal of a match nobody"),
        ("html/**", "no match is called so"),
        ("html/replay?league=x", "there is no league x"),
    ],
)
def test_what_cannot_be_had_is_said_in_a_sentence(home: str, path: str, sentence: str) -> None:
    with urlopen(f"{home}/api/download/{path.format(match=MATCH)}") as answer:
        assert sentence in answer.read().decode()


class SlowArchive(Archive):
    """An archive that hands out nothing until it may."""

    def __init__(self, journals: dict[str, bytes], n_expected: int) -> None:
        super().__init__(journals)
        self._n_missing = n_expected
        self._gate = asyncio.Event()
        self.are_all_here = threading.Event()

    async def fetch_journal(self, match: str) -> bytes:
        self._loop_of_server = asyncio.get_running_loop()
        self._n_missing -= 1
        if not self._n_missing:
            self.are_all_here.set()
        await self._gate.wait()
        return await super().fetch_journal(match)

    def release(self) -> None:
        self._loop_of_server.call_soon_threadsafe(self._gate.set)


def test_who_comes_while_many_recordings_are_made_is_asked_to_come_again(data: bytes) -> None:
    def ask(url: str | Request) -> bytes:
        with urlopen(url) as answer:
            return bytes(answer.read())

    pit = SlowArchive({MATCH: data}, MOST_AT_ONCE)
    with serving(pit) as home, ThreadPoolExecutor(MOST_AT_ONCE) as others:
        url = f"{home}/api/download/journal/{MATCH}"
        asked = [others.submit(ask, url) for _ in range(MOST_AT_ONCE)]
        assert pit.are_all_here.wait(PATIENCE_S)

        assert b"try again in a moment" in ask(url)
        own = Request(f"{home}/api/open/journal", data, {"Origin": home})
        assert ask(own) == data  # who opens a file waits for nobody who asks for another's, nor the other way about
        pit.release()
        assert [one.result(PATIENCE_S) for one in asked] == [data] * MOST_AT_ONCE
        assert ask(url) == data
