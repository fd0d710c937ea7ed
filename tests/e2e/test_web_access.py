"""Every page by keyboard alone, and as a screen reader is told of it."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from chromium import browser, says, visit
from commands import run_here

from arena.network.session import free_port

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "visit"]

Start = Callable[..., Any]
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


@pytest.fixture
def home(serve: Start, join: Start, tmp_path: Path) -> str:
    """Open a pit with its page, play a league and a match of the ladder; return where the page is."""
    league, page_port = tmp_path / "friday.toml", free_port()
    league.write_text(LEAGUE)
    run_here("tournament", "run", league, "--data", tmp_path)
    pit = serve("--web", page_port, "--ladder", "--turn-time", 60).wait_for("web page at ")
    players = [join("--policy", "rush", "--name", name) for name in ("ann", "bob")]
    assert [player.finish() for player in players] == [0, 0]
    pit.wait_for(" wins by ")
    return f"http://127.0.0.1:{page_port}"


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
    page.locator("section table").wait_for()
    assert '- region "Ladder"' in names(page)
    walk(page)
    page.locator(".results a").first.focus()
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
    assert "Replay of match 2, rush against random" in names(page)
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
