"""A person plays in the browser: a whole match by clicks and keys, a page that is lost and comes back, two people at once."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from chromium import browser, says, visit

from arena.game.types import Action, Termination
from arena.network.address import free_port
from arena.records.journal_folder import load_journal
from arena.records.transcript import load_transcript

if TYPE_CHECKING:
    from playwright.sync_api import Page, WebSocketRoute

__all__ = ["browser", "visit"]

Start = Callable[..., Any]
SIDE = 8
BOARD = """
F . . . . . . .
. . . . . . . .
. . . . . . . .
U . . . . . . f
. . . . . . . .
. . . . . . . .
. . . . . . . u
. . . . . . . .
"""
SLEEPER = """
import threading


class Sleeper:
    def start(self, info):
        threading.Event().wait(600)

    def act(self, observation):
        return [0] * len(observation.units)
"""


@pytest.fixture(scope="module")
def rules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the rules of an empty board, where blue walks straight to the flag."""
    path = tmp_path_factory.mktemp("rules") / "open.toml"
    path.write_text(f"base = 'paper'\nboard = '''{BOARD}'''\n[units.ugv]\nattack = 0\n")
    return path


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pit")


@pytest.fixture(scope="module")
def home(shared_start: Start, rules: Path, data: Path) -> str:
    """Open a pit with its page, and return where that is; in each test others play in it."""
    page_port = free_port()
    pit = ("serve", "--listen", f"tcp/127.0.0.1:{free_port()}", "--data", data, "--seed", 7, "--web", page_port)
    shared_start(*pit, "--turn-time", 60, "--rules", rules).wait_for("web page at ")
    return f"http://127.0.0.1:{page_port}"


def sit_down(page: "Page", name: str, team: str, against: str) -> None:
    page.get_by_label("Name").fill(name)
    page.get_by_label("Team").select_option(team)
    page.get_by_label("Against").select_option(against)
    page.get_by_role("button", name="Take a seat").click()


def wait_for_tick(page: "Page", tick: int) -> None:
    page.locator(".score", has_text=f"tick {tick} of 100").wait_for()


def click_cell(page: "Page", row: int, column: int) -> None:
    board = page.get_by_role("img")
    box = board.bounding_box()
    assert box is not None
    board.click(position={"x": (column + 0.5) * box["width"] / SIDE, "y": (row + 0.5) * box["height"] / SIDE})


def test_a_person_plays_a_whole_match_by_clicks_and_keys_and_comes_back_to_a_lost_page(
    home: str, visit: Start, data: Path
) -> None:
    page = visit(f"{home}/play")
    sit_down(page, "ann", "blue", "patrol")
    says(page, "Your turn")
    unit = page.locator(".units button")

    assert unit.all_text_contents() == ["UGV at 3, 0: no order"]
    assert page.get_by_role("button", name="West").is_disabled()  # the board ends there
    page.keyboard.press("d")  # the only unit has its order, which ends the turn
    wait_for_tick(page, 1)
    assert unit.all_text_contents() == ["UGV at 3, 1: east"]  # an order stays
    page.keyboard.press("Enter")
    wait_for_tick(page, 2)
    page.reload()
    says(page, "Your turn")
    assert unit.all_text_contents() == ["UGV at 3, 2: east"]
    page.get_by_role("button", name="South").click()
    wait_for_tick(page, 3)
    assert unit.all_text_contents() == ["UGV at 4, 2: south"]
    click_cell(page, 3, 7)
    wait_for_tick(page, 4)
    assert "to 3,7" in unit.all_text_contents()[0]
    is_over = page.get_by_role("button", name="Play again")
    for tick in range(5, 20):  # the enemy may stand in the way for a while
        page.keyboard.press("Enter")
        page.locator(".score", has_text=f"tick {tick} of 100").or_(is_over).first.wait_for()
        if is_over.is_visible():
            break

    says(page, "Checked: the journal is of this match")
    journals = map(load_journal, (data / "journals").glob("*.journal"))
    (journal,) = (journal for journal in journals if "ann" in (journal.header.blue, journal.header.red))
    transcripts = (load_transcript(path) for path in (data / "transcripts").rglob("*") if path.is_file())
    (transcript,) = (transcript for transcript in transcripts if transcript.header.name == "ann")
    assert journal.header.blue == "ann"
    assert journal.header.red == "patrol"
    assert journal.ending is not None
    assert journal.ending.ending is Termination.CAPTURE
    assert [tick.orders[0] for tick in journal.ticks[:3]] == [Action.EAST, Action.EAST, Action.SOUTH]
    assert transcript.header.match == journal.name
    page.get_by_role("link", name="Watch it").click()
    says(page, "Every tick was played again and holds.")


