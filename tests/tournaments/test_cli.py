"""The command line: what it prints, what it imports, and how it refuses."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

import arena
import arena.cli
import tournaments.cli
from arena.errors import JournalError
from arena.game.ruleset import RULESETS, load
from arena.match.time_control import MOST_S

Run = Callable[..., subprocess.CompletedProcess[str]]
HEAVY = {"torch", "zenoh", "numba", "scipy", "cryptography"}


def run_python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)


def plug_in(monkeypatch: pytest.MonkeyPatch, group: str, **points: str) -> None:
    """Let `entry_points` answer with `points` for one group, as if a package that brings them were installed."""

    def found(**wanted: str) -> list[EntryPoint]:
        if wanted["group"] != group:
            return list(entry_points(**wanted))
        return [EntryPoint(name, value, group) for name, value in points.items()]

    monkeypatch.setattr(arena.cli, "entry_points", found)


@pytest.mark.parametrize("package", ["arena", "clients", "policies", "tournaments", "tournaments.cli"])
def test_importing_a_package_loads_nothing_heavy(package: str) -> None:
    done = run_python(f"import sys, {package}; print('loaded', *{HEAVY | {'numpy'}} & set(sys.modules))")

    assert done.stdout.split() == ["loaded"]


def test_a_bot_author_gets_the_words_from_arena_without_numba() -> None:
    words = "Action, Code, EnemyUnit, MatchInfo, MatchResult, Observation, OwnUnit, Team"
    done = run_python(f"import sys; from arena import {words}; print('loaded', *{HEAVY} & set(sys.modules))")

    assert done.stdout.split() == ["loaded"]


def test_arena_names_what_it_hands_on_and_nothing_else() -> None:
    assert {"Action", "Observation", "Team"} <= set(dir(arena))
    assert all(hasattr(arena, name) for name in dir(arena))
    assert not hasattr(arena, "Acton")


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import atexit, sys; from tournaments.cli import main; sys.argv = ['arena', '--help'];"
        f"atexit.register(lambda: print('loaded', *{HEAVY | {'numpy'}} & set(sys.modules))); main()"
    )

    assert run_python(code).stdout.splitlines()[-1].split() == ["loaded"]


def test_help_names_every_command_with_a_line_about_it(arena: Run) -> None:
    text = arena("--help").stdout

    for name, command in tournaments.cli.COMMANDS.items():
        about = typer.main.get_command(command).help if isinstance(command, typer.Typer) else command.__doc__
        assert f" {name} " in text
        assert about
        assert about.split("\n")[0][:30] in text


def test_version_is_one_line(arena: Run) -> None:
    done = arena("--version")

    assert (done.returncode, done.stdout.split()[0], len(done.stdout.splitlines())) == (0, "arena", 1)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["ruls"], "unknown command 'ruls'; did you mean 'rules'?"),
        (["rules", "papr"], "unknown ruleset 'papr'; did you mean 'paper'?"),
        (["rules", "absent.toml"], "cannot read the ruleset absent.toml: No such file or directory"),
        (["rules", "paper", "--set", "sidee=16"], "did you mean 'side'?"),
        (["rules", "paper", "--set", "side=15"], "ruleset paper: side is 15; it must be even"),
        (["rules", "paper", "--set", "side"], "write KEY=VALUE, as in side=16"),
        (["rules", "--set", "side=16"], "--set changes one ruleset; name it"),
        (["bench", "kernell"], "unknown benchmark 'kernell'"),
    ],
)
def test_a_wrong_word_gets_one_sentence_and_exit_code_2(arena: Run, arguments: list[str], sentence: str) -> None:
    done = arena(*arguments)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("arena: ")
    assert sentence in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_no_clock_takes_more_seconds_than_a_system_can_wait() -> None:
    top: Any = typer.main.get_command(tournaments.cli.app)
    context = top.make_context("arena", ["--help"], resilient_parsing=True)
    commands = [top.get_command(context, name) for name in tournaments.cli.COMMANDS]
    commands += [inner for one in commands for inner in getattr(one, "commands", {}).values()]
    clocks = [option for one in commands for option in one.params if option.metavar == "SECONDS"]
    clocks = [option for option in clocks if option.name not in ("bank", "patience")]  # these may be without end

    assert len(clocks) == 5
    assert {option.max for option in clocks} == {MOST_S}


@pytest.mark.parametrize("arguments", [["--frobnicate"], ["rules", "--frobnicate"], ["rules", "paper", "gym-cap"], []])
def test_wrong_usage_exits_2_without_a_traceback(arena: Run, arguments: list[str]) -> None:
    done = arena(*arguments)

    assert done.returncode == 2
    assert "Traceback" not in done.stderr + done.stdout


def test_rules_lists_every_ruleset(arena: Run) -> None:
    text = arena("rules").stdout
    facts = json.loads(arena("rules", "--json").stdout)

    assert [one["name"] for one in facts] == list(RULESETS)
    assert all(one["name"] in text and one["about"] in text for one in facts)


@pytest.mark.parametrize("name", RULESETS)
def test_a_shown_ruleset_can_be_saved_and_loaded(arena: Run, name: str, tmp_path: Path) -> None:
    path = tmp_path / "saved.toml"
    path.write_text(arena("rules", name, "--set", "units.ugv.sight=6").stdout)

    assert load(str(path)).hash == load(name).with_({"units": {"ugv": {"sight": 6}}}).hash
    assert load(str(path)).hash in path.read_text()


def test_a_drawn_board_can_be_saved_and_loaded(arena: Run, tmp_path: Path) -> None:
    path, saved = tmp_path / "drawn.toml", tmp_path / "saved.toml"
    path.write_text("base = 'paper'\nboard = '''\nF...\nU..u\n...a\n...f\n'''\n")
    saved.write_text(arena("rules", path).stdout)

    assert load(str(saved)).hash == load(str(path)).hash


def test_json_is_one_document_with_the_hash(arena: Run) -> None:
    done = arena("rules", "paper", "--json", "--set", "side=16")

    facts = json.loads(done.stdout)
    assert (facts["name"], facts["rules"]["side"], done.stderr) == ("paper", 16, "")
    assert facts["hash"] == load("paper").with_({"side": 16}).hash


def test_rulesets_are_completed() -> None:
    code = "from tournaments.cli import main; main()"
    environment = os.environ | {"_ARENA_COMPLETE": "complete_bash", "COMP_WORDS": "arena rules ex", "COMP_CWORD": "2"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=False)

    assert done.stdout.split() == ["exp1", "exp2", "exp3", "exp4"]


def measure(progress: Callable[[str], None]) -> dict[str, object]:
    """Count to three."""
    progress("counting")
    return {"paper": {"ticks_per_s": 1_234_567.8, "threads": 2}, "fast": True}


def test_a_benchmark_plugs_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "a_benchmark", sys.modules[__name__])
    monkeypatch.setattr("tournaments.commands.bench._FOLDER", tmp_path)
    plug_in(monkeypatch, "arena.benchmarks", count="a_benchmark:measure")

    listed = CliRunner().invoke(tournaments.cli.app, ["bench"])
    table = CliRunner().invoke(tournaments.cli.app, ["bench", "count"])
    document = CliRunner().invoke(tournaments.cli.app, ["bench", "--all", "--json"])

    assert "Count to three." in listed.stdout
    assert "count / paper / ticks_per_s" in table.stdout
    assert "1,234,568" in table.stdout
    assert json.loads(document.stdout) == {"count": {"paper": {"ticks_per_s": 1_234_567.8, "threads": 2}, "fast": True}}
    assert document.stderr == "count: counting\n"


def test_a_broken_plugin_breaks_itself_alone(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    plug_in(monkeypatch, "arena.commands", broken="no_such_module:command")

    listed = CliRunner().invoke(tournaments.cli.app, ["--help"])
    monkeypatch.setattr(sys, "argv", ["arena", "broken"])
    with pytest.raises(SystemExit) as ending:
        tournaments.cli.main()

    assert "Cannot be loaded" in listed.stdout
    assert "List the rulesets" in listed.stdout
    assert ending.value.code == 1
    assert "the command broken cannot be loaded from no_such_module:command" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [(JournalError("the journal ends early"), 2, "arena: the journal ends early\n"), (KeyboardInterrupt(), 130, "")],
)
def test_main_turns_errors_into_a_sentence_and_an_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: BaseException, code: int, said: str
) -> None:
    def fail() -> None:
        """Fail."""
        raise error

    plug_in(monkeypatch, "arena.commands", fail="x:y")
    monkeypatch.setattr(EntryPoint, "load", lambda _: fail)
    monkeypatch.setattr(sys, "argv", ["arena", "fail"])

    with pytest.raises(SystemExit) as ending:
        tournaments.cli.main()

    assert (ending.value.code, capsys.readouterr().err) == (code, said)


def test_our_own_bug_is_not_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    plug_in(monkeypatch, "arena.commands", fail="x:y")
    monkeypatch.setattr(EntryPoint, "load", lambda _: lambda: 1 // 0)
    monkeypatch.setattr(sys, "argv", ["arena", "fail"])

    with pytest.raises(ZeroDivisionError):
        tournaments.cli.main()


def test_a_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -c 'from tournaments.cli import main; main()' rules paper --json"
    done = subprocess.run(["bash", "-c", f"{command} | true"], capture_output=True, text=True, timeout=60, check=False)

    assert done.stderr == ""


def test_verbose_logs_to_stderr_alone(arena: Run) -> None:
    done = arena("-vv", "rules", "paper", "--json")

    assert json.loads(done.stdout)["name"] == "paper"
