"""Every page by keyboard alone, as a screen reader is told of it, as axe-core judges it, and as it fits telephones and desks."""

import json
import re
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from chromium import ABSENT, axe, browser, says, visit
from commands import run_here
from made_seasons import keep_table, make_season, play_pairs, submit

from arena.network.address import free_port
from arena.protocol.identity import Identity
from arena.protocol.page_token import make_page_link, make_page_token
from arena.records.journal_folder import load_journal
from tournaments.store.season_store import SeasonStore

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["axe", "browser", "visit"]

Start = Callable[..., Any]
ANN = Identity.make()
CONTROLS = "a[href], button, input, select, summary"
FOCUSED = """
() => {
  const one = document.activeElement;
  const { outlineStyle, outlineWidth } = getComputedStyle(one);
  return [one.matches("body") ? "" : one.outerHTML, outlineStyle === "solid" && parseFloat(outlineWidth) >= 2];
}
"""
COUNT = f"""
() => [...document.querySelectorAll("{CONTROLS}")].filter(
  (one) => !one.disabled && !one.classList.contains("skip") && one.checkVisibility()
).length
"""
NAMELESS = re.compile(r"^\s*- (button|link|textbox|combobox|checkbox|slider|img|table|region)(?! \")", re.MULTILINE)
LEAGUE = 'pairs = 1\nseed = 3\n[rules]\nside = 10\ntick_limit = 20\n[entries]\nrush = "rush"\nrandom = "random"\n'

WIDTHS = (1280, 390)
PAGES = {
    "lobby": ("/", "ann"),
    "lobby before the first match": ("/", "No match"),
    "match": ("/match/{match}", "Every tick was played again and holds."),
    "embedded match": ("/embed/match/{match}", "This match in the arena"),
    "open": ("/open", "Drop a journal"),
    "before a match": ("/play", "Take a seat"),
    "in a match": ("/play", "Take a seat"),
    "league": ("/league", "2 of 2 matches"),
    "ladder": ("/league?ladder=pit", "The ladder of the pit"),
    "head to head": ("/league/head-to-head?league=friday&a=rush&b=random", "rush scored"),
    "season": ("/seasons/course", "The season is open"),
    "entry of a season": ("/seasons/course/ann", "Version 3 plays"),
    "its owner's view": ("/seasons/course/ann#token={token}", "The last submission is checked next"),
    "rules": ("/rules", "How a match is won"),
    "absent": ("/nowhere", "There is no such page"),
}
"""By name: an address, and what the page says once its data are there."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pit")


def open_pit(start: Start, folder: Path) -> tuple[Start, str]:
    """Open a pit with a ladder and a page; return what starts an entry of it, and where the page is."""
    pit_port, page_port = free_port(), free_port()
    pit = ("serve", "--listen", f"tcp/127.0.0.1:{pit_port}", "--data", folder, "--seed", 7, "--ladder", "--turn-time", 60)
    start(*pit, "--web", page_port).wait_for("web page at ")
    return partial(start, "join", f"arena://127.0.0.1:{pit_port}/pit"), f"http://127.0.0.1:{page_port}"


@pytest.fixture(scope="module")
def home(shared_start: Start, data: Path) -> str:
    """Open a pit with its page, play a league and a match of the ladder; return where the page is."""
    with SeasonStore(str(data / "arena.db")) as store:
        season = make_season(store, {"ann": ANN.fingerprint, "bob": "bob"}, 3)
        play_pairs(store, season, list(season.definition["entries"]), 4)
        keep_table(store, season, deadline_s=time.time() + 86_400, new={"bob.3"})
        submit(store, season, "ann", ANN.fingerprint, "it dies in tick 3")
        submit(store, season, "ann", ANN.fingerprint)
    (data / "journals" / "course").mkdir(parents=True)
    (data / "journals" / "course" / "ann.3.log").write_text("What it wrote.\n" * 100)
    league = data / "friday.toml"
    league.write_text(LEAGUE)
    run_here("tournament", "run", league, "--data", data)
    join, url = open_pit(shared_start, data)
    players = [join("--policy", "rush", "--name", name) for name in ("ann", "bob")]
    assert [player.finish() for player in players] == [0, 0]
    return url


@pytest.fixture(scope="module")
def empty_home(shared_start: Start, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Open a pit in which nobody played."""
    return open_pit(shared_start, tmp_path_factory.mktemp("empty"))[1]


def walk(page: "Page") -> None:
    """Press Tab from the top of the page to its end; each control must be met, and seen to be."""
    page.locator(".skip").focus()
    n_controls, met = page.evaluate(COUNT), []
    for _ in range(3 * n_controls):
        page.keyboard.press("Tab")
        focused, is_seen = page.evaluate(FOCUSED)
        if not focused or "skip" in focused:
            break
        assert is_seen, f"nothing shows that the focus is on {focused}"
        met.append(focused)
    assert len([one for one in met if "tabindex" not in one]) >= n_controls, met


