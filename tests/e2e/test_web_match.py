"""Matches in the browser: as they run, with the spectator key and without, and replayed, against a real `arena serve --web`."""

import re
import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from chromium import WIDTHS, browser, says, visit

from arena.game.types import Team
from arena.keyring.files import load_or_make_secret
from arena.protocol.identity import to_text
from arena.records.journal import Journal, load_journal, match_id
from arena.referee.replay import replay
from arena.transport import free_port

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "visit"]

Start = Callable[..., Any]
SIDE = 10
N_TICKS = 40
N_LONG = 400
"""More than are played while a web server is killed and started again."""
SIZES = "[...document.querySelectorAll('canvas')].map(it => [[it.width, it.height], it.clientWidth, it.clientHeight])"
MOST_OF_WIDTH = 0.55
"""That a board takes of a telephone's width, and of a desk screen's height."""
BOT = """
import threading
from pathlib import Path


def act(observation):
    if observation.tick == 0:
        print("begun", flush=True)
    if not Path({go!r}).exists():  # slow, until whoever watches was seen to watch
        threading.Event().wait(0.25)
    return [3 if observation.tick % 2 else 1] * len(observation.units)
"""
RULES = ("--turn-time", 60, "--set", f"side={SIDE}", "--set", f"tick_limit={N_TICKS}")


@pytest.fixture
def web(serve: Start) -> Callable[..., tuple[Any, str]]:
    """Open a pit with its page; return it, and where its page is."""

    def begin(*arguments: object) -> tuple[Any, str]:
        page_port = free_port()
        pit = serve("--web", page_port, *RULES, *arguments)
        return pit.wait_for("web page at "), f"http://127.0.0.1:{page_port}"

    return begin


def only_journal(tmp_path: Path) -> Journal:
    (journal,) = map(load_journal, (tmp_path / "journals").glob("*.journal"))
    return journal


