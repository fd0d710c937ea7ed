"""The secret of a league, which nobody is told while pairs can still be added."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.game.keys import derive_map_key, secret_from_seed
from arena.records.journal_folder import find_journals, load_journal
from tournaments.league.file import load_league
from tournaments.running.scheduler import Folders, Scheduler
from tournaments.store.store import Store
from tournaments.venues.local import play as play_local

Run = Callable[..., subprocess.CompletedProcess[str]]
LEAGUE = 'name = "cup"\npairs = {}\nentries = ["rush", "random"]\n[rules]\ntick_limit = 4\n'


class League:
    """A league of two, in files of its own."""

    def __init__(self, run: Run, folder: Path) -> None:
        self._run, self.data, self.file = run, folder / "data", folder / "cup.toml"

    def __call__(self, *words: str) -> subprocess.CompletedProcess[str]:
        return self._run("tournament", words[0], self.file, *words[1:], "--data", self.data)

    def play(self, pairs: int, more: str = "") -> subprocess.CompletedProcess[str]:
        self.file.write_text(more + LEAGUE.format(pairs))
        return self("run", "--venue", "local")

    @property
    def secret(self) -> str:
        return (self.data / "keys" / "cup.secret").read_text().strip()

    def reports(self) -> str:
        """Return everything that anyone is shown of the league."""
        page = (self.data / "reports" / "cup.html").read_text()
        forms = [self("report", "--format", form).stdout for form in ("text", "html", "md", "json")]
        return page + "".join(forms) + self._run("leaderboard", "--data", self.data).stdout


@pytest.fixture
def league(here: Run, one_core: None, tmp_path: Path) -> League:
    return League(here, tmp_path)


def test_no_report_tells_a_secret_before_its_league_is_closed(league: League) -> None:
    played = league.play(1)
    assert played.returncode == 0, played.stderr
    assert league.secret not in played.stdout + league.reports()

    raised = league.play(2)
    assert raised.returncode == 0, raised.stderr
    assert league.secret not in raised.stdout + league.reports()

    closed = league("close")
    assert (closed.returncode, closed.stdout.split()[-1]) == (0, league.secret)
    assert league.play(2).stdout.count(league.secret) == 1
    assert league.reports().count(league.secret) == 6
    assert json.loads(league("report", "--json").stdout)["league"]["secret"] == league.secret


def test_a_closed_league_takes_no_more_pairs_and_stays_what_it_was(league: League) -> None:
    league.play(1)
    before = json.loads(league("report", "--json").stdout)["league"]
    assert league("close").returncode == 0

    raised = league.play(2)

    assert (raised.returncode, raised.stdout) == (2, "")
    assert raised.stderr.endswith(
        "league cup is closed and takes no more matches (pairs would be new): whoever knows its secret knows the maps; "
        "give the league another name\n"
    )
    league.file.write_text(league.file.read_text().replace("pairs = 2", "pairs = 1").replace("random", "patrol"))
    assert "(patrol would be new)" in league("run", "--venue", "local").stderr
    assert league.play(1).returncode == 0
    assert json.loads(league("report", "--json").stdout)["league"] == before | {"secret": league.secret}


def test_who_knows_the_secret_can_check_the_maps(league: League) -> None:
    league.play(1)
    secret = bytes.fromhex(league("close").stdout.split()[-1])

    journals = [load_journal(path) for path in find_journals([league.data / "journals" / "cup"])]

    assert {journal.header.keys.map_key for journal in journals} == {derive_map_key(secret, "cup/random/rush", 0)}


def test_a_league_that_is_not_over_is_not_closed(league: League) -> None:
    league.file.write_text(LEAGUE.format(1))
    league.data.mkdir()
    with Store(str(league.data / "arena.db")) as store:
        chosen, folders = load_league(str(league.file)), Folders(data=league.data)
        with Scheduler(chosen, store, folders) as scheduler:
            next(iter(scheduler.run(play_local)))

    done = league("close")

    assert (done.returncode, done.stdout) == (2, "")
    assert "league cup is not over" in done.stderr
    assert league.play(1).returncode == 0
    assert league("close").returncode == 0


def test_a_league_whose_secret_is_gone_cannot_be_closed(league: League) -> None:
    league.play(1)
    (league.data / "keys" / "cup.secret").unlink()

    done = league("close")

    assert done.returncode == 2
    assert "the secret under which league cup was played is neither in its file nor in" in done.stderr


def test_a_seed_is_told_as_the_secret_that_it_stands_for(league: League) -> None:
    league.play(1, "seed = 3\n")

    assert league("close").stdout.split()[-1] == secret_from_seed(3).hex()
