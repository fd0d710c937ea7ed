"""What a user reads is what he read: help, refusals, tables, and the reports of leagues."""

import json
import math
import re
import sqlite3
import subprocess
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.main import get_command

from arena.game.types import Team, Termination
from arena.pit.ladder import LadderMatch
from arena.policy import MatchResult
from policies.registry import OWN
from tournaments.cli import app
from tournaments.ladder.ladder import open_ladder
from tournaments.league.file import parse_league
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.reports.web_leagues import Leagues
from tournaments.store.store import Store

Arena = Callable[..., subprocess.CompletedProcess[str]]
Same = Callable[[str, str], None]
CARRIED = r"""(?s) 'sha256-[^']*'|(?<=id="player">).*?(?=</script>)|(?<=data-replay=")[^"]*"""
"""What a report carries of the pages' player and of replays, packed: none of it is the report's own."""
FORMATS = {"text": "txt", "md": "md", "csv": "csv", "json": "json", "html": "html"}
COLUMNS = "100"
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
MOMENT = re.compile(r"1\.\d{12,}e\+09|\b1\d{9}\.\d+|\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?(\+00:00|Z| UTC)?")
BORDER = re.compile(r"[\s─╮╯│]+$")
RATE = re.compile(r'"(per_s|left_s)": [^,}]+')
ROUND_ROBIN = """
pairs = 3
seed = 1
entries = ["rush", "patrol", "random", "squad"]
[rules]
side = 12
tick_limit = 40
"""
DUEL = """
pairs = 40
seed = 3
pairing = "sprt"
entries = ["squad", "random"]
[rules]
side = 10
tick_limit = 20
[sprt]
elo1 = 400
"""
KEPT = """
pairs = 2
seed = 5
pairing = "gauntlet"
challenger = "ann"
maps = "fresh"
[entries]
ann = "rush"
bob = "patrol"
"cid-2" = "random"
"""
BAD_FILES = {
    "odd.toml": "side = 7\nbase = 'paper'\n",
    "torn.toml": "side = \n",
    "wild.toml": "base = 'papr'\n",
    "crooked.txt": "F..u\nU..\n..A.\na..f\n",
    "flagless.txt": "...u\nU...\n..A.\na..f\n",
    "walled.txt": "F#.u\nU#..\n##..\n...f\n",
    "strange.txt": "F..u\nU.?.\n..A.\na..f\n",
    "broken.py": "def act(observation)\n    return []\n",
    "empty.py": "x = 1\n",
    "raising.py": "raise RuntimeError('no')\n",
    "twice.py": "class A:\n    def act(self, o): ...\nclass B:\n    def act(self, o): ...\n",
    "no.journal": "this is no journal",
    "no.safetensors": "this is no checkpoint",
    "lone.toml": 'entries = ["rush"]\n',
    "unknown.toml": 'entries = ["rush", "patrl"]\n',
    "misspelt.toml": 'entriess = ["rush", "patrol"]\n',
    "cheat.toml": 'entries = ["rush", "oracle_rush"]\n',
    "negative.toml": 'pairs = 0\nentries = ["rush", "patrol"]\n',
    "secretive.toml": 'secret = "12"\nentries = ["rush", "patrol"]\n',
    "keyed.toml": 'maps = "fresh"\n[entries]\nann = "key:short"\nbob = "rush"\n',
    "invites": "short\n",
    "key.pem": "this is no key",
    "shut.pem": "this is no key",
    "folder/nothing": "",
}
BAD = """
ply
--frobnicate
rules papr
rules absent.toml
rules odd.toml
rules torn.toml
rules wild.toml
rules paper gym-cap
rules paper --set sidee=16
rules paper --set side=15
rules paper --set side
rules paper --set units.ugv.step=2
rules paper --set units.ugv.red=17
rules paper --set units.tank.sight=2
rules mirror --set units.ugv.red=1
rules --set side=16
bench kernell
bench policies --minutes 1
play rush
play rush patrl
play rush patrol --pairs 0
play rush patrol --rules papr
play rush patrol --board absent.txt
play rush patrol --board crooked.txt
play rush patrol --board flagless.txt
play rush patrol --board walled.txt
play rush patrol --board strange.txt
play rush absent.py
play rush broken.py
play rush empty.py
play rush raising.py
play rush twice.py
play rush exec:
play rush exec:./absent
play rush no.safetensors
play rush patrol --pairs 1 --seed 1 --journals no.journal
evaluate oracle_rush --against rush
evaluate rush --against candidate
evaluate rush --against rsh
evaluate absent.safetensors
replay verify absent.journal
replay verify no.journal
replay verify folder
replay verify no.journal --transcript absent
replay show no.journal
replay show small.journal --team green
replay show small.journal --tick 99
replay export small.journal
replay export small.journal --gif --tick 1
replay export small.journal --png --tick 99
replay export small.journal --png --cell 5
tournament run absent.toml --data data
tournament run strter --data data
tournament run starter --venue moon --data data
tournament run starter --format pdf --data data
tournament run starter --progress loud --data data
tournament run lone.toml --data data
tournament run unknown.toml --data data
tournament run misspelt.toml --data data
tournament run cheat.toml --data data
tournament run negative.toml --data data
tournament run secretive.toml --data data
tournament run keyed.toml --data data
tournament report friday --data data
tournament status friday --db absent.db
tournament init odd.toml
tournament init league.txt
leaderboard --data data
leaderboard --ladder --data data
leaderboard --data data --format pdf
join frob --data data
join --team green --data data
join --policy patrl --data data
join --policy human --data data
join --autopilot rush --data data
join --name a/b --data data
join --rules papr --data data
join --key key.pem --data data
join --key shut.pem --data data
keys show ann
keys new a/b
keys forget 127.0.0.1:7447/pit
serve --rules papr --data data
serve --pit a/b --data data
serve --db other.db --data data
serve --web 8000 --no-web --data data
serve --web-host 0.0.0.0 --data data
serve --web 8000 --web-host 0.0.0.0 --data data
serve --metrics 9100 --data data
serve --workers 0 --data data
serve --machine =2 --data data
serve --machine far=0 --data data
serve --machine far=64 --workers 2 --data data
serve --invite absent --data data
serve --matches 0 --data data
web --host 0.0.0.0 --data data
web --pit frob --data data
web --spectator-key absent --data data
admin kick
admin kick ann --pit frob --data data
admin close --data elsewhere
train --method magic
train --device tpu
train --stage 1
watch --pit frob
policies --frobnicate
"""
"""A command a line; none of them gets so far as to look for a pit."""


