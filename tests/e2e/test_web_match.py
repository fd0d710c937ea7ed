"""Matches in the browser: as they run, with the spectator key and without, and replayed, against a real `arena serve --web`."""

import re
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from chromium import REFUSED, WIDTHS, browser, says, visit

from arena.game.types import Action, Team
from arena.keyring.files import load_or_make_secret
from arena.network.address import free_port, parse_address
from arena.protocol.identity import to_text
from arena.records.journal import Journal
from arena.records.journal_folder import load_journal
from arena.records.replay import replay

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "visit"]

Start = Callable[..., Any]
SIDE = 10
N_TICKS = 40
N_LONG = 400
"""More than are played while a web server is killed and started again."""
SIZES = """
[...document.querySelectorAll("figure:not([hidden]) canvas")]
  .map((it) => [[it.width, it.height], it.clientWidth, it.clientHeight])
"""
MOST_OF_WIDTH = 0.5
"""That a board takes of a telephone's width, and each of three of a desk screen's height."""
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


@pytest.fixture(scope="module")
def shared(shared_start: Start, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str, Path]:
    """Open a pit with its page for all tests that leave it as it is; return its address, where its page is, and its data."""
    folder, pit_port, page_port = tmp_path_factory.mktemp("pit"), free_port(), free_port()
    pit = ("serve", "--listen", f"tcp/127.0.0.1:{pit_port}", "--data", folder, "--seed", 7, "--web", page_port, *RULES)
    shared_start(*pit).wait_for("web page at ")
    return f"arena://127.0.0.1:{pit_port}/pit", f"http://127.0.0.1:{page_port}", folder


def find_journal(folder: Path, blue: str) -> Journal:
    """Return the only journal of whoever played blue."""
    journals = map(load_journal, (folder / "journals").glob("*.journal"))
    (journal,) = (journal for journal in journals if journal.header.blue == blue)
    return journal


