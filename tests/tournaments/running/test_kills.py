"""Kill whatever plays a league, at random moments: nothing is lost, nothing is played twice, and the report is the same."""

import json
import logging
import random
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from family import LeagueProcess, kill

from arena.records.framing import CutShortError
from arena.records.journal import journal_name, read_journal, whole_part
from arena.records.journal_bundle import Bundle
from arena.records.journal_folder import load_journal, read_recorded
from tournaments.store.store import Store, StoreError

logger = logging.getLogger(__name__)

BOT = """
import time
def act(observation):
    time.sleep(0.001)
    return [1 + (observation.tick // 3 + unit.index) % 4 for unit in observation.units]
"""
LEAGUES = {
    # A bot that takes its time, and so the league does; matches so short that a kill strikes between them often enough, and so
    # many that their journals are in bundles.
    "local": "pairs = {n_pairs}\ntrusted = ['one']\n[rules]\ntick_limit = 4\n",
    "network": "pairs = {n_pairs}\nslots = 1\nturn_time_s = 0\ngrace_s = 60\n[rules]\ntick_limit = 15\n",
}
ENTRIES = {"one": "one.py", "two": "rush", "three": "patrol"}
PAIRS = {"local": (101, 200), "network": (4, 10)}
"""Between two entries: at small size, and at full size."""
KILLS = {"local": (1, 8), "network": (2, 18)}
"""In each of two stores."""
ANY_TIME, MOST_S = 0.25, 0.5
"""Share of the kills that come at any time since the last; how long after progress the others come."""
AWAY = "its server must run, and let itself be reached from here"
MOST_REFEREES = 2
"""That are killed in one run of a league: it gives up after more."""


@dataclass(frozen=True, kw_only=True)
class Strike:
    """Where a kill struck."""

    what: str
    n_stored: int
    whole: dict[Path, int]
    """Journals of matches that had ended, and when each was last written to (nanoseconds); of one in a bundle, nobody knows."""
    running: dict[str, int]
    """Ticks of the matches in the middle of which it struck."""

    @property
    def where(self) -> str:
        if any(self.running.values()):
            return "in the middle of a match"
        return "between matches" if self.whole and not self.running else "before a first tick"

    def __str__(self) -> str:
        stands = f"{self.n_stored} matches stored, {len(self.whole)} ended, ticks of the others {list(self.running.values())}"
        return f"{self.what} killed {self.where}: {stands}"


def look(what: str, league: LeagueProcess) -> Strike:
    """Return where a league stands, by its files."""
    whole, running = {}, {}
    for path in sorted(places_of(league)):
        try:
            journal = read_journal(whole_part(read_recorded(path)))
        except CutShortError:
            running[path.name] = 0
            continue
        if journal.ending is None:
            running[path.name] = len(journal.ticks)
        else:
            whole[path] = written_at(path)
    return Strike(what=what, n_stored=count_stored(league.db), whole=whole, running=running)


def places_of(league: LeagueProcess) -> list[Path]:
    """Return the path of every journal, in bundles, too."""
    found = list(league.journals.glob("*.journal"))
    for bundle in map(Bundle, league.journals.glob("*.journals")):
        bundle.look()
        found += [bundle.path / journal_name(identity) for identity in bundle]
    return found


def written_at(path: Path) -> int:
    return path.stat().st_mtime_ns if path.is_file() else 0


def count_stored(db: str) -> int:
    try:
        with Store(db, make=False) as store:
            return store.count(store.latest())
    except StoreError:
        return 0  # killed before it made one


def facts(league: LeagueProcess) -> dict[str, Any]:
    """Return what a league came to: its report without what a clock measured, and its canonical journals."""
    report = json.loads(league.report.read_text())
    del report["wall"]
    return {"report": json.dumps(report)} | {path.name: load_journal(path).canonical for path in places_of(league)}


def runs_on(league: LeagueProcess, took_s: float) -> bool:
    """Let a league run for a random time, mostly counted from when it next wrote to a journal; False if it is over by then.

    Counted from its start alone, most kills would strike while Python imports.
    """
    if random.random() < ANY_TIME:
        return not league.ends_within(random.uniform(0.0, took_s))

    def sizes() -> dict[Path, int]:
        return {path: path.stat().st_size for path in league.journals.glob("*.journal*")}

    before = sizes()
    while sizes() == before:
        if league.ends_within(0.01):
            return False
    return not league.ends_within(random.uniform(0.0, MOST_S))


