"""What an entry tells a ladder of its code."""

from pathlib import Path

import pytest

from arena.errors import InputError
from arena.protocol.topics import is_chunk
from clients.versions import find_version

ANN, BOB = bytes(32), bytes(range(32))


def test_a_version_changes_with_the_code_and_with_nothing_else(tmp_path: Path) -> None:
    bot = tmp_path / "bot.py"
    bot.write_text("one")
    first, again = find_version(str(bot), ANN), find_version(str(bot), ANN)
    bot.write_text("two")
    then = find_version(str(bot), ANN)

    assert is_chunk(first)
    assert first == again != then
    assert find_version(str(bot.rename(tmp_path / "moved.py")), ANN) == then


def test_a_program_is_the_files_that_its_command_line_names(tmp_path: Path) -> None:
    bot, interpreter = tmp_path / "bot.js", tmp_path / "node"
    bot.write_text("one")
    interpreter.write_text("18")
    command = f"exec:{interpreter} --fast {bot}"
    first = find_version(command, ANN)

    interpreter.write_text("19")
    assert find_version(command, ANN) == first
    bot.write_text("two")
    assert find_version(command, ANN) != first
    assert find_version(command.replace("--fast", "--slow"), ANN) != find_version(command, ANN)


def test_a_checkpoint_s_settings_are_a_part_of_its_version_as_its_file_is(tmp_path: Path) -> None:
    file = tmp_path / "best.safetensors"
    found = set()
    for content in ("one", "two"):
        file.write_text(content)
        found |= {find_version(f"{file}{settings}", ANN) for settings in ("", ":mirror=true", ":temperature=0")}

    assert len(found) == 6


def test_nobody_can_tell_that_two_entries_play_the_same() -> None:
    assert find_version("rush", ANN) != find_version("rush", BOB)


def test_a_command_line_that_cannot_be_read_has_a_version_all_the_same() -> None:
    assert is_chunk(find_version("exec:node 'bot.js", ANN))
    assert is_chunk(find_version(f"exec:node -e '{'1; ' * 200}'", ANN))
    assert is_chunk(find_version("exec:", ANN))


def test_a_file_that_cannot_be_read_is_one_input_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bot = tmp_path / "bot.py"
    bot.write_text("one")

    def fail(*_: object) -> object:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", fail)
    with pytest.raises(InputError, match=r"cannot read .*bot\.py: Permission denied"):
        find_version(str(bot), ANN)
