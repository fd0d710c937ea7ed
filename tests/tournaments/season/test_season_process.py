"""A season as a process: killed, opened again, and played to its end, in the venue `network`, over a real router."""

import json
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from family import PATIENCE_S, ArenaProcess

from arena.game.keys import derive_map_key
from arena.network.address import free_port
from arena.records.journal_folder import find_journals, load_journal
from arena.records.plan import LeagueMatchId
from tournaments.league.secret import commit_to
from tournaments.store.season_store import SeasonStore

Run = Callable[..., subprocess.CompletedProcess[str]]
FILE = """
name = "open-course"
turn_time_s = 5
[rules]
tick_limit = 6
[entries]
rush = "rush"
patrol = "patrol"
random = "random"
[season]
submissions = "tcp/127.0.0.1:{port}"
final_pairs = 1
"""


class OpenSeason(ArenaProcess):
    """`arena season open`."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "course.toml"
        self.file.write_text(FILE.format(port=free_port()))
        super().__init__(folder / "data", "season", "open", str(self.file), "--json")

    def store(self) -> SeasonStore:
        return SeasonStore(str(self.data / "arena.db"), make=False)

    def wait_for(self, n: int) -> None:
        """Wait until it says that so many matches ended since it was started last."""
        give_up_at = time.monotonic() + PATIENCE_S
        begin = self.said.count('"match"')
        while self.said.count('"match"') < begin + n:
            assert self.process is not None
            assert self.process.poll() is None, self.said
            assert time.monotonic() < give_up_at, self.said
            time.sleep(0.05)


@pytest.fixture
def season(tmp_path: Path) -> Iterator[OpenSeason]:
    with OpenSeason(tmp_path) as season:
        yield season


def test_a_season_that_is_killed_loses_nothing_and_ends_with_its_final(season: OpenSeason, here: Run) -> None:
    season.start()
    season.wait_for(5)
    season.kill()
    season.file.write_text(season.file.read_text() + "deadline = 2020-01-01T00:00:00Z\n")
    season.start()
    assert season.finish() == 0, season.said

    with season.store() as store:
        row, final = store.get("open-course"), store.get("open-course-final")
        played, in_final = store.outcomes(row), store.outcomes(final)
        table = store.standings(row)
    said = [json.loads(line) for line in season.said.splitlines() if line.startswith("{")]
    told = [line["identity"] for line in said if line["event"] == "match"]
    assert len(told) == len(set(told)) <= len(played) + len(in_final)
    assert {one.identity for one in played} >= {one for one in told if one.startswith("open-course/")}
    pairs = [LeagueMatchId.parse(one.identity).pair_id for one in played]
    assert all(pairs.count(pair) == 2 for pair in pairs)
    assert [line["phase"] for line in said if line["event"] == "phase"][-2:] == ["final", "over"]

    assert len(in_final) == 6
    assert table is not None
    assert (table["phase"], table["matches"], len(table["rows"])) == ("over", len(played), 3)
    assert row.secret is not None
    assert final.secret is not None
    assert row.secret != final.secret
    assert (commit_to(row.secret), commit_to(final.secret)) == (row.definition["secret"], final.definition["secret"])
    for path in find_journals([season.data / "journals" / "open-course-final"]):
        header = load_journal(path).header
        match = LeagueMatchId.parse(header.identity)
        assert header.keys.map_key == derive_map_key(final.secret, match.fixture, match.pair)
    assert "open-course" in here("season", "status", "--data", season.data).stdout
    assert f"from the secret {row.secret.hex()}\n" in here("season", "status", "open-course", "--data", season.data).stdout
    assert here("leaderboard", "--league", "open-course-final", "--data", season.data).returncode == 0
    again = here("season", "open", season.file, "--data", season.data)
    assert (again.returncode, again.stdout.split()[-1]) == (0, "over")


def test_what_is_no_season_is_refused_in_one_sentence(season: OpenSeason, here: Run, tmp_path: Path) -> None:
    league = tmp_path / "league.toml"
    league.write_text('entries = ["rush", "patrol"]')

    for words, sentence in (
        (("season", "open", league), "is no season: write [season] into it"),
        (("tournament", "run", season.file), "is a season, whose entries are submitted; open it by: arena season open"),
        (("season", "status", "nobody"), "no results yet"),
    ):
        done = here(*words, "--data", tmp_path / "none")
        assert (done.returncode, done.stdout) == (2, "")
        assert sentence in done.stderr
        assert done.stderr.count("\n") == 1
