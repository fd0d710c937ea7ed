"""A season in the browser: its table, an entry, and what its owner alone sees by a link whose token leaks nowhere."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.error import HTTPError
from urllib.parse import urlencode
from urllib.request import Request, urlopen

import pytest
from chromium import browser, says, visit
from made_seasons import keep_table, make_season, play_pairs, submit
from serving import Archive, serving

from arena.protocol.identity import Identity
from arena.protocol.page_token import TOKEN_HEADER, make_page_link, make_page_token
from arena.records.journal import journal_name
from tournaments.reports.web_leagues import Leagues
from tournaments.reports.web_seasons import NOT_THE_OWNER, Seasons
from tournaments.store.season_store import SeasonStore

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "visit"]

Visit = Callable[..., "Page"]
ANN, BOB = Identity.make(), Identity.make()
SECRET = "it dies in tick 3"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> Path:
    """Return a data folder with a season of three entries with two versions each; its last match has a journal."""
    folder = tmp_path_factory.mktemp("course")
    with SeasonStore(str(folder / "arena.db")) as store:
        league = make_season(store, {"ann": ANN.fingerprint, "bob": BOB.fingerprint, "cid": "cid"}, 2)
        play_pairs(store, league, list(league.definition["entries"]), 60)
        keep_table(store, league, deadline_s=time.time() + 2 * 86_400, n_waiting=1, new={"cid.2"})
        submit(store, league, "ann", ANN.fingerprint, SECRET)
        submit(store, league, "ann", ANN.fingerprint)
        [last] = store.matches_of(league, ["ann.2"], 1)
    journals = folder / "journals" / "course"
    journals.mkdir(parents=True)
    (journals / journal_name(last.identity)).write_bytes(data)
    return folder


@pytest.fixture(scope="module")
def home(folder: Path) -> Iterator[str]:
    with serving(Archive({}), Leagues(folder, ""), Seasons(folder, "")) as home:
        yield home


def ask(home: str, entry: str, token: str | None) -> tuple[int, bytes, list[tuple[str, str]]]:
    """Ask for an owner's view as a page does; return all of the answer but when it was given."""
    headers = {} if token is None else {TOKEN_HEADER: token}
    query = urlencode({"season": "course", "entry": entry})
    with urlopen(Request(f"{home}/api/season/own?{query}", headers=headers)) as answer:
        return answer.status, answer.read(), [one for one in answer.headers.items() if one[0] != "date"]


def test_from_the_lobby_a_season_leads_to_its_entries_and_their_replays(home: str, visit: Visit) -> None:
    page = visit(f"{home}/")
    page.get_by_role("link", name="course").click()
    says(page, "The season is open")
    assert "120 played, 2 running" in (page.locator("dl").text_content() or "")
    assert "1 waits for a check" in (page.locator("dl").text_content() or "")
    left = page.get_by_role("timer")
    assert (left.text_content() or "").startswith("(1 d 23:")
    assert page.locator("tbody th").all_text_contents() == ["ann", "bob", "cid new"]
    page.get_by_role("button", name="Entry").click()
    page.get_by_role("button", name="Entry").click()
    assert page.locator("tbody th").all_text_contents() == ["cid new", "bob", "ann"]

    page.get_by_role("link", name="ann").click()
    says(page, "Version 2 plays. In the table, version 2 is at rank 1, with Elo +99 (+49 to +149) after 8 matches.")
    assert page.locator("svg.plot circle").count() == 2
    assert page.get_by_role("region", name="Versions").locator("tbody th").all_text_contents() == ["2 plays", "1"]
    assert page.get_by_role("region", name="For its owner").count() == 0
    page.get_by_role("region", name="Last matches").get_by_role("link").first.click()
    says(page, "Every tick was played again and holds.")


def test_what_is_no_season_and_no_entry_is_said(home: str, visit: Visit) -> None:
    page = visit(f"{home}/seasons/nowhere")
    says(page, "unknown season 'nowhere'")
    page.goto(f"{home}/seasons/course/nobody")
    says(page, "unknown entry of season course 'nobody'")