def places(journal: Journal, tick: int) -> list[list[str]]:
    """Return the rows that the page's table of units should have at a tick."""
    games = next(game for number, game in enumerate(replay(journal)) if number == tick)
    orders = journal.ticks[tick].orders if tick < len(journal.ticks) else None
    rows = []
    for team in Team:
        first = games.n_units[Team.BLUE] if team is Team.RED else 0
        for index, kind in enumerate(journal.header.ruleset.team(team)):
            cell, alive = int(games.state.cell[0, first + index]), games.state.alive[0, first + index]
            name = f"{team.name.lower()} {kind.name.upper()} {index}"
            order = "" if orders is None or not alive else Action(orders[first + index]).name.lower()
            rows.append([name, str(cell // SIDE), str(cell % SIDE), "lives" if alive else "fallen", order])
    return rows


def table_of(page: "Page") -> list[list[str]]:
    rows = page.locator("details tbody tr").all()
    return [row.locator("th, td").all_text_contents() for row in rows]


def count_connections(port: int) -> int:
    """Return how many connections to a port of this machine stand."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return sum(row[1].endswith(f":{port:04X}") and row[3] == "01" for row in rows)


def test_a_match_is_watched_with_the_key_and_without_and_replayed(
    shared: tuple[str, str, Path], start: Start, visit: Start, tmp_path: Path
) -> None:
    bot, go = tmp_path / "slow.py", tmp_path / "go"
    bot.write_text(BOT.format(go=str(go)))
    address, url, data = shared
    key = to_text(load_or_make_secret(data / "keys" / "spectator.key"))
    lobby = visit(f"{url}/")
    says(lobby, "is open")
    seats = (("blue", "eve"), ("red", "kim"))
    players = [start("join", address, "--team", team, "--policy", bot, "--name", name) for team, name in seats]
    players[0].wait_for("begun")

    lobby.get_by_role("link", name="Watch eve against kim").click()
    match = lobby.url.rpartition("/")[2]
    says(lobby, "only holders of the spectator key see its boards")
    knows = visit(f"{url}/match/{match}#key={key}")
    stranger = visit(f"{url}/match/{match}#key={to_text(bytes(32))}")
    says(knows, "this page sees it with the spectator key")
    says(stranger, "Wrong key")
    assert key not in knows.url
    if sys.platform == "linux":
        at_pit = count_connections(int(parse_address(address).endpoint.rpartition(":")[2]))
        assert at_pit == len(players) + 1, "however many browsers the page serves, the pit has one spectator"
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
        assert page.get_by_role("heading", level=1).text_content() == "eve against kim"
    assert [player.finish() for player in players] == [0, 0]
    assert match == find_journal(data, "eve").name


def test_a_pit_that_shows_its_boards_late_shows_them_to_everyone_and_tells_its_entries(
    start: Start, visit: Start, tmp_path: Path
) -> None:
    bot, go, pit_port, page_port = tmp_path / "slow.py", tmp_path / "go", free_port(), free_port()
    bot.write_text(BOT.format(go=str(go)))
    pit = ("serve", "--listen", f"tcp/127.0.0.1:{pit_port}", "--data", tmp_path / "pit", "--web", page_port, *RULES)
    start(*pit, "--public-delay", 2).wait_for("arena: warning: everyone sees the board 2 ticks late").wait_for("web page at ")
    address = f"arena://127.0.0.1:{pit_port}/pit"
    seats = (("blue", "ann"), ("red", "bob"))
    players = [start("join", address, "--team", team, "--policy", bot, "--name", name) for team, name in seats]
    players[0].wait_for("this pit shows everyone the board, 2 ticks late")
    match = players[0].wait_for("begun").said.partition("match ")[2].partition(":")[0]
    watcher = start("watch", "--pit", address, "--match", match)

    page = visit(f"http://127.0.0.1:{page_port}/match/{match}")
    says(page, "This pit shows its boards to everyone, 2 ticks late.")
    page.get_by_role("img", name="The truth at tick").first.wait_for()
    watcher.wait_for("(as everyone is shown it, later)").wait_for("the truth")
    lobby = visit(f"http://127.0.0.1:{page_port}/")
    lobby.get_by_text("boards of running matches to everyone, 2 ticks late").wait_for()
    go.touch()

    says(page, "Every tick was played again and holds.")
    assert [player.finish() for player in players] == [0, 0]
    assert watcher.finish() == 0


@pytest.fixture(scope="module")
def played(shared: tuple[str, str, Path], shared_start: Start) -> tuple[str, Journal]:
    """Play a match; return where it is replayed, and its journal."""
    address, url, data = shared
    seats = (("blue", "ann"), ("red", "bob"))
    players = [shared_start("join", address, "--team", team, "--policy", "random", "--name", name) for team, name in seats]
    assert [player.finish() for player in players] == [0, 0]
    journal = find_journal(data, "ann")
    return f"{url}/match/{journal.name}", journal


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
    page.keyboard.press("ArrowUp")
    assert table_of(page) == places(journal, 0)
    page.keyboard.press("ArrowDown")
    assert timeline.input_value() == str(last)
    page.keyboard.press("Home")
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
    name, row, column, *_ = places(journal, 0)[0]

    truth.hover(position={"x": (int(column) + 0.5) * box["width"] / SIDE, "y": (int(row) + 0.5) * box["height"] / SIDE})

    page.locator(".events", has_text=f"{name}: sight 3, attack 2").wait_for()


@pytest.mark.parametrize("width", WIDTHS)
def test_every_page_fits_a_telephone_and_a_desk_by_day_and_by_night(
    played: tuple[str, Journal], visit: Start, width: int
) -> None:
    url, _ = played
    home = url.partition("/match")[0]
    page = visit(url, width=width)
    for address in (url, f"{home}/", f"{home}/play", f"{home}/league"):
        if address != url:
            page.goto(address)
        page.locator(".state").wait_for()
        page.wait_for_load_state("networkidle")
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            assert page.evaluate("document.documentElement.scrollWidth") == width
            for pixels, wide, high in page.evaluate(SIZES):
                assert pixels == [wide, wide] == [high, high]
                assert wide >= MOST_OF_WIDTH * min(width, page.viewport_size["height"])


def test_a_match_that_nobody_knows_is_said_and_the_lobby_offered(shared: tuple[str, str, Path], visit: Start) -> None:
    _, url, _ = shared

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
    page = visit(f"http://127.0.0.1:{page_port}/match/{match}#key={key}", expects=REFUSED)
    says(page, "this page sees it with the spectator key")

    first.kill()
    says(page, "The web server is gone; looking for it...")
    assert page.locator("figure canvas").count() == 3
    start(*web).wait_for("web page at ")
    says(page, "this page sees it with the spectator key")
    go.touch()

    says(page, f"after {N_LONG} ticks")
    says(page, "Every tick was played again and holds.")
    assert [player.finish() for player in players] == [0, 0]


def test_the_page_ends_with_its_pit_however_that_ends(serve: Start, visit: Start) -> None:
    page_port = free_port()
    pit = serve("--web", page_port, *RULES).wait_for("web page at ")
    page = visit(f"http://127.0.0.1:{page_port}/")
    says(page, "is open")
    page.goto("about:blank")

    pit.kill()  # and waits for all that hold its stdout: the page's server too

    assert "Traceback" not in pit.said
