"""The page of a replay, in the browser: what its boards show, its keys, its timeline and its address."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from chromium import browser, visit

from arena.records.journal import Journal
from arena.records.replay import replay

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "visit"]

Visit = Callable[..., "Page"]


def test_the_address_keeps_the_tick_and_the_view_and_leads_back_there(replayed: str, journal: Journal, visit: Visit) -> None:
    page = visit(f"{replayed}?tick=7&view=red")
    only = page.get_by_role("img")

    only.and_(page.get_by_label("What red sees at tick 7", exact=True)).wait_for()
    page.keyboard.press("ArrowRight")
    page.wait_for_url(f"{replayed}?tick=8&view=red")
    page.keyboard.press("f")  # behind red come all, and then blue
    assert only.count() == 3
    page.keyboard.press("f")
    page.wait_for_url(f"{replayed}?tick=8&view=blue")
    page.reload()

    only.and_(page.get_by_label("What blue sees at tick 8", exact=True)).wait_for()
    assert only.count() == 1
    page.goto(f"{replayed}?tick=1e9&view=%3Cb%3E")
    page.get_by_label("The truth at tick 1:").wait_for()
    page.goto(f"{replayed}?tick={10**30}")
    page.get_by_label(f"The truth at tick {len(journal.ticks)}:").wait_for()


def test_events_stand_on_the_timeline_and_are_visited_by_keys(replayed: str, journal: Journal, visit: Visit) -> None:
    games = [
        (bool(game.events.fought.any()), bool(game.events.fell.any() | game.events.captured.any())) for game in replay(journal)
    ]
    due = [at for at, (fought, ends) in enumerate(games) if ends or (fought and not games[at - 1][0])]
    assert len(due) > 2
    page = visit(replayed)
    timeline, marks = page.get_by_label("Tick", exact=True), page.locator(".mark")
    marks.first.wait_for()
    titles = [mark.get_attribute("title") or "" for mark in marks.all()]

    assert [int(title.split()[1].rstrip(":")) for title in titles] == due
    assert any("falls at row" in title for title in titles)
    for at in due:
        page.keyboard.press("n")
        assert timeline.input_value() == str(at)
    page.keyboard.press("n")
    page.keyboard.press("p")
    assert timeline.input_value() == str(due[-2])
    marks.first.click()
    assert timeline.input_value() == str(due[0])


def test_a_question_mark_shows_the_keys_and_layers_are_switched_by_theirs(replayed: str, journal: Journal, visit: Visit) -> None:
    page = visit(replayed)
    truth = page.get_by_label("The truth at tick 0")
    truth.wait_for()
    pictures = [truth.evaluate("it => it.toDataURL()")]
    for key in "otshhh":
        page.keyboard.press(key)
        pictures.append(truth.evaluate("it => it.toDataURL()"))
    page.keyboard.press("h")

    assert len({*pictures}) == len(pictures) - 1  # at the first tick nobody has come from anywhere
    assert pictures[2] == pictures[1]
    assert page.get_by_role("button", name="Trails", pressed=True).count() == 1
    page.keyboard.press("?")
    keys = page.get_by_role("dialog", name="Keys")
    assert "to the next event" in (keys.text_content() or "")
    page.keyboard.press("ArrowRight")
    assert page.get_by_label("Tick", exact=True).input_value() == "0"
    page.keyboard.press("Escape")
    keys.wait_for(state="hidden")


def test_on_a_telephone_one_board_and_its_timeline_are_seen_at_once(replayed: str, visit: Visit) -> None:
    page = visit(replayed, width=390)
    for name in ("blue", "truth", "red"):
        page.get_by_role("button", name=name, exact=True).click()
        board, timeline = page.get_by_role("img"), page.get_by_label("Tick", exact=True)
        assert board.count() == 1
        for box in (board.bounding_box(), timeline.bounding_box(), page.get_by_role("button", name="Play").bounding_box()):
            assert box is not None
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 390
            assert box["y"] + box["height"] <= 844
    assert page.get_by_role("button", name="all").count() == 0