def test_a_countdown_and_a_frozen_table_are_told(folder: Path, home: str, visit: Visit) -> None:
    with SeasonStore(str(folder / "arena.db")) as store:
        league = store.get("course")
        before = store.standings(league)
        keep_table(store, league, phase="frozen")
    try:
        page = visit(f"{home}/seasons/course")
        says(page, "The table is frozen")
        page.goto(f"{home}/seasons/course/ann")
        page.get_by_text("While the table is frozen, matches and opponents are not shown.").wait_for()
        assert page.get_by_role("region", name="Last matches").count() == 0
        page.goto(make_page_link(ANN, home, "course", "ann", time.time()))
        page.get_by_role("region", name="Last matches").wait_for()
        assert page.get_by_role("region", name="Last matches").get_by_role("link").count() == 0
    finally:
        with SeasonStore(str(folder / "arena.db")) as store:
            store.put_standings(league, before or {}, 7.0)


def test_the_owners_link_shows_what_others_do_not_see_and_no_request_but_one_carries_its_token(home: str, visit: Visit) -> None:
    link = make_page_link(ANN, home, "course", "ann", time.time())
    token = link.partition("=")[2]
    page = visit(f"{home}/seasons/course/ann")
    says(page, "Version 2 plays")
    asked: list[Any] = []

    def keep(request: Any) -> None:
        asked.append(request)

    page.on("request", keep)
    page.goto(link)
    page.get_by_text("The last submission is checked next").wait_for()

    assert page.get_by_role("region", name="What the last check found").text_content() == f"ann: 700 bytes\n{SECRET}"
    states = page.get_by_role("list", name="Submissions").locator(".tag").all_text_contents()
    assert states == ["waiting", "refused"]
    assert token not in page.url
    assert not any(token in one.url for one in asked)
    carriers = {one.url for one in asked if token in one.headers.values()}
    assert carriers == {f"{home}/api/season/own?season=course&entry=ann"}
    page.reload()
    page.get_by_text("The last submission is checked next").wait_for()
    page.get_by_role("link", name="course").click()
    page.get_by_role("link", name="bob").click()
    says(page, "Version 2 plays")
    assert page.get_by_role("region", name="For its owner").count() == 0

    page.goto(f"{home}/seasons/course/ann")
    page.get_by_role("button", name="Forget").click()
    page.reload()
    says(page, "Version 2 plays")
    assert page.get_by_role("region", name="For its owner").count() == 0


def test_a_link_of_somebody_else_shows_no_more_than_none(home: str, visit: Visit) -> None:
    page = visit(make_page_link(BOB, home, "course", "ann", time.time()))

    page.get_by_text(f"Not shown: {NOT_THE_OWNER}.").wait_for()
    assert SECRET not in page.content()


def test_whoever_is_not_the_owner_is_answered_alike_to_the_byte(home: str) -> None:
    now_s, host = time.time(), home.removeprefix("http://")
    answers = {
        "no token": ask(home, "ann", None),
        "an empty one": ask(home, "ann", ""),
        "junk": ask(home, "ann", "\u00e9" * 139),
        "another's": ask(home, "ann", make_page_token(BOB, host, "course", now_s)),
        "an expired one": ask(home, "ann", make_page_token(ANN, host, "course", 0.0)),
        "another season's": ask(home, "ann", make_page_token(ANN, host, "other", now_s)),
        "another page's": ask(home, "ann", make_page_token(ANN, "127.0.0.1:1", "course", now_s)),
        "of no entry": ask(home, "nobody", make_page_token(ANN, host, "course", now_s)),
    }

    assert len({repr(answer) for answer in answers.values()}) == 1, answers
    status, body, headers = answers["no token"]
    assert (status, SECRET.encode() in body, ("cache-control", "no-store") in headers) == (200, False, True)
    assert SECRET.encode() in ask(home, "ann", make_page_token(ANN, host, "course", now_s))[1]


def test_no_page_of_others_gets_an_owners_view(home: str) -> None:
    headers = {
        TOKEN_HEADER: make_page_token(ANN, home.removeprefix("http://"), "course", time.time()),
        "sec-fetch-site": "cross-site",
        "sec-fetch-mode": "cors",
    }
    with pytest.raises(HTTPError) as refused:
        urlopen(Request(f"{home}/api/season/own?season=course&entry=ann", headers=headers))

    assert refused.value.code == 403
    refused.value.close()
