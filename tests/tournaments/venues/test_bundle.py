"""Fighters on their way to another machine: their files and folders come along, and are found there."""

import resource
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import tournaments.venues.bundle as bundles
from arena.errors import InputError
from arena.submission import MARK
from policies.registry import split_settings
from tournaments.venues.bundle import pack


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


def sent(spec: str) -> str:
    return pack({"one": spec}).unpack()["one"]


def test_a_file_is_found_under_its_own_name_and_a_fighter_of_ours_stays_a_name(tmp_path: Path) -> None:
    (tmp_path / "bot.py").write_text("now")

    place = sent(str(tmp_path / "bot.py"))
    (tmp_path / "bot.py").write_text("later")

    assert Path(place).name == "bot.py"
    assert Path(place).read_text() == "now"
    assert sent("rush") == "rush"


def test_the_settings_behind_a_checkpoint_s_name_come_along(tmp_path: Path) -> None:
    (tmp_path / "best.safetensors").write_text("weights")

    file, settings = split_settings(sent(f"{tmp_path / 'best.safetensors'}:temperature=0"))

    assert settings == ":temperature=0"
    assert Path(file).read_text() == "weights"
    assert Path(file).parent != tmp_path


def test_a_submission_comes_as_its_whole_folder(tmp_path: Path) -> None:
    folder = tmp_path / "submitted"
    (folder / "lib").mkdir(parents=True)
    for name, text in ((MARK, "bot\nbot.py\n"), ("bot.py", "bot"), ("lib/maps.py", "maps")):
        (folder / name).write_text(text)

    place = Path(sent(str(folder / "bot.py")))

    assert place.read_text() == "bot"
    assert (place.parent / MARK).is_file()
    assert (place.parent / "lib" / "maps.py").read_text() == "maps"


def test_a_program_finds_what_it_names_beside_itself_and_runs_there(tmp_path: Path) -> None:
    code, weights = tmp_path / "code", tmp_path / "weights"
    code.mkdir()
    weights.mkdir()
    (code / "run.sh").write_text('#!/bin/sh\ncat "$(dirname $0)/../weights/deep" "$1"/deep\n')
    (code / "run.sh").chmod(0o755)
    (weights / "deep").write_text("42 ")
    (weights / "away").symlink_to("/etc/hostname")

    words = shlex.split(sent(f"exec:{code / 'run.sh'} {weights} --fast").removeprefix("exec:"))

    assert words[2:] == ["--fast"]
    assert str(tmp_path / "cache") in words[0]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout == "42 42 "
    assert [path.name for path in Path(words[1]).iterdir()] == ["deep"], "a link would show what is behind it"


def test_what_is_installed_on_every_machine_does_not_travel(tmp_path: Path) -> None:
    assert sent(f"exec:{sys.executable} -c pass") == f"exec:{sys.executable} -c pass"
    assert sent("exec:cat") == "exec:cat"


@pytest.mark.parametrize(("bound", "value"), [("MOST_FILES", 2), ("MOST_BYTES", 5)])
def test_a_folder_that_is_too_large_to_be_sent_is_refused_in_a_sentence(
    bound: str, value: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    for number in range(3):
        (folder / str(number)).write_text("ab")
    monkeypatch.setattr(bundles, bound, value)

    with pytest.raises(InputError, match=r"^exec:sh .* names .*folder, and what it names is sent to other machines: at most "):
        pack({"one": f"exec:sh {folder}"})


def test_a_file_that_is_not_there_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^cannot read the bot file .*bot\.py: No such file or directory$"):
        pack({"one": str(tmp_path / "bot.py")})


def test_a_disk_that_is_full_is_one_sentence_and_keeps_no_part_of_a_file(tmp_path: Path, cache: Path) -> None:
    (tmp_path / "bot.py").write_text(100 * "# a long bot\n")
    packed = pack({"one": str(tmp_path / "bot.py")})

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.raises(InputError, match=r"cannot unpack bot\.py into"):
            packed.unpack()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)

    assert not [path for path in cache.rglob("*") if path.is_file()]
