from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from arena.errors import PolicyError
from policies.bot_file import load_bot


@pytest.fixture(autouse=True)
def own_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bot files lengthen the path; give it back as it was."""
    import sys

    monkeypatch.setattr(sys, "path", list(sys.path))


def write(folder: Path, text: str, name: str = "mybot.py") -> str:
    (folder / name).write_text(dedent(text))
    return str(folder / name)


@pytest.mark.parametrize(
    "text",
    [
        "def act(observation): return [3]",
        "class Policy:\n    def act(self, observation): return [3]\nclass Other:\n    def act(self, observation): return [0]",
        "class Bot:\n    def act(self, observation): return [3]",
        "class Whatever:\n    def act(self, observation): return [3]\nclass Map: pass",
        "from dataclasses import dataclass\n@dataclass\nclass A:\n  x: int = 3\n  def act(self, observation): return [self.x]",
        "from json import JSONDecoder\nact = lambda observation: [3]",
    ],
)
def test_a_function_or_a_class_is_a_bot(tmp_path: Path, text: str) -> None:
    assert load_bot(write(tmp_path, text))().act(None) == [3]


def test_a_class_is_made_anew_and_a_function_shared(tmp_path: Path) -> None:
    of_class = load_bot(write(tmp_path, "class Bot:\n    def act(self, observation): return []", "a.py"))
    of_function = load_bot(write(tmp_path, "def act(observation): return []", "b.py"))

    assert of_class() is not of_class()
    assert of_function() is of_function()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has no bot; write a function act"),
        ("act = 5", "has no bot"),
        ("from arena.policy import BatchPolicy", "has no bot"),
        ("class A:\n    def act(self, o): ...\nclass B:\n    def act(self, o): ...", "has several bots, A and B"),
        ("x = 1\ndef act(observation) return []", "mybot.py, line 2: this is not Python"),
        ("x = 1" + " + 1" * 100_000, "mybot.py cannot be compiled: an expression in it is too long"),
        ("x = " + "-" * 200_000 + "1", "mybot.py cannot be compiled: an expression in it is too long"),
        ("import no_such_thing", "mybot.py, line 1: the bot cannot be imported: ModuleNotFoundError: No module named"),
        ("\n\nvalue = 1 / 0", "mybot.py, line 3: the bot cannot be imported: ZeroDivisionError: division by zero"),
        ("import sys\nsys.exit(3)", "mybot.py, line 2: the bot cannot be imported: SystemExit: 3"),
        ("def f(): raise ValueError('a\\nb')\nf()", "mybot.py, line 1: the bot cannot be imported: ValueError: a b"),
    ],
)
def test_a_file_without_a_bot_is_refused_in_a_sentence(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(PolicyError) as refusal:
        load_bot(write(tmp_path, text))

    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_missing_file_a_folder_and_bytes_are_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "bytes.py").write_bytes(b"\x00\xff\xfe")
    with pytest.raises(PolicyError, match=r"cannot read the bot file .*nothing\.py: No such file"):
        load_bot(str(tmp_path / "nothing.py"))
    with pytest.raises(PolicyError, match="Is a directory"):
        load_bot(str(tmp_path / "folder.py"))
    with pytest.raises(PolicyError, match="not Python"):
        load_bot(str(tmp_path / "bytes.py"))


def test_a_bot_imports_its_neighbours_and_replaces_no_module(tmp_path: Path) -> None:
    write(tmp_path, "answer = [4]", "a_neighbour_of_the_bot.py")
    write(tmp_path, "raise RuntimeError('the bot folder came first')", "numpy.py")

    bot = load_bot(
        write(tmp_path, "import numpy\nfrom a_neighbour_of_the_bot import answer\ndef act(observation): return answer")
    )

    assert bot().act(None) == [4]
    assert np.__name__ == "numpy"


def test_two_bots_of_one_file_name_are_two(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    one = load_bot(write(tmp_path / "one", "class Bot:\n    def act(self, observation): return [1]"))
    two = load_bot(write(tmp_path / "two", "class Bot:\n    def act(self, observation): return [2]"))

    assert (one().act(None), two().act(None)) == ([1], [2])
