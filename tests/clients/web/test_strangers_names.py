"""Names of strangers in the browser: whatever a pit or a store says, it is text on the page and never markup."""

import asyncio
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import pytest
from chromium import browser, visit
from serving import EVIL, is_harmless, serving

from arena.errors import ArenaError
from arena.game.ruleset import load, to_dict
from arena.network.address import Address
from arena.protocol.messages import Lobby
from clients.web.pit import PitClient

if TYPE_CHECKING:
    from playwright.sync_api import Page

__all__ = ["browser", "visit"]


class EvilPit(PitClient):
    """A pit whose every name is markup."""

    async def run(self) -> None:
        ruleset = load("paper")
        self.lobby = Lobby(
            pit=EVIL,
            rules=EVIL,
            rules_hash=EVIL,
            ruleset=to_dict(ruleset) | {"name": EVIL},
            needs_invite=False,
            n_begun=1,
            running=[{"match": EVIL, "blue": EVIL, "red": EVIL, "tick": 1}],
            waiting=[EVIL],
        )
        ending = {"ending": EVIL, "winner": EVIL, "score": 0, "ticks": 1, "reason": EVIL}
        self.results.append({"match": EVIL, "names": [EVIL, EVIL]} | ending)
        await asyncio.Event().wait()


class EvilLeagues:
    """A store whose every name is markup."""

    def names(self) -> list[str]:
        return [EVIL]

    def report(self, name: str) -> dict[str, Any]:
        numbers = {"rank": 1, "rank_low": 1, "rank_high": 1, "elo": 0.0, "elo_low": -1.0, "elo_high": 1.0, "score": 0.5}
        return {
            "league": {"name": name, "ruleset": EVIL},
            "matches": {"played": 1, "planned": 1, "complete": True},
            "standings": [{"entry": EVIL} | numbers, {"entry": "constructor"} | numbers],  # what every object of a script has
            "leaderboard": {
                "columns": [{"name": EVIL, "meaning": EVIL, "is_low_first": True}],
                "rows": [[{"text": EVIL, "key": None}]],
            },
            "cross": {EVIL: {EVIL: {"wins": 1, "draws": 0, "losses": 1, "score": 0.5}}},
            "results": [{"identity": EVIL, "blue": EVIL, "red": EVIL}],
        }

    def head_to_head(self, name: str, one: str, other: str) -> dict[str, Any]:
        match = {"identity": EVIL, "blue": EVIL, "red": EVIL, "winner": EVIL, "ending": EVIL, "score": 0, "ticks": 1}
        counts = {"wins": 1, "draws": 0, "losses": 1}
        return {
            "league": name,
            "entries": [one, other],
            "record": counts | {"score": 0.5, "low": 0.0, "high": 1.0, "pairs": 1},
            "by_side": {"blue": counts},
            "by_ending": {EVIL: counts},
            "matches": [match | {"reason": EVIL, "tags": [{"name": EVIL, "meaning": EVIL}]}],
        }

    def ladders(self) -> list[str]:
        return [EVIL]

    def ladder(self, name: str) -> dict[str, Any]:
        raise ArenaError(EVIL)

    def journal(self, name: str, identity: str) -> bytes:
        raise ArenaError(EVIL)


class EvilSeasons:
    """A store whose every season, entry and word of an owner is markup."""

    def names(self) -> list[str]:
        return [EVIL]

    def season(self, name: str) -> dict[str, Any]:
        columns = [{"name": one, "meaning": EVIL, "is_low_first": True} for one in ("rank", "entry")]
        rows = [[{"text": EVIL, "key": None}, {"text": EVIL, "key": None, "tag": EVIL}]]
        counts = {"matches": EVIL, "playing": EVIL, "waiting": EVIL}
        facts = {"season": EVIL, "phase": EVIL, "deadline": None, "made_at": 0.0, "final": EVIL} | counts
        return facts | {"leaderboard": {"columns": columns, "rows": rows}}

    def entry(self, name: str, entry: str) -> dict[str, Any]:
        rating = {"elo": 0.0, "elo_low": -1.0, "elo_high": 1.0, "matches": EVIL}
        against = {"opponent": EVIL, "score": 0.5, "low": 0.0, "high": 1.0, "wins": EVIL, "draws": 0, "losses": 0}
        match = {"identity": EVIL, "blue": EVIL, "red": EVIL, "winner": EVIL, "ending": EVIL, "score": 0, "ticks": EVIL}
        return {
            "season": EVIL, "entry": EVIL, "plays": EVIL, "is_frozen": False, "best": [against], "worst": [against],
            "row": rating | {"rank_low": EVIL, "rank_high": EVIL, "version": EVIL},
            "versions": [{"number": number, "entered_at": 0.0, "rating": rating} for number in (EVIL, 2)],
            "matches": [match | {"reason": EVIL, "is_visible": True}],
        }  # fmt: skip

    def own(self, name: str, entry: str, token: str, host: str) -> dict[str, Any]:
        given = {"received_at": 0.0, "state": EVIL, "says": EVIL, "number": EVIL, "n_bytes": EVIL, "lines": [EVIL]}
        return {"entry": EVIL, "queue": EVIL, "submissions": [given], "log": EVIL}


@pytest.fixture
def home() -> Iterator[str]:
    with serving(EvilPit(Address(), None, lambda _: None), EvilLeagues(), EvilSeasons()) as home:
        yield home


def test_markup_in_a_name_is_shown_as_it_is_written(home: str, visit: Callable[..., "Page"]) -> None:
    lobby, league = visit(f"{home}/"), visit(f"{home}/league")

    lobby.locator("td.blue", has_text=EVIL).first.wait_for()
    lobby.get_by_role("region", name="Latest results").locator("td", has_text=EVIL).first.wait_for()
    lobby.locator("p", has_text=f"The rules are those of {EVIL}").wait_for()
    lobby.get_by_role("link", name="The rules").click()
    lobby.locator(".state", has_text=f"plays the ruleset {EVIL}").wait_for()
    league.locator("tbody th", has_text=EVIL).first.wait_for()
    league.locator(".cross button").click()
    league.locator("#fixture td.blue", has_text=EVIL).wait_for()
    league.locator("#fixture .tag", has_text=EVIL).wait_for()
    league.get_by_role("link", name="Replay of").click()
    league.locator(".state", has_text=f"This match cannot be shown: {EVIL}").wait_for()
    assert is_harmless(lobby)
    assert is_harmless(league)


def test_markup_of_a_season_is_shown_as_it_is_written(home: str, visit: Callable[..., "Page"]) -> None:
    page = visit(f"{home}/")
    page.locator("p", has_text=f"Season: {EVIL}").wait_for()
    assert is_harmless(page)
    page.goto(f"{home}/seasons/{quote(EVIL.replace('/', ''))}")
    page.locator("tbody th .tag", has_text=EVIL).wait_for()
    assert is_harmless(page)
    page.goto(f"{page.url}/{quote(EVIL.replace('/', ''))}#token=abc")
    page.locator(".state", has_text=f"Version {EVIL} plays").wait_for()
    page.get_by_role("region", name="What the last check found").get_by_text(EVIL).wait_for()
    page.locator("svg.plot text", has_text=EVIL).wait_for()
    assert page.get_by_role("region", name="Best opponents").get_by_role("link").text_content() == EVIL
    assert is_harmless(page)