@pytest.fixture(autouse=True)
def a_terminal_of_one_width(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FORCE_COLOR", "PY_COLORS", "GITHUB_ACTIONS", "TERMINAL_WIDTH"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"COLUMNS": COLUMNS, "LINES": "50", "NO_COLOR": "1", "TERM": "dumb"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("arena.console._LINE_EVERY_S", math.inf)  # a busy machine would say how far it is


def walk(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the words of a command, and of all below it."""
    yield path
    if hasattr(command, "list_commands"):
        context = typer.Context(command, info_name="arena")
        for name in command.list_commands(context):
            yield from walk(command.get_command(context, name), (*path, name))


def plain(text: str, *folders: Path) -> str:
    """Return what was printed without colours, moments, rates, folders, and what ends a line in blanks or a border."""
    for folder in folders:
        text = text.replace(str(folder), "HERE")
    text = RATE.sub(r'"\1": ...', MOMENT.sub("MOMENT", COLOUR.sub("", text)))
    return "".join(f"{BORDER.sub('', line)}\n" for line in text.splitlines())


def transcribe(done: subprocess.CompletedProcess[str], folder: Path) -> str:
    """Return a command, its exit code and what it said."""
    parts = [f"$ {' '.join(done.args)}", f"exit {done.returncode}"]
    parts += [f"{name}:\n{plain(text, folder)}".rstrip() for name, text in (("out", done.stdout), ("err", done.stderr)) if text]
    return plain("\n".join(parts), folder) + "\n"


# Commands


def test_the_help_of_every_command_is_that_of_before(here: Arena, same: Same) -> None:
    pages = []
    for path in walk(get_command(app)):
        done = here(*path, "--help")
        assert (done.returncode, done.stderr) == (0, ""), path
        pages.append(f"$ arena {' '.join((*path, '--help'))}\n{plain(done.stdout)}\n")

    same("help.txt", "".join(pages))


def test_wrong_words_are_refused_as_before(
    here: Arena, same: Same, small_journal: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in BAD_FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o600 if name == "shut.pem" else 0o644)
    (tmp_path / "small.journal").write_bytes(small_journal)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))  # where nobody names a folder
    monkeypatch.setenv("ARENA_CONFIG", str(tmp_path / "config"))

    told = [transcribe(here(*line.split()), tmp_path) for line in BAD.strip().splitlines()]

    same("refusals.txt", "\n".join(told))


def test_what_commands_print_is_that_of_before(
    here: Arena, same: Same, small_journal: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "small.journal").write_bytes(small_journal)
    (tmp_path / "changed.journal").write_bytes(small_journal[:-1] + b"\0")
    monkeypatch.chdir(tmp_path)
    commands = """
        rules
        rules --json
        rules gym-cap
        rules paper --json --set side=16
        replay verify --local small.journal
        replay verify small.journal --json
        replay verify --local small.journal changed.journal
        replay show small.journal
        replay show small.journal --team red --tick 2
        play squad fighter --pairs 3 --seed 4 --workers 1
        play squad fighter --pairs 3 --seed 4 --workers 1 --json
        play rush oracle_rush --pairs 2 --seed 4 --workers 1 --set side=12
        evaluate squad --against rush,patrol --pairs 3 --workers 1
        evaluate squad --against rush --pairs 3 --workers 1 --json
        evaluate rush --rules exp1 --pairs 3 --workers 1 --json
        tournament init league.toml
        keys list
    """

    told = [transcribe(here(*line.split()), tmp_path) for line in commands.strip().splitlines()]

    same("printed.txt", "\n".join([*told, (tmp_path / "league.toml").read_text()]))


def test_every_fighter_is_told_of_as_before(here: Arena, same: Same) -> None:
    told = json.loads(here("policies", "--json").stdout)

    same("policies.json", json.dumps([one for one in told if one["name"] in OWN], indent=1) + "\n")


# Leagues


def report_in_every_format(here: Arena, same: Same, name: str, data: Path) -> None:
    """Compare what is reported of a stored league."""
    hashes = []
    for form, ending in FORMATS.items():
        done = here("tournament", "report", name, "--data", data, "--format", form)
        assert (done.returncode, done.stderr) == (0, "")
        text = plain(done.stdout, data)
        if form == "html":
            text = re.sub(CARRIED, "", text)
            hashes.append(f"html {len(text)} {sha256(text.encode()).hexdigest()}\n")
        else:
            same(f"reports/{name}.{ending}", text)
    shown = Leagues(data, "").report(name)
    shown["wall"]["written_at"] = "MOMENT"
    status = here("tournament", "status", name, "--data", data, "--json").stdout
    page = json.dumps(shown)
    same(f"reports/{name}.hashes", "".join(hashes) + f"page {len(page)} {sha256(page.encode()).hexdigest()}\n{status}")


@pytest.mark.usefixtures("one_core")
@pytest.mark.parametrize(("name", "league"), [("friday", ROUND_ROBIN), ("duel", DUEL)])
def test_a_league_is_played_stored_and_reported_as_before(
    name: str, league: str, here: Arena, same: Same, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / f"{name}.toml").write_text(league)

    ran = here("tournament", "run", f"{name}.toml", "--venue", "local", "--data", "data", "--progress", "json")
    again = here("tournament", "run", f"{name}.toml", "--venue", "local", "--data", "data")

    lines = ran.stderr.splitlines()
    said = plain(
        "\n".join(
            [lines[0], *sorted(plain(re.sub(r'"played": \d+', '"played": ...', line))[:-1] for line in lines[1:-1]), lines[-1]]
        )
    )
    digests = [
        f"{path.name} {sha256(path.read_bytes()).hexdigest()}" for path in sorted((tmp_path / "data/journals" / name).iterdir())
    ]
    same(f"reports/{name}.run", "\n".join([said, *digests, transcribe(again, tmp_path)]))
    report_in_every_format(here, same, name, tmp_path / "data")


def test_a_league_on_the_network_is_reported_as_before(
    here: Arena, same: Same, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its matches were not played: they have faults, answer times, forfeits and a match that is missing."""
    monkeypatch.chdir(tmp_path)  # a report links to its journals from where it is written
    league = parse_league(KEPT, "kept", tmp_path)
    with Store(str(tmp_path / "arena.db")) as store:
        row = store.enter("kept", {**league.definition, "secret": "5" * 64}, league.n_pairs)
        for number, identity in enumerate(
            f"kept/ann/{other}/{pair:04}/{blue}-blue/0"
            for other in ("bob", "cid-2")
            for pair in range(2)
            for blue in ("ann", other)
        ):
            _, one, other, _, seat, _ = identity.split("/")
            blue = seat.removesuffix("-blue")
            ending, winner, score, ticks, reason = (
                (Termination.CAPTURE, Team.BLUE, 100, 31, ""),
                (Termination.TICK_LIMIT, None, 0, 100, ""),
                (Termination.FORFEIT, Team.RED, -100, 12, "blue missed 10 turns in a row"),
                (Termination.ELIMINATION, Team.RED, -100, 44, ""),
            )[number % 4]
            seats = {
                team: SeatOutcome(
                    faults={"late": number, "vanished": 1} if team is Team.RED else {"unreadable": 2},
                    latency_p50_s=0.001 * (number + 1),
                    latency_p99_s=None if number == 2 else 0.02 + team / 8,
                )
                for team in Team
            }
            if number != 5:
                result = MatchResult(ending=ending, winner=winner, score=score, ticks=ticks, reason=reason)
                outcome = Outcome(identity=identity, blue=blue, red=other if blue == one else one, result=result, seats=seats)
                assert store.add(row, outcome)

    report_in_every_format(here, same, "kept", tmp_path)
    same("store.sql", dump(tmp_path / "arena.db"))


def dump(path: Path) -> str:
    """Return the tables of a store, and what they hold."""
    with sqlite3.connect(path) as database:
        text = "\n".join(database.iterdump())
    database.close()
    return plain(text)


def test_a_ladder_is_rated_and_shown_as_before(here: Arena, same: Same, tmp_path: Path) -> None:
    keys = {name: bytes([number]) * 32 for number, name in enumerate(("ann", "bob", "cid"), start=1)}
    games = ("ann", "bob", Team.BLUE), ("bob", "cid", None), ("cid", "ann", Team.RED), ("ann", "cid", Team.BLUE)
    with open_ladder(str(tmp_path / "arena.db"), "pit", "5" * 64) as ladder:
        for number, (blue, red, winner) in enumerate(games):
            ladder.count(
                LadderMatch(
                    identity=f"pit/ladder/{number:06}/{blue}/{red}",
                    names={Team.BLUE: blue, Team.RED: red},
                    entries={Team.BLUE: keys[blue], Team.RED: keys[red]},
                    rules_hash="5" * 64,
                    result=MatchResult(
                        ending=Termination.FORFEIT if number == 2 else Termination.TICK_LIMIT,
                        winner=winner,
                        score=0,
                        ticks=9,
                        reason="",
                    ),
                )
            )
        standings = json.dumps(ladder.standings(), indent=1)

    told = [
        transcribe(here("leaderboard", "--ladder", "--league", "pit", "--data", tmp_path, "--format", form), tmp_path)
        for form in ("text", "csv", "json")
    ]
    same("ladder.txt", "\n".join([standings, *told]))