def test_two_browsers_play_each_other(home: str, visit: Start) -> None:
    blue, red = visit(f"{home}/play"), visit(f"{home}/play", width=390)
    sit_down(blue, "eve", "blue", "")
    says(blue, "eve waits")
    sit_down(red, "kim", "red", "")
    for page in (blue, red):
        says(page, "Your turn")
    assert "against kim" in (blue.locator(".score").text_content() or "")
    assert "against eve" in (red.locator(".score").text_content() or "")

    boxes = [red.locator(part).bounding_box() for part in ("figure > canvas", ".orders .pad")]
    (board, orders) = [box for box in boxes if box is not None]
    assert 0 <= board["y"] < orders["y"] < orders["y"] + orders["height"] <= 900, "a telephone scrolls between board and orders"
    red.locator(".legend li", has_text="where it can go now").wait_for()

    for tick in range(1, 8):
        blue.keyboard.press("ArrowRight" if tick == 1 else "Enter")
        says(blue, "The others move") if tick == 1 else None
        red.keyboard.press(".")
        for page in (blue, red):
            wait_for_tick(page, tick) if tick < 7 else says(page, "by capture")

    says(blue, "You win by capture after 7 ticks")
    says(red, "You lose by capture after 7 ticks")


def test_a_page_whose_connection_is_cut_says_so_and_goes_on_by_itself(home: str, visit: Start) -> None:
    page = visit(f"{home}/")
    sockets: list[WebSocketRoute] = []

    def pass_on(socket: "WebSocketRoute") -> None:
        sockets.append(socket)
        socket.connect_to_server()

    page.route_web_socket("**/ws/play", pass_on)
    page.goto(f"{home}/play")
    sit_down(page, "bob", "blue", "patrol")
    says(page, "Your turn")
    page.keyboard.press("d")
    wait_for_tick(page, 1)

    sockets[0].close()
    says(page, "The connection is lost; your seat waits. Connecting again...")
    says(page, "Your turn")
    page.keyboard.press("Enter")

    wait_for_tick(page, 2)
    assert page.locator(".units button").all_text_contents() == ["UGV at 3, 2: east"]
    assert len(sockets) == 2


def test_a_person_plays_on_when_the_pit_was_killed_and_started_again(
    serve: Start, start: Start, visit: Start, rules: Path, port: int, tmp_path: Path
) -> None:
    options = ("--turn-time", 60, "--rules", rules)
    pit = serve(*options)
    web = start("web", "--pit", f"arena://127.0.0.1:{port}/pit", "--port", 0, "--data", tmp_path / "web")
    home = web.wait_for("web page at ").said.partition("web page at ")[2].split("/\n")[0]
    page = visit(f"{home}/play")
    sit_down(page, "eve", "blue", "patrol")
    says(page, "Your turn")
    page.keyboard.press("d")
    wait_for_tick(page, 1)

    pit.send(signal.SIGKILL)
    says(page, "You wait for the pit to come back; your seat is kept.")
    pit.finish()
    page.keyboard.press("s")  # while nobody hears it; it counts when the pit is back
    serve(*options)

    wait_for_tick(page, 2)
    says(page, "Your turn")
    assert page.locator(".units button").all_text_contents() == ["UGV at 4, 1: south"]
    click_cell(page, 3, 7)
    is_over = page.get_by_role("button", name="Play again")
    for tick in range(3, 20):
        page.locator(".score", has_text=f"tick {tick} of 100").or_(is_over).first.wait_for()
        if is_over.is_visible():
            break
        page.keyboard.press("Enter")
    says(page, "Checked: the journal is of this match")
    (journal,) = map(load_journal, (tmp_path / "journals").glob("*.journal"))
    assert [tick.orders[0] for tick in journal.ticks[:2]] == [Action.EAST, Action.SOUTH]
    assert not any(mark for tick in journal.ticks for mark in tick.marks)


def test_a_match_that_ends_before_its_first_turn_is_told_as_the_person_has_won_it(
    serve: Start, join: Start, visit: Start, rules: Path, tmp_path: Path
) -> None:
    bot, page_port = tmp_path / "sleeper.py", free_port()
    bot.write_text(SLEEPER)
    serve("--rules", rules, "--grace", 3, "--web", page_port).wait_for("web page at ")
    page = visit(f"http://127.0.0.1:{page_port}/play")
    sit_down(page, "eve", "red", "")
    says(page, "eve waits")
    join("--team", "blue", "--policy", bot)

    says(page, "You win by forfeit (blue did not get ready in time) after 0 ticks")

    page.get_by_role("button", name="Play again").click()
    says(page, "Who plays, and against whom?")


def test_a_name_that_is_none_is_refused_in_a_sentence(home: str, visit: Start) -> None:
    page = visit(f"{home}/play")
    page.get_by_label("Name").evaluate("field => { field.removeAttribute('pattern'); field.removeAttribute('maxlength'); }")

    sit_down(page, "<script>", "any", "patrol")

    says(page, "No seat: the name is '<script>'; it must be 1 to 64 letters, digits, - or _.")
