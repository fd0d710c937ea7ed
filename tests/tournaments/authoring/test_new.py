"""What `arena new` writes plays in every language, and nothing that is there is touched."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from arena.errors import InputError
from policies.program import PREFIX
from tournaments.authoring.new import LANGUAGES, write_bot
from tournaments.league.file import load_league

Arena = Callable[..., subprocess.CompletedProcess[str]]
PLUGIN = "tournaments.pytest_plugin"
RUST = Path.home() / ".cargo" / "bin"


@pytest.mark.parametrize("name", LANGUAGES)
def test_the_bots_of_a_template_are_built_and_win_in_their_own_tests(compiled: None, name: str, tmp_path: Path) -> None:
    language, folder = LANGUAGES[name], tmp_path / "mybot"
    path = os.pathsep.join([os.environ["PATH"], str(RUST)])
    lines = [*language.build, *([language.bot.removeprefix(PREFIX)] if language.bot.startswith(PREFIX) else [])]
    for command in (line.split()[0] for line in lines):
        if not command.startswith("./") and shutil.which(command, path=path) is None:
            pytest.skip(f"there is no {command} on this machine")
    write_bot(folder, name)

    environment = {**os.environ, "PATH": path, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    for command in language.build:
        subprocess.run(command, shell=True, cwd=folder, env=environment, check=True, timeout=300)
    tests = [sys.executable, "-m", "pytest", "-q", "-p", PLUGIN, "-p", "no:cacheprovider"]
    done = subprocess.run(tests, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False)

    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_template_has_a_league_that_can_be_read_and_a_short_readme_without_blanks(name: str, tmp_path: Path) -> None:
    names = write_bot(tmp_path / "mybot", name)

    assert {"README.md", "league.toml", "test_bot.py", LANGUAGES[name].source, LANGUAGES[name].source_with_memory} <= set(names)
    texts = {file.name: file.read_text() for file in (tmp_path / "mybot").iterdir()}
    assert sorted(texts) == names
    assert not any(
        word in text for text in texts.values() for word in ("@NAME@", "@BOT", "@SOURCE", "@MAPS", "@BUILD", "@COMMAND")
    )
    assert len(texts["README.md"].splitlines()) <= 24
    league = load_league(str(tmp_path / "mybot" / "league.toml"))
    assert (league.name, list(league.entries)) == ("mybot", ["mybot", "rush", "patrol", "random"])


def test_the_templates_in_python_are_as_clean_as_our_own_sources(tmp_path: Path) -> None:
    write_bot(tmp_path / "mybot", "python")

    ruff = [sys.executable, "-m", "ruff", "check", "--isolated", "--line-length=130", "--select=E,F,W,B", str(tmp_path)]
    done = subprocess.run(ruff, capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", ["my bot", "", ".", "a" * 65, "böt"])
def test_a_name_that_is_none_is_refused_and_nothing_is_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    with pytest.raises(InputError, match="is no name for a bot; it must be 1 to 64 letters, digits, - or _"):
        write_bot(Path(name), "python")

    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_there_is_left_as_it_is(here: Arena, tmp_path: Path) -> None:
    (tmp_path / "mybot").mkdir()
    (tmp_path / "mybot" / "bot.py").write_text("mine")
    (tmp_path / "file").touch()

    folder, file = here("new", tmp_path / "mybot"), here("new", tmp_path / "file")
    nowhere = here("new", tmp_path / "no" / "mybot")

    assert [done.returncode for done in (folder, file, nowhere)] == [2, 2, 2]
    assert folder.stderr == f"arena: {tmp_path / 'mybot'} is there already; nothing was written\n"
    assert "No such file or directory" in nowhere.stderr
    assert [path.name for path in (tmp_path / "mybot").iterdir()] == ["bot.py"]
    assert (tmp_path / "mybot" / "bot.py").read_text() == "mine"


def test_what_cannot_be_written_whole_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", fail)

    with pytest.raises(InputError, match="No space left on device; nothing is left of it"):
        write_bot(tmp_path / "mybot", "python")
    assert not (tmp_path / "mybot").exists()


def test_an_unknown_language_is_refused_before_anything_is_written(here: Arena, tmp_path: Path) -> None:
    done = here("new", tmp_path / "mybot", "--language", "javascript")

    assert (done.returncode, list(tmp_path.iterdir())) == (2, [])
    assert "unknown language 'javascript'" in done.stderr
