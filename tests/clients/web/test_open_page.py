"""A file of one's own in the browser: dropped or chosen, shown with what the bot noted, or refused in a sentence."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from chromium import axe, browser, says, visit
from serving import EVIL, is_harmless

from arena.annotations import Annotations
from arena.records.journal import Journal

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["axe", "browser", "visit"]

Visit = Callable[..., "Page"]
DROP = """
(it, [name, bytes]) => {
  const given = new DataTransfer();
  given.items.add(new File([new Uint8Array(bytes)], name));
  it.dispatchEvent(new DragEvent("drop", { dataTransfer: given, bubbles: true, cancelable: true }));
}
"""
PICTURE = "it => it.toDataURL()"


@pytest.fixture
def transcript(transcribe: Callable[..., Path], data: bytes, tmp_path: Path) -> Path:
    """Return a transcript whose bot logs at ticks 3 and 5, draws at 5, and shows where two enemies may be at 1 and one at 2."""

    def note(notes: Annotations, tick: int) -> None:
        if tick in (1, 2):
            notes.draw.heat(np.eye(20), "red", "ugv 1")
        if tick == 1:
            notes.draw.heat(np.eye(20)[::-1], "blue", EVIL)
        if tick in (3, 5):
            notes.log(EVIL, tick)
        if tick == 5:
            notes.draw.cell(2, 3, "red", EVIL[:3])
            notes.draw.path([(1, 1), (1, 5)], "green")
            notes.draw.heat(np.eye(20), "blue")

    return transcribe(tmp_path / "mybot.transcript", note, data)


def test_a_transcript_is_dropped_and_its_log_and_drawings_are_seen_at_their_tick_and_switched(
    home: str, transcript: Path, visit: Visit, axe: Callable[..., str]
) -> None:
    page = visit(f"{home}/open")
    says(page, "Drop a journal or a transcript")

    page.locator("main").evaluate(DROP, [transcript.name, list(transcript.read_bytes())])

    says(page, "What mybot saw as red. Over: ")
    log, board = page.get_by_role("list", name="The bot's log"), page.get_by_role("img")
    assert board.count() == 1
    for tick in range(1, 5):
        page.keyboard.press("ArrowRight")
        assert log.locator("li").all_text_contents() == ([f"{EVIL} 3"] if tick == 3 else [])
    bare = board.evaluate(PICTURE)
    page.keyboard.press("ArrowRight")
    assert log.locator("li").all_text_contents() == [f"{EVIL} 5"]
    drawn = board.evaluate(PICTURE)
    page.keyboard.press("d")
    assert board.evaluate(PICTURE) not in (bare, drawn)  # the tick itself
    page.keyboard.press("d")
    assert board.evaluate(PICTURE) == drawn
    page.keyboard.press("l")
    log.wait_for(state="hidden")
    page.keyboard.press("l")
    assert axe(page, False) == ""
    assert is_harmless(page)
    assert EVIL in (page.get_by_role("heading", level=1).text_content() or "")


def test_heat_maps_with_labels_are_seen_together_or_one_alone(home: str, transcript: Path, visit: Visit) -> None:
    page = visit(f"{home}/open")
    page.get_by_label("Journal or transcript").set_input_files(transcript)
    says(page, "What mybot saw as red. Over: ")
    maps, board = page.get_by_label("The bot's heat maps"), page.get_by_role("img")
    page.keyboard.press("ArrowRight")

    assert maps.locator("option").all_text_contents() == ["All its maps", "ugv 1 (red)", f"{EVIL[:20]} (blue)"]
    together = board.evaluate(PICTURE)
    alone = []
    for _ in range(2):
        page.keyboard.press("m")
        alone.append(board.evaluate(PICTURE))
    page.keyboard.press("ArrowRight")
    neither = board.evaluate(PICTURE)  # the other has none at this tick
    maps.select_option("ugv 1")
    assert board.evaluate(PICTURE) != neither
    page.locator("h1").click()
    page.keyboard.press("ArrowLeft")
    assert board.evaluate(PICTURE) == alone[0]
    for _ in range(2):
        page.keyboard.press("m")
    assert board.evaluate(PICTURE) == together
    assert len({together, *alone}) == 3
    assert is_harmless(page)


def test_a_transcript_beside_the_journal_of_its_match_shows_its_notes_on_its_own_side_alone(
    home: str, data: bytes, transcript: Path, tmp_path: Path, visit: Visit
) -> None:
    journal = tmp_path / "a.journal"
    journal.write_bytes(data)
    page = visit(f"{home}/open")
    files = page.get_by_label("Journal or transcript")
    files.set_input_files([journal, transcript])
    says(page, "Every tick was played again and holds.")
    boards = page.get_by_role("img")
    for _ in range(5):
        page.keyboard.press("ArrowRight")

    assert page.get_by_role("list", name="The bot's log").locator("li").all_text_contents() == [f"{EVIL} 5"]
    drawn = [board.evaluate(PICTURE) for board in boards.all()]
    page.keyboard.press("d")
    bare = [board.evaluate(PICTURE) for board in boards.all()]
    assert [one == other for one, other in zip(drawn, bare, strict=True)] == [True, True, False]
    files.set_input_files([journal, journal])
    says(page, "these are not the journal and a transcript of one match")


def test_a_journal_is_chosen_and_says_nothing_of_bots(
    home: str, data: bytes, journal: Journal, tmp_path: Path, visit: Visit
) -> None:
    (tmp_path / "a.journal").write_bytes(data)
    page = visit(f"{home}/open", width=390)
    page.get_by_label("Journal or transcript").set_input_files(tmp_path / "a.journal")

    says(page, "Every tick was played again and holds.")
    assert page.get_by_label("Tick", exact=True).get_attribute("max") == str(len(journal.ticks))
    assert page.get_by_role("button", name="Log").count() == 0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda data: b"\x89PNG\r\n\x1a\n" + bytes(1_000), "this is neither a journal nor a transcript"),
        (lambda data: b"", "this is neither a journal nor a transcript"),
        (lambda data: data.replace(b"JOURNAL-1", b"JOURNAL-9"), "the journal is of format 9, which this arena does not know"),
        (lambda data: data[:1_000], "the journal is truncated"),
        (lambda data: data + bytes(1 << 24), "can be opened here"),
    ],
    ids=["junk", "empty", "newer", "truncated", "large"],
)
def test_a_file_that_cannot_be_shown_is_refused_in_a_sentence_and_the_next_is_shown(
    home: str, data: bytes, change: Callable[[bytes], bytes], sentence: str, tmp_path: Path, visit: Visit
) -> None:
    (tmp_path / "bad").write_bytes(change(data))
    (tmp_path / "good").write_bytes(data)
    page = visit(f"{home}/open")
    page.get_by_label("Journal or transcript").set_input_files(tmp_path / "bad")

    says(page, "bad cannot be shown: ")
    says(page, sentence)
    assert page.get_by_role("img").count() == 0
    page.get_by_label("Journal or transcript").set_input_files(tmp_path / "good")
    says(page, "Every tick was played again and holds.")


def test_a_match_that_is_not_over_is_not_shown(home: str, data: bytes, journal: Journal, tmp_path: Path, visit: Visit) -> None:
    last = journal.ticks[-1].chain
    (tmp_path / "a.journal").write_bytes(data[: data.index(last) + len(last)])
    page = visit(f"{home}/open")
    page.get_by_label("Journal or transcript").set_input_files(tmp_path / "a.journal")

    says(page, "the match is not over")