def names(page: "Page") -> str:
    """Return what a screen reader is told; whatever can be used must have a name."""
    tree = page.locator("body").aria_snapshot()
    assert not NAMELESS.search(tree), tree
    return tree


def test_every_page_is_used_by_keyboard_and_named(home: str, visit: Start) -> None:
    page = visit(f"{home}/")
    says(page, "is open")
    page.get_by_role("region", name="Ladder").wait_for()
    assert '- region "Ladder"' in names(page)
    walk(page)
    page.get_by_role("link", name="Replay of").first.focus()
    page.keyboard.press("Enter")

    says(page, "Every tick was played again and holds.")
    page.locator("summary").focus()
    page.keyboard.press("Enter")
    tree = names(page)
    assert re.search(r"- status:\n\s+- text: tick 0 of 100|- status: tick 0 of 100", tree), tree
    for name in ('slider "Tick"', 'button "One tick on"', 'combobox "Ticks per second"', 'img "The truth at tick 0'):
        assert name in tree
    walk(page)
    page.get_by_role("button", name="red UGV 1").focus()
    assert (page.locator(".events").text_content() or "").startswith("red UGV 1: sight 3, attack 2")
    page.keyboard.press("ArrowRight")
    assert (page.locator(".events").text_content() or "").startswith("red UGV 1: sight 3, attack 2")
    assert page.get_by_role("button", name="red UGV 1").evaluate("it => it === document.activeElement")

    page.goto(f"{home}/league")
    says(page, "2 of 2 matches")
    page.get_by_role("button", name="rush against random").focus()
    page.keyboard.press("Enter")
    page.get_by_role("table", name="Matches").wait_for()
    assert names(page).count('link "Replay of rush against random') == 1
    walk(page)

    page.goto(make_page_link(ANN, home, "course", "ann", time.time()))
    page.get_by_text("The end of its log").wait_for()
    page.get_by_text("The end of its log").press("Enter")
    page.get_by_role("region", name="Log").wait_for()
    names(page)
    walk(page)


def test_a_seat_is_taken_and_played_by_keyboard_and_told_of(serve: Start, visit: Start) -> None:
    page_port = free_port()
    serve("--web", page_port, "--turn-time", 60).wait_for("web page at ")
    page = visit(f"http://127.0.0.1:{page_port}/play")
    page.locator("form").wait_for()
    names(page)
    walk(page)
    page.get_by_label("Team").press("r")  # red
    page.get_by_label("Name").press("Enter")
    says(page, "Your turn")

    tree = names(page)
    assert re.search(r"- timer: \d+ s left", tree), tree
    assert "tick 0 of 100" in tree
    assert re.search(r"- status: \"?In sight: .* The flag to capture is (not found yet|at \d+, \d+)\.", tree), tree
    walk(page)
    page.locator("h1").click()
    page.keyboard.press("Enter")
    page.locator(".score", has_text="tick 1 of 100").first.wait_for()


@pytest.mark.parametrize("name", PAGES)
def test_a_page_has_no_fault_that_axe_finds_and_fits(
    name: str, home: str, empty_home: str, data: Path, visit: Start, axe: Callable[["Page", bool], str]
) -> None:
    path, text = PAGES[name]
    match = next(load_journal(path).name for path in (data / "journals").glob("*.journal"))
    url = empty_home if "before the first" in name else home
    address = path.format(match=match, token=make_page_token(ANN, url.removeprefix("http://"), "course", time.time()))
    page = visit(url + address, width=WIDTHS[0], expects=ABSENT if name == "absent" else "")
    page.get_by_text(text).first.wait_for()
    if name == "in a match":
        page.get_by_role("button", name=text).click()
        page.locator("canvas").first.wait_for()

    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            assert axe(page, scheme == "dark") == "", f"{width} pixels, {scheme}"
            assert page.evaluate("document.documentElement.scrollWidth") == width


def test_an_address_of_nothing_is_answered_with_a_page_and_to_a_program_with_json(empty_home: str) -> None:
    answers = {}
    for path in ("/nowhere", "/api/nowhere"):
        with pytest.raises(HTTPError) as refused:
            urlopen(empty_home + path)
        answers[path] = refused.value.code, refused.value.headers.get_content_type(), refused.value.read().decode()
        refused.value.close()

    assert [answer[:2] for answer in answers.values()] == [(404, "text/html"), (404, "application/json")]
    assert 'href="/"' in answers["/nowhere"][2]
    assert json.loads(answers["/api/nowhere"][2]) == {"error": "there is no /api/nowhere"}