def places(journal: Journal, tick: int) -> list[list[str]]:
    """Return the rows that the page's table of units should have at a tick."""
    games = next(game for number, game in enumerate(replay(journal)) if number == tick)
    rows = []
    for team in Team:
        first = games.n_units[Team.BLUE] if team is Team.RED else 0
        for index, kind in enumerate(journal.header.ruleset.team(team)):
            cell, alive = int(games.state.cell[0, first + index]), games.state.alive[0, first + index]
            name = f"{team.name.lower()} {kind.name.upper()} {index}"
            rows.append([name, str(cell // SIDE), str(cell % SIDE), "lives" if alive else "fallen"])
    return rows


def table_of(page: "Page") -> list[list[str]]:
    rows = page.locator("details tbody tr").all()
    return [row.locator("th, td").all_text_contents() for row in rows]


def test_a_match_is_watched_with_the_key_and_without_and_replayed(web: Start, join: Start, visit: Start, tmp_path: Path) -> None:
    bot, go = tmp_path / "slow.py", tmp_path / "go"
    bot.write_text(BOT.format(go=str(go)))
    key = to_text(load_or_make_secret(tmp_path / "keys" / "spectator.key"))
    _, url = web()
    lobby = visit(f"{url}/")
    says(lobby, "is open")
    players = [join("--team", team, "--policy", bot, "--name", name) for team, name in (("blue", "ann"), ("red", "bob"))]
    players[0].wait_for("begun")

    lobby.get_by_role("link", name="Watch ann against bob").click()
    match = lobby.url.rpartition("/")[2]
    says(lobby, "only holders of the spectator key see its boards")
    knows = visit(f"{url}/match/{match}#key={key}")
    stranger = visit(f"{url}/match/{match}#key={to_text(bytes(32))}")
    says(knows, "this page sees it with the spectator key")
    says(stranger, "Wrong key")
    assert key not in knows.url
    for page in (lobby, stranger):
        page.locator(".score", has_text=re.compile(rf"tick \d+ of {N_TICKS}")).wait_for()
        assert page.locator("canvas").count() == 0
    seen = knows.get_by_role("img").nth(1).get_attribute("aria-label")
    assert seen is not None
    assert seen.startswith("The truth at tick ")
    go.touch()

    for page in (lobby, knows, stranger):
        says(page, f"after {N_TICKS} ticks")
        says(page, "Every tick was played again and holds.")
        assert page.get_by_role("heading", level=1).text_content() == "ann against bob"
    assert [player.finish() for player in players] == [0, 0]
    assert match == match_id(only_journal(tmp_path).header.identity)


@pytest.fixture
def played(web: Start, join: Start, tmp_path: Path) -> tuple[str, Journal]:
    """Play a match; return where it is replayed, and its journal."""
    pit, url = web()
    players = [join("--team", team, "--policy", "random", "--name", name) for team, name in (("blue", "ann"), ("red", "bob"))]
    assert [player.finish() for player in players] == [0, 0]
    pit.wait_for("blue ann, red bob: ")
    journal = only_journal(tmp_path)
    return f"{url}/match/{match_id(journal.header.identity)}", journal


def test_a_replay_is_scrubbed_stepped_and_played_by_keys(played: tuple[str, Journal], visit: Start) -> None:
    url, journal = played
    page = visit(url)
    says(page, "Every tick was played again and holds.")
    page.get_by_text("Units as a table").click()
    timeline, last = page.get_by_label("Tick", exact=True), len(journal.ticks)

    assert table_of(page) == places(journal, 0)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert table_of(page) == places(journal, 2)
    page.keyboard.press("ArrowLeft")
    assert table_of(page) == places(journal, 1)
    timeline.fill(str(last // 2))
    assert table_of(page) == places(journal, last // 2)
    page.keyboard.press("End")
    assert table_of(page) == places(journal, last)
    page.keyboard.press("Home")
    page.keyboard.press("t")
    assert page.get_by_role("img").first.get_attribute("aria-label") == "What red sees at tick 0"
    for _ in range(4):
        page.keyboard.press("+")
    assert page.get_by_label("Ticks per second").input_value() == "60"
    page.keyboard.press("Space")
    page.get_by_role("button", name="Pause").wait_for(state="detached")
    assert timeline.input_value() == str(last)
    assert table_of(page) == places(journal, last)


def test_pointing_at_a_unit_tells_what_it_can_do(played: tuple[str, Journal], visit: Start) -> None:
    url, journal = played
    page = visit(url)
    truth = page.get_by_role("img").nth(1)
    box = truth.bounding_box()
    assert box is not None
    name, row, column, _ = places(journal, 0)[0]

    truth.hover(position={"x": (int(column) + 0.5) * box["width"] / SIDE, "y": (int(row) + 0.5) * box["height"] / SIDE})

    page.locator(".events", has_text=f"{name}: sight 3, attack 2").wait_for()


def test_every_page_fits_a_telephone_and_a_desk_by_day_and_by_night(played: tuple[str, Journal], visit: Start) -> None:
    url, _ = played
    home = url.partition("/match")[0]
    for width in WIDTHS:
        pages = [("light", url), ("dark", url), ("light", f"{home}/"), ("light", f"{home}/play"), ("dark", f"{home}/league")]
        for scheme, address in pages:
            page = visit(address, width=width, scheme=scheme)
            page.locator(".state").wait_for()
            page.wait_for_load_state("networkidle")
            assert page.evaluate("document.documentElement.scrollWidth") == width
            for pixels, wide, high in page.evaluate(SIZES):
                assert pixels == [wide, wide] == [high, high]
                assert wide >= MOST_OF_WIDTH * min(width, page.viewport_size["height"])


def test_a_match_that_nobody_knows_is_said_and_the_lobby_offered(web: Start, visit: Start) -> None:
    _, url = web()

    page = visit(f"{url}/match/0123456789abcdef")

    says(page, "there is no journal of a match 0123456789abcdef")
    page.get_by_role("link", name="To the lobby").click()
    says(page, "is open")


def test_a_page_says_that_the_pit_is_away_and_finds_it_again(
    serve: Start, start: Start, visit: Start, port: int, tmp_path: Path
) -> None:
    pit = serve()
    web = start("web", "--pit", f"arena://127.0.0.1:{port}/pit", "--port", 0, "--data", tmp_path / "web")
    said = web.wait_for("web page at ").said
    page = visit(said.partition("web page at ")[2].split()[0])
    says(page, "is open")

    pit.send(signal.SIGKILL)
    says(page, "The pit is away")
    pit.finish()
    serve()

    says(page, "is open")
    web.send(signal.SIGTERM)
    assert web.finish() in (0, -signal.SIGTERM)


def test_a_page_that_watches_a_match_outlives_its_web_server(
    serve: Start, start: Start, join: Start, visit: Start, port: int, tmp_path: Path
) -> None:
    bot, go = tmp_path / "slow.py", tmp_path / "go"
    bot.write_text(BOT.format(go=str(go)))
    serve(*RULES[:-1], f"tick_limit={N_LONG}")
    key = to_text(load_or_make_secret(tmp_path / "keys" / "spectator.key"))
    players = [join("--team", team, "--policy", bot, "--name", name) for team, name in (("blue", "ann"), ("red", "bob"))]
    match = players[0].wait_for("begun").said.partition("match ")[2].partition(":")[0]
    page_port = free_port()
    web = ("web", "--pit", f"arena://127.0.0.1:{port}/pit", "--port", page_port, "--data", tmp_path / "web")
    first = start(*web).wait_for("web page at ")
    page = visit(f"http://127.0.0.1:{page_port}/match/{match}#key={key}", is_server_away=True)
    says(page, "this page sees it with the spectator key")

    first.kill()
    says(page, "The web server is gone; looking for it...")
    assert page.locator("canvas").count() == 2
    start(*web).wait_for("web page at ")
    says(page, "this page sees it with the spectator key")
    go.touch()

    says(page, f"after {N_LONG} ticks")
    says(page, "Every tick was played again and holds.")
    assert [player.finish() for player in players] == [0, 0]


def test_the_page_ends_with_its_pit_however_that_ends(web: Start, visit: Start) -> None:
    pit, url = web()
    page = visit(f"{url}/")
    says(page, "is open")
    page.goto("about:blank")

    pit.kill()  # and waits for all that hold its stdout: the page's server too

    assert "Traceback" not in pit.said