def torment(league: LeagueProcess, kinds: list[str], n_kills: int, took_s: float, cluster: Any) -> list[Strike]:
    """Run a league to its end, killing something at random moments, at most `n_kills` times."""
    strikes: list[Strike] = []
    while True:
        league.start()
        n_referees = 0
        while len(strikes) < n_kills and runs_on(league, took_s):
            what = random.choice(kinds)
            if what == "database":
                strikes.append(look(what, league))
                cluster.kill()
                cluster.start()
            elif what == "scheduler":
                league.kill()
                strikes.append(look(what, league))
                break
            elif n_referees < MOST_REFEREES and (referee := league.find_referee()) is not None:
                kill(referee)
                n_referees += 1
                strikes.append(look(what, league))
        else:
            if league.finish() == 0:
                return strikes
            assert [strike.what for strike in strikes[-1:]] == ["database"], league.said  # away as the league wanted to begin
            assert AWAY in league.said.splitlines()[-1], league.said


@dataclass(frozen=True, kw_only=True)
class Undisturbed:
    """A league, and what it comes to where nothing is killed."""

    venue: str
    file: Path
    expected: dict[str, Any]
    took_s: float


@pytest.fixture(scope="module", params=LEAGUES)
def undisturbed(
    request: pytest.FixtureRequest, size: Callable[[int, int], int], tmp_path_factory: pytest.TempPathFactory
) -> Undisturbed:
    """Run a league once, for all stores."""
    venue, folder = request.param, tmp_path_factory.mktemp(request.param)
    (folder / "one.py").write_text(BOT)
    entries = "".join(f"{name} = {json.dumps(spec)}\n" for name, spec in ENTRIES.items())
    file = folder / "friday.toml"
    file.write_text(f"seed = 1\n{LEAGUES[venue].format(n_pairs=size(*PAIRS[venue]))}[entries]\n{entries}")
    with pytest.MonkeyPatch.context() as patch, LeagueProcess(file, venue, folder / "data", str(folder / "arena.db")) as league:
        patch.setenv("ARENA_CONFIG", str(folder / "config"))
        begun_s = time.monotonic()
        league.start()
        assert league.finish() == 0, league.said
        return Undisturbed(venue=venue, file=file, expected=facts(league), took_s=time.monotonic() - begun_s)


def test_whatever_is_killed_the_league_ends_as_if_nothing_had_been(
    undisturbed: Undisturbed,
    store_url: str,
    size: Callable[[int, int], int],
    tmp_path: Path,
    request: pytest.FixtureRequest,
) -> None:
    venue = undisturbed.venue
    cluster = request.getfixturevalue("cluster") if store_url.startswith("postgresql") else None
    kinds = ["scheduler"] + ["referee"] * (venue == "network") + ["database"] * (cluster is not None)

    strikes: list[Strike] = []
    wanted = size(*KILLS[venue])
    for number in count():
        if len(strikes) == wanted:
            break
        assert number < 3 * wanted, "a league is over before it is struck"
        url = f"{tmp_path / f'{number}.db'}" if cluster is None else cluster.make_database()
        with LeagueProcess(undisturbed.file, venue, tmp_path / str(number), url) as league:
            struck = torment(league, kinds, wanted - len(strikes), undisturbed.took_s, cluster)
        strikes += struck
        assert facts(league) == undisturbed.expected
        names = [path.name for path in places_of(league)]
        assert sorted(names) == sorted(set(names)), "a match was played twice"
        for strike in struck:
            if strike.what != "database":  # which ends no match
                assert {path: written_at(path) for path in strike.whole} == strike.whole, "a match was played twice"

    for strike in strikes:
        logger.info("%s, %s", venue, strike)
    if venue == "network" and size(False, True):  # of a few, all may strike at one kind of place
        places = Counter(strike.where for strike in strikes)
        assert places["between matches"], places
        assert places["in the middle of a match"], places
