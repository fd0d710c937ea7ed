"""The report's page in a real browser."""

import random
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Literal
from urllib.parse import unquote

import pytest
from chromium import PATIENCE_MS, WIDTHS, axe, browser
from commands import run_here
from outcomes import ended

from arena.game.types import Team, Termination
from arena.records.journal import journal_name
from arena.records.journal_bundle import BundleWriter
from arena.records.plan import LeagueMatchId
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.ratings.standings import Standing
from tournaments.reports.page import MOST_LISTED, to_html
from tournaments.reports.replays import find_visible
from tournaments.reports.report import Report, make_report
from tournaments.store.store import StoredLeague

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

__all__ = ["axe", "browser"]

SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")
EVIL = "</li><script>window.evil = 1</script><img src=x onerror='window.evil = 1'>"
LEAGUE = (
    'pairs = 1\nvenue = "local"\nseed = 3\n[rules]\nside = 10\ntick_limit = 20\n[entries]\nrush = "rush"\nrandom = "random"\n'
)
Show = Callable[..., "AbstractContextManager[Page]"]


def pretend(n_entries: int, n_pairs: int, *, reason: str = "", tail: str = "", n_draws: int = 20) -> Report:
    """Return the report of a league that was never played; the first entry is the strongest, and a half favours blue."""
    rng = random.Random(n_entries)
    names = [f"{'fighter' if number % 3 else 'careful-defender'}-{number}{tail}" for number in range(n_entries)]
    outcomes = []
    for one, other in combinations(sorted(names), 2):
        for pair in range(n_pairs):
            for blue, red in ((one, other), (other, one)):
                lead = (names.index(red) - names.index(blue)) / n_entries + rng.gauss(0.3, 0.5)
                winner = None if abs(lead) < 0.1 else Team.BLUE if lead > 0 else Team.RED
                outcomes.append(_outcome(f"friday/{one}/{other}/{pair:04}/{blue}-blue/0", blue, red, winner, reason, rng))
    facts = {"ruleset": "paper", "rules": "c2" * 32, "entries": dict.fromkeys(names, "rush"), "secret": "ef" * 32}
    league = StoredLeague(id=1, name="friday", hash="ab" * 32, n_pairs=n_pairs, definition=facts)
    return make_report(league, outcomes, n_draws=n_draws, findings=["three beat each other in a circle"])


def _outcome(identity: str, blue: str, red: str, winner: Team | None, reason: str, rng: random.Random) -> Outcome:
    ending = Termination.TICK_LIMIT if winner is None else Termination.FORFEIT if rng.random() < 0.05 else Termination.CAPTURE
    ticks = rng.randrange(5, 100)
    seats = {
        team: SeatOutcome(
            faults={"late": rng.randrange(3), "raised": int(name.endswith("1"))},
            latency_p50_s=None if name.endswith("2") else rng.uniform(0.002, 0.02),
            latency_p99_s=None if name.endswith("2") else rng.uniform(0.02, 0.3),
        )
        for team, name in ((Team.BLUE, blue), (Team.RED, red))
    }
    return ended(identity, blue, red, winner, seats, ending=ending, ticks=ticks, reason=reason)


@pytest.fixture(scope="module")
def report() -> Report:
    return pretend(9, 3)


@pytest.fixture(scope="module")
def show(browser: "Browser", tmp_path_factory: pytest.TempPathFactory) -> Show:
    """Open a report's page; at the end, nothing may have been fetched but the page, and nothing may have gone wrong."""

    @contextmanager
    def opened(report: Report, *, width: int = 1440, scheme: str = "light", bundled: bool = False) -> Iterator["Page"]:
        file = tmp_path_factory.mktemp("page") / "friday.html"
        journals = file.parent / "journals" / "friday"
        if bundled:
            journals.mkdir(parents=True)
            with BundleWriter(journals) as writer:
                writer.add((outcome.identity, b"no journal") for outcome in report.outcomes)
        file.write_text(to_html(report, file, journals), encoding="utf-8")
        wrongs: list[str] = []
        requests: list[str] = []
        context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)  # type: ignore[arg-type]
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", lambda message: wrongs.append(message.text))
        page.on("pageerror", lambda error: wrongs.append(str(error)))
        page.on("requestfailed", lambda request: wrongs.append(request.url))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(file.as_uri())
        yield page
        context.close()
        assert wrongs == []
        assert [url for url in requests if not url.startswith("data:")] == [file.as_uri()]

    return opened


