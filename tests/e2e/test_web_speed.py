"""How fast the page is: the size of a first load, the time to the first board, and the frames of a second at 60 ticks a second.

The size is held to its bound. Times depend on the machine, so they are logged and not judged:
`ARENA_TEST_SIZE=full pytest tests/e2e/test_web_speed.py --log-cli-level INFO`.
"""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chromium import browser, says, visit

from arena.records.journal_folder import load_journal

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "visit"]

logger = logging.getLogger(__name__)

Start = Callable[..., Any]
MOST_BYTES = 150_000
BOT = "def act(observation):\n    return [1 + observation.tick % 4] * len(observation.units)\n"
"""Nobody comes near the enemy, so the match has all its ticks."""
FIRST_BOARD = """
window.firstBoardMs = new Promise((resolve) => {
  const look = () => {
    const boards = [...document.querySelectorAll("figure canvas")];
    const isDrawn = (board) => board.getContext("2d").getImageData(board.width / 2, board.height / 2, 1, 1).data[3] > 0;
    if (boards.length === 3 && boards.every(isDrawn)) resolve(performance.now());
    else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
});
"""
"""Promises the time when all boards were drawn, in milliseconds since the visit began."""
COUNT_FRAMES = """
() => new Promise((resolve) => {
  const timeline = document.querySelector(".timeline");
  let [nFrames, nChanges, longest, before, shown] = [0, 0, 0, 0, timeline.value];
  const begin = performance.now();
  const count = (now) => {
    nFrames += 1;
    if (timeline.value !== shown) nChanges += 1;
    shown = timeline.value;
    if (before) longest = Math.max(longest, now - before);
    before = now;
    if (document.querySelector("button.main").textContent === "Pause") requestAnimationFrame(count);
    else resolve({ seconds: (performance.now() - begin) / 1000, nFrames, nChanges, longest });
  };
  requestAnimationFrame(count);
})
"""


def first_board_s(page: "Page") -> float:
    return float(page.evaluate("window.firstBoardMs")) / 1_000


def loaded_bytes(page: "Page") -> int:
    """Return what came over the wire for a page, headers with it, as its browser counted."""
    kinds = ("navigation", "resource")
    sizes = [
        size for kind in kinds for size in page.evaluate(f"performance.getEntriesByType('{kind}').map(it => it.transferSize)")
    ]
    assert len(sizes) > 5, "the page has a style and modules"
    return sum(sizes)


def test_a_first_load_is_small_and_what_is_fast_is_logged(
    serve: Start, join: Start, start: Start, visit: Start, port: int, tmp_path: Path, size: Callable[[int, int], int]
) -> None:
    n_ticks = size(60, 600)
    bot = tmp_path / "round.py"
    bot.write_text(BOT)
    pit = serve("--turn-time", 60, "--set", f"tick_limit={n_ticks}")
    players = [join("--team", team, "--policy", bot, "--name", name) for team, name in (("blue", "ann"), ("red", "bob"))]
    assert [player.finish() for player in players] == [0, 0]
    pit.wait_for("blue ann, red bob: ")
    (journal,) = map(load_journal, (tmp_path / "journals").glob("*.journal"))
    web = start("web", "--pit", f"arena://127.0.0.1:{port}/pit", "--port", 0, "--data", tmp_path / "web")
    home = web.wait_for("web page at ").said.partition("web page at ")[2].split("/\n")[0]
    address = f"{home}/match/{journal.name}"

    for number in ("first", "second"):
        page = visit(address, script=FIRST_BOARD)
        logger.info("the %s visit saw its boards after %.2f s", number, first_board_s(page))
        n_bytes = loaded_bytes(page)
        logger.info("it loaded %d bytes", n_bytes)
        assert n_bytes < MOST_BYTES
    page.reload()
    logger.info("and after it was loaded again, after %.2f s", first_board_s(page))
    says(page, "Every tick was played again and holds.")
    for _ in range(4):
        page.keyboard.press("+")
    assert page.get_by_label("Ticks per second").input_value() == "60"
    page.keyboard.press("Space")
    counted = page.evaluate(COUNT_FRAMES)

    assert page.get_by_label("Tick", exact=True).input_value() == str(n_ticks)
    assert counted["nChanges"] > 0
    logger.info(
        "%d ticks at 60 a second: %.1f frames and %.1f boards a second, the longest frame %.0f ms",
        n_ticks, counted["nFrames"] / counted["seconds"], counted["nChanges"] / counted["seconds"], counted["longest"],
    )  # fmt: skip
