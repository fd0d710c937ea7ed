"""`arena tournament run` as a user types it: in a folder of his own, again, and twice at once."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.errors import InputError
from tournaments.league.file import parse_league
from tournaments.running.scheduler import Folders, Scheduler
from tournaments.store.lock import TakenError
from tournaments.store.store import Store

Arena = Callable[..., subprocess.CompletedProcess[str]]
LEAGUE = 'pairs = 1\nseed = 1\nturn_time_s = 0\ntrusted = ["mine"]\nentries = ["rush", "{bot}"]\n[rules]\ntick_limit = 5\n'
BOT = """
import os
with open("starts", "a") as file:
    file.write(os.environ["HOME"] + "\\n")
def act(observation):
    return [0] * len(observation.units)
"""


@pytest.fixture
def league(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a league's file, relative to the current folder."""
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(BOT)
    Path("friday.toml").write_text(LEAGUE.format(bot="mine.py"))
    return Path("friday.toml")


def test_paths_are_relative_to_where_it_is_typed_and_a_trusted_fighter_plays_in_a_home_of_its_own(
    arena: Arena, league: Path
) -> None:
    ran = arena("tournament", "run", league, "--data", "data")

    assert ran.returncode == 0, ran.stderr
    assert (Path("data/reports/friday.html").is_file(), len(list(Path("data/journals/friday").glob("*.journal")))) == (True, 2)
    homes = set(Path("data/homes/friday/mine/starts").read_text().splitlines())
    assert homes == {str(Path("data/homes/friday/mine").absolute())}


@pytest.mark.usefixtures("one_core")
def test_a_league_that_is_over_starts_nobody_and_one_with_more_pairs_tries_all_again(
    arena: Arena, here: Arena, league: Path
) -> None:
    def run() -> int:
        ran = here("tournament", "run", league, "--venue", "local", "--data", "data")
        assert ran.returncode == 0, ran.stderr
        return len(Path("starts").read_text().splitlines())

    n_starts = run()
    assert run() == n_starts
    league.write_text(league.read_text().replace("pairs = 1", "pairs = 2"))
    assert run() > n_starts


def test_two_schedulers_with_two_stores_do_not_write_the_same_journals(tmp_path: Path) -> None:
    friday, monday = (parse_league('seed = 1\nentries = ["rush", "patrol"]', name, tmp_path) for name in ("friday", "monday"))
    folders = Folders(data=tmp_path / "data")
    with Store(str(tmp_path / "one.db")) as one, Store(str(tmp_path / "two.db")) as two:
        with Scheduler(friday, one, folders):
            with pytest.raises(TakenError, match=r"another scheduler runs league friday \(it holds .*journals/friday.lock\)"):
                Scheduler(friday, two, folders).__enter__()
            assert two.leagues() == []
            with Scheduler(monday, two, folders), Scheduler(friday, two, Folders(data=tmp_path / "elsewhere")):
                pass
        with Scheduler(friday, two, folders):
            pass


def test_a_data_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("no folder")
    friday = parse_league('seed = 1\nentries = ["rush", "patrol"]', "friday", tmp_path)

    with Store(str(tmp_path / "one.db")) as store:
        with pytest.raises(InputError, match=r"cannot lock the league with .*friday.lock: Not a directory"):
            Scheduler(friday, store, Folders(data=tmp_path / "data")).__enter__()
        with store.lock("friday"):  # it was let go
            pass