# What each column is sorted by, as far as it is shown; None stays below.
COLUMNS: dict[str, Callable[[Standing], float | str | None]] = {
    "entry": lambda row: row.name,
    "rank": lambda row: row.rating.rank,
    "Elo": lambda row: round(row.rating.elo, 2),
    "95% interval": lambda row: round(row.rating.elo_high - row.rating.elo_low, 2),
    "score": lambda row: round(row.record.score or 0, 3),
    "wins": lambda row: row.record.wins,
    "draws": lambda row: row.record.draws,
    "losses": lambda row: row.record.losses,
    "forfeits": lambda row: row.forfeits,
    "late": lambda row: row.faults["late"],
    "raised": lambda row: row.faults["raised"],
    "p50 ms": lambda row: row.latency and round(1_000 * row.latency.p50_s, 1),
    "p99 ms": lambda row: row.latency and round(1_000 * row.latency.p99_s, 1),
}


def read_rows(table: "Locator") -> list[list[str]]:
    rows: list[list[str]] = table.evaluate(
        "it => [...it.tBodies[0].rows].map(row => [...row.cells].map(cell => cell.textContent))"
    )
    return rows


@pytest.mark.parametrize("number", [0, 1])
def test_every_column_sorts_by_mouse_and_by_keyboard(show: Show, report: Report, number: int) -> None:
    standings = {row.name: row for row in report.standings.rows}
    with show(report) as page:
        table = page.locator("table.sortable").nth(number)
        before = read_rows(table)
        heads = table.locator("thead th")
        names = heads.all_text_contents()
        assert names == [name for name in COLUMNS if name in names]
        for column, name in enumerate(names):
            head = heads.nth(column)
            button = head.locator("button")
            directions = []
            for press in (button.click, lambda: button.press("Enter"), lambda: button.press("Space")):  # noqa: B023  # called here
                press()
                directions.append(head.get_attribute("aria-sort"))
                now = read_rows(table)
                assert sorted(now) == sorted(before)  # whole rows move
                values = [COLUMNS[name](standings[row[0]]) for row in now]
                known = [value for value in values if value is not None]
                assert values[: len(known)] == known
                assert known == sorted(known, reverse=directions[-1] == "descending")  # type: ignore[type-var]
                assert table.locator("[aria-sort]").count() == 1
            assert directions[0] == directions[2] != directions[1]
            assert set(directions) == {"ascending", "descending"}


CLIPPED = """() => [...document.querySelectorAll("h1, h2, p, dt, dd, li, summary, th, td, button")]
    .filter(it => it.scrollWidth > it.clientWidth + 1 && getComputedStyle(it).display !== "inline").map(it => it.outerHTML)"""
OUTSIDE = """() => [...document.querySelectorAll("svg")].flatMap(svg => {
    const room = svg.getBoundingClientRect();
    return [...svg.querySelectorAll("text")].filter(it => {
        const box = it.getBoundingClientRect();
        return box.left < room.left - 1 || box.right > room.right + 1 || box.top < room.top - 1 || box.bottom > room.bottom + 1;
    }).map(it => it.outerHTML);
})"""
TOUCHING = """() => [...document.querySelectorAll("svg")].flatMap(svg => {
    const boxes = [...svg.querySelectorAll("text")].map(it => [it.textContent, it.getBoundingClientRect()]);
    const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom - 2 && b.top < a.bottom - 2;
    return boxes.flatMap(([one, a], i) => boxes.slice(i + 1).filter(([, b]) => meet(a, b)).map(([other]) => [one, other]));
})"""
COLORS = "[getComputedStyle(document.body).backgroundColor, getComputedStyle(document.body).color]"
SHADES = """() => [...document.querySelectorAll(".cross td[class^=s] button")].map(it =>
    [getComputedStyle(it.parentNode).backgroundColor, getComputedStyle(it).color])"""


