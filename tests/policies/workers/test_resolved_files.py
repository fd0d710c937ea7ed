"""The files that a fighter's name names, whatever its author wrote there."""

from pathlib import Path

import pytest

from policies.workers.files import resolve


def test_the_files_that_a_command_line_names_are_found_beside_words_that_are_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bot.js").touch()
    code = "1; " * 200  # longer than the name of a file can be

    assert resolve(f"exec:node -e '{code}' bot.js") == (f"exec:node -e '{code}' {tmp_path / 'bot.js'}", [tmp_path / "bot.js"])
    assert resolve("x" * 300 + ".py") == ("x" * 300 + ".py", [])