def luminance(color: str) -> float:
    """Return how bright a `rgb(...)` is, from 0 to 1: WCAG 2, relative luminance."""
    parts = [int(part) / 255 for part in color.removeprefix("rgb(").removesuffix(")").split(",")]
    red, green, blue = (part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_cut_off_and_the_page_never_scrolls_sideways(show: Show, report: Report, tmp_path: Path, width: int) -> None:
    with show(report, width=width) as page:
        for scheme in SCHEMES:
            page.emulate_media(color_scheme=scheme)
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            assert page.evaluate(OUTSIDE) == []
            assert page.evaluate(TOUCHING) == []
            page.screenshot(path=tmp_path / f"{scheme}-{width}.png", full_page=True)
            assert (tmp_path / f"{scheme}-{width}.png").stat().st_size > 20_000
            style = page.add_style_tag(
                content=".name { max-width: none !important; } .cross span { max-height: none !important; }"
            )  # long names may be
            assert page.evaluate(CLIPPED) == []
            page.evaluate("document.querySelectorAll('details').forEach(it => it.open = true)")
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            page.evaluate("document.querySelectorAll('details').forEach(it => it.open = false)")
            style.evaluate("it => it.remove()")


def test_at_1280_pixels_every_table_of_nine_entries_is_seen_whole_and_results_come_before_warnings(
    show: Show, report: Report
) -> None:
    with show(report, width=1280) as page:
        cut = page.evaluate(
            "[...document.querySelectorAll('.wide')].filter(it => it.scrollWidth > it.clientWidth).map(it => it.ariaLabel)"
        )
        heads = page.locator("h1, h2").all_text_contents()

        assert cut == []
        assert page.title() == "League friday: report"
        assert heads.index("League friday") < heads.index("Leaderboard") < heads.index("Warnings")


@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_no_fault_in_a_report(show: Show, report: Report, axe: Callable[["Page", bool], str], width: int) -> None:
    with show(report, width=width) as page:
        for scheme in SCHEMES:
            page.emulate_media(color_scheme=scheme)
            assert axe(page, scheme == "dark") == "", scheme


def test_a_match_of_a_small_league_is_played_again_in_the_report(browser: "Browser", tmp_path: Path) -> None:
    (tmp_path / "friday.toml").write_text(LEAGUE)
    run_here("tournament", "run", tmp_path / "friday.toml", "--data", tmp_path)
    page = browser.new_page()
    wrongs: list[str] = []
    page.on("console", lambda message: wrongs.append(message.text))
    page.on("pageerror", lambda error: wrongs.append(str(error)))
    page.goto((tmp_path / "reports" / "friday.html").as_uri())

    page.locator("summary").click()
    page.get_by_role("link", name="blue rush, red random").click()
    replay = page.frame_locator("iframe")
    replay.get_by_text("Every tick was played again and holds.").wait_for()
    assert replay.get_by_role("heading", level=1).text_content() == "rush against random"
    journal = page.get_by_role("link", name="Journal", exact=True).get_attribute("href")
    assert unquote(journal or "").endswith("/journals/friday/friday+random+rush+0000+rush-blue+0.journal")
    page.get_by_role("button", name="Close").click()
    page.locator("iframe").wait_for(state="detached")  # a dialog tells that it was closed in a task of its own
    assert wrongs == []
    page.close()


def test_a_report_carries_no_replay_of_a_map_that_may_come_again() -> None:
    def of(*played: tuple[int, str]) -> list[str]:
        return [str(LeagueMatchId(league="l", one="a", other="b", pair=pair, blue=blue)) for pair, blue in played]

    pair, half = of((0, "a"), (0, "b")), of((1, "a"))

    assert find_visible(pair + half, 2, is_complete=False) == set()
    assert find_visible(pair + half, 2, is_complete=True) == set(pair)
    assert find_visible(pair, 1, is_complete=False) == set(pair)


def test_the_longest_names_are_shortened(show: Show) -> None:
    with show(pretend(14, 1, tail="-" + "abcdefghij" * 4), width=390) as page:
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate(OUTSIDE) == []
        assert page.evaluate(TOUCHING) == []


def test_it_is_as_dark_as_the_reader_likes_and_every_shade_can_be_read(show: Show, report: Report) -> None:
    with show(report) as page:
        for scheme in SCHEMES:
            page.emulate_media(color_scheme=scheme)
            ground, ink = page.evaluate(COLORS)
            shades = {tuple(shade) for shade in page.evaluate(SHADES)}

            assert (luminance(ground) < luminance(ink)) is (scheme == "dark")
            assert contrast(ground, ink) > 7
            assert len(shades) > 5
            assert min(contrast(*shade) for shade in shades) >= 4.5


def test_the_widest_table_scrolls_in_its_box(show: Show, report: Report) -> None:
    with show(report, width=390) as page:
        box = page.locator(".wide:has(.cross)")
        assert box.evaluate("it => it.scrollWidth > it.clientWidth")
        box.evaluate("it => it.scrollLeft = 10_000")
        assert (
            page.locator(".cross tbody .name").first.evaluate("it => it.getBoundingClientRect().left") >= 0
        )  # names stay in sight
        assert page.evaluate("scrollX") == 0


@pytest.mark.parametrize(("n_pairs", "bundled"), [(3, False), (MOST_LISTED // 4, False), (3, True), (MOST_LISTED // 4, True)])
def test_each_cell_of_the_cross_table_leads_to_its_journals_or_names_them(show: Show, n_pairs: int, bundled: bool) -> None:
    report = pretend(3, n_pairs)
    missing = report.outcomes[1::7]  # a league that is not over
    report = make_report(report.league, [outcome for outcome in report.outcomes if outcome not in missing], n_draws=5)
    assert (report.standings.n_matches <= MOST_LISTED) is (n_pairs == 3)
    outcomes = {f"journals/friday/{journal_name(outcome.identity)}": outcome for outcome in report.outcomes}
    found: Counter[str] = Counter()
    with show(report, bundled=bundled) as page:
        assert page.get_by_text("arena replay list").count() == bundled
        for cell in page.locator(".cross button").all()[:: 3 if bundled else 1]:
            cell.press("Enter")
            opened = page.locator("details:has(summary:focus)")
            one, other = cell.get_attribute("title").partition(":")[0].split(" v ")  # type: ignore[union-attr]
            assert opened.evaluate("it => it.open")
            assert {one, other} <= set(opened.locator("summary").inner_text().replace(":", "").split())
            links: list[str] = opened.evaluate(
                "it => [...it.querySelectorAll('a')].map(it => it.getAttribute('href') ?? it.title)"
            )
            if bundled:
                assert opened.locator("a[href]").count() == 0
                links = [f"journals/friday/{name}" for name in links]
            texts: list[str] = opened.evaluate("it => [...it.querySelectorAll('li')].map(it => it.textContent)")
            found.update(links)
            for link, text in zip(links, texts, strict=True):
                outcome = outcomes[unquote(link)]
                verdict = "draw" if outcome.winner is None else f"{outcome.winner} wins"
                assert text.startswith(f"blue {outcome.blue}, red {outcome.red}: {verdict}")

    if bundled:
        return
    assert {unquote(link) for link in found} == outcomes.keys()
    assert set(found.values()) == {2}  # from both cells of its fixture, and once in each list


def test_a_reason_that_is_markup_is_shown_and_not_obeyed(show: Show) -> None:
    with show(pretend(3, 1, reason=EVIL)) as page:
        assert page.evaluate("window.evil") is None
        assert page.locator("li", has_text="window.evil").count() == 6


def test_the_page_lets_no_other_script_run_and_nothing_be_fetched(browser: "Browser", tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    page_text = to_html(pretend(3, 1), file, tmp_path)
    file.write_text(page_text.replace("</main>", "</main><script>window.evil = 1</script>"), encoding="utf-8")
    page = browser.new_page()
    page.goto(file.as_uri())

    assert page.evaluate("window.evil") is None
    assert page.evaluate("fetch('http://127.0.0.1:9/').then(() => 'fetched', error => error.name)") == "TypeError"
    refused = page.evaluate(
        "new Promise(done => { addEventListener('securitypolicyviolation', event => done(event.violatedDirective));"
        " const it = new Image(); it.src = 'http://127.0.0.1:9/'; document.body.append(it); })"
    )
    assert refused == "img-src"
    page.close()


def test_it_prints_in_black_on_white(show: Show, report: Report) -> None:
    with show(report, width=390, scheme="dark") as page:
        page.emulate_media(media="print", color_scheme="dark")
        card, ink = page.evaluate(
            "[getComputedStyle(document.querySelector('.name')).backgroundColor, getComputedStyle(document.body).color]"
        )

    assert luminance(card) == 1
    assert luminance(ink) < 0.05


def test_thirty_entries_fit_into_150_kb(size: Callable[[int, int], int]) -> None:
    for n_pairs in (1, 3, size(6, 20)):
        page = to_html(pretend(30, n_pairs, n_draws=3), Path("page.html"), Path("journals/friday"))
        assert len(page.encode()) < 150_000
