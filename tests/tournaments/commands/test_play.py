"""`arena play`, as a user runs it."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from filecmp import cmpfiles
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., subprocess.CompletedProcess[str]]
ARENA = [sys.executable, "-c", "from tournaments.cli import main; main()"]
BOARD_IN_LETTERS = "F..u\nU...\n..A.\na..f\n"
BOARD_IN_NUMBERS = "6 0 1 4\n2 0 1 1\n0 0 3 1\n5 0 1 7\n"
EAST = "def act(observation):\n    return [2] * len(observation.units)\n"


@pytest.fixture
def bot(tmp_path: Path) -> Callable[..., Path]:
    """Write a bot file."""

    def write(code: str, name: str = "mybot.py") -> Path:
        path = tmp_path / name
        path.write_text(code)
        return path

    return write


def facts(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """Return what --json printed; nothing else may stand on stdout."""
    assert done.returncode == 0, done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    return document


def is_progress(line: str) -> bool:
    """Whether a line says how far a command has come, as one that takes long does."""
    return " against " in line and " matches, " in line


def is_one_sentence(done: subprocess.CompletedProcess[str], exit_code: int, says: str) -> bool:
    said = [line for line in done.stderr.splitlines() if not is_progress(line)]
    return (done.returncode, done.stdout, len(said)) == (exit_code, "", 1) and said[0].startswith("arena: ") and says in said[0]


def test_the_same_seed_gives_the_same_journals(arena: Run, here: Run, tmp_path: Path, size: Callable[[int, int], int]) -> None:
    n_pairs = size(10, 100)
    for run, folder, workers in ((arena, "one", ()), (here, "other", ("--workers", 1))):
        done = run("play", "rush", "patrol", "--pairs", n_pairs, "--seed", 1, *workers, "--journals", tmp_path / folder)
        assert done.returncode == 0, done.stderr

    names = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert len(names) == 2 * n_pairs
    assert cmpfiles(tmp_path / "one", tmp_path / "other", names, shallow=False) == (names, [], [])
    verified = here("replay", "verify", "--local", tmp_path / "one", tmp_path / "other")
    assert (verified.returncode, verified.stdout.splitlines()[-1]) == (0, f"{4 * n_pairs} of {4 * n_pairs} journals hold")


def test_another_seed_gives_other_journals(here: Run, tmp_path: Path) -> None:
    for seed in (1, 2):
        here("play", "rush", "patrol", "--pairs", 1, "--seed", seed, "--workers", 1, "--journals", tmp_path / str(seed))
    one, other = ([path.read_bytes() for path in sorted((tmp_path / str(seed)).iterdir())] for seed in (1, 2))

    assert len(one) == len(other) == 2
    assert not set(one) & set(other)


def test_json_says_everything_from_the_first_one_s_side(here: Run) -> None:
    found = facts(here("play", "rush", "patrol", "--pairs", 5, "--seed", 1, "--workers", 1, "--json"))

    assert (found["a"], found["b"], found["rules"], found["seed"], found["pairs"], found["journals"]) == (
        "rush",
        "patrol",
        "paper",
        1,
        5,
        None,
    )
    assert found["wins"] + found["draws"] + found["losses"] == sum(found["endings"].values()) == 10
    assert found["blue_wins"] + found["red_wins"] == found["wins"] + found["losses"]
    no_faults = {"raised": 0, "illegal": 0, "first_traceback": None, "reasons": [], "counted": {}}
    assert found["faults"] == {"rush": no_faults, "patrol": no_faults}
    assert len(found["rules_hash"]) == 64


def test_the_table_says_the_same(here: Run, tmp_path: Path) -> None:
    arguments = ("play", "rush", "patrol", "--pairs", 5, "--seed", 1, "--workers", 1)
    found, text = facts(here(*arguments, "--json")), here(*arguments, "--journals", tmp_path).stdout

    [row] = [line.split() for line in text.splitlines() if line.strip().startswith("rush")]
    assert row[1:4] == [str(found[key]) for key in ("wins", "draws", "losses")]
    assert "10 matches (" in text
    assert "rules paper, seed 1" in text
    assert f"blue won {found['blue_wins']}, red won {found['red_wins']}" in text
    assert f"journals: {tmp_path}" in text


def test_without_a_seed_a_fresh_one_is_drawn_and_said(here: Run) -> None:
    arguments = ("play", "random", "random", "--pairs", 1, "--workers", 1, "--json", "--set", "tick_limit=2")
    first, second = (facts(here(*arguments)) for _ in range(2))
    again = facts(here(*arguments, "--seed", first["seed"]))

    assert first["seed"] != second["seed"]
    assert again == first


def test_a_fighter_can_play_itself(here: Run) -> None:
    found = facts(here("play", "rush", "rush", "--pairs", 2, "--seed", 1, "--workers", 1, "--json"))

    assert (found["a"], found["b"], set(found["faults"])) == ("rush", "rush-2", {"rush", "rush-2"})


def test_bot_files_play_each_other(here: Run, bot: Callable[..., Path]) -> None:
    one = bot(EAST)
    other = bot("class Sitter:\n    def act(self, observation):\n        return [0] * len(observation.units)\n", "sitter.py")

    found = facts(here("play", one, other, "--pairs", 2, "--seed", 1, "--workers", 1, "--json"))

    assert (found["a"], found["b"]) == ("mybot", "sitter")
    assert all(faults["raised"] == faults["illegal"] == 0 for faults in found["faults"].values())


def test_a_bot_that_raises_is_counted_and_shown_once(here: Run, bot: Callable[..., Path], tmp_path: Path) -> None:
    path = bot("def act(observation):\n    return observation.flag\n")
    done = here("play", path, "patrol", "--pairs", 3, "--seed", 1, "--workers", 1, "--journals", tmp_path / "journals")

    [row] = [line.split() for line in done.stdout.splitlines() if line.strip().startswith("mybot ")]
    assert done.returncode == 0
    assert int(row[-1].replace(",", "")) > 50
    assert "mybot first failed like this:\nTraceback" in done.stderr
    assert "has no attribute 'flag'" in done.stderr
    assert (done.stderr.count("Traceback"), done.stderr.count('File "')) == (1, 1)
    assert here("replay", "verify", "--local", tmp_path / "journals").returncode == 0


@pytest.mark.parametrize("workers", [1, 2])
def test_what_bots_print_does_not_spoil_the_document(here: Run, bot: Callable[..., Path], workers: int) -> None:
    path = bot(
        "import os\nprint('imported')\n\n"
        "def act(observation):\n    os.write(1, b'raw\\n')\n    print('acts')\n    return [0] * len(observation.units)\n"
    )

    done = here("play", path, "random", "--pairs", 1, "--seed", 1, "--json", "--workers", workers, "--set", "tick_limit=3")

    assert facts(done)["pairs"] == 1
    assert {"imported", "acts", "raw"} <= set(done.stderr.split())


def test_a_bot_that_kills_its_process_is_one_sentence(here: Run, bot: Callable[..., Path]) -> None:
    path = bot("import os\n\ndef act(observation):\n    os._exit(3)\n")

    assert is_one_sentence(here("play", path, "random", "--workers", 2), 1, "a worker died: a fighter ended its process")


def test_an_exit_of_a_bot_ends_nothing(here: Run, bot: Callable[..., Path]) -> None:
    path = bot("import sys\n\ndef act(observation):\n    sys.exit('enough')\n")

    found = facts(here("play", path, "patrol", "--pairs", 1, "--seed", 1, "--workers", 1, "--json"))

    assert found["faults"]["mybot"]["raised"] == found["ticks"]
    assert "SystemExit: enough" in found["faults"]["mybot"]["first_traceback"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["rsh", "patrol"], "unknown policy 'rsh'; did you mean 'rush'?"),
        (["rush", "absent.py"], "cannot read the bot file absent.py: No such file or directory"),
        (["rush", "patrol", "--rules", "papr"], "unknown ruleset 'papr'; did you mean 'paper'?"),
        (["rush", "patrol", "--set", "sidee=4"], "did you mean 'side'?"),
        (["rush", "patrol", "--board", "absent.txt"], "cannot read the board absent.txt: No such file or directory"),
        (["rush", "patrol", "--board", "/"], "cannot read the board /: Is a directory"),
        (["rush", "patrol", "--journals", "/dev/null"], "cannot keep journals in /dev/null: it is no folder"),
        (["rush", "patrol", "--journals", "/dev/null/below"], "cannot keep journals in /dev/null/below: Not a directory"),
        (["rush", "patrol", "--set", "side=4", "--set", "units.ugv.blue=14"], "use a larger side, fewer units or no obstacles"),
    ],
)
def test_wrong_input_is_one_sentence(here: Run, arguments: list[str], says: str) -> None:
    assert is_one_sentence(here("play", *arguments), 2, says)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("F..u\nU...\n..A.\na...\n", "board: no red flag; each team needs one"),
        ("F.u\nU..\na.f\n", "3 x 3 cells; the side must be even"),
        ("F#.u\n#U..\n..A.\na..f\n", ""),
        ("F..u\nU...\n..##\na.#f\n", "has no way to the enemy flag"),
        ("F..u\nU..\n..A.\na..f\n", "board, row 2: 3 cells in a board of 4 rows; it must be square"),
        ("F..u\nU.?.\n..A.\na..f\n", "board, row 2, column 3: '?' is no cell"),
        ("6 0 1 4\n2 0 1 1\n0 0 9 1\n5 0 1 7\n", "board, row 3, column 3: '9' is no cell"),
        ("", "the side must be even"),
    ],
)
def test_a_board_that_cannot_be_played_is_one_sentence(here: Run, tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "board.txt").write_text(text)

    assert is_one_sentence(here("play", "rush", "patrol", "--board", tmp_path / "board.txt"), 2, says)


@pytest.mark.parametrize("text", [BOARD_IN_LETTERS, BOARD_IN_NUMBERS], ids=["letters", "numbers"])
def test_a_board_of_one_s_own_is_played_in_both_layouts(here: Run, tmp_path: Path, text: str) -> None:
    (tmp_path / "board.txt").write_text(text)

    done = here(
        "play", "random", "random", "--board", tmp_path / "board.txt", "--pairs", 1, "--workers", 1, "--journals", tmp_path / "j"
    )
    shown = here("replay", "show", next((tmp_path / "j").iterdir()), "--tick", 0).stdout

    assert done.returncode == 0, done.stderr
    assert [line.split()[-4:] for line in shown.splitlines()[2:]] == [list("F·:u"), list("U·::"), list("··A:"), list("a·:f")]


def test_a_board_that_is_not_text_is_one_sentence(here: Run, tmp_path: Path) -> None:
    (tmp_path / "board.txt").write_bytes(b"\xff\xfe\x00")

    assert is_one_sentence(here("play", "rush", "patrol", "--board", tmp_path / "board.txt"), 2, "it is not text")


def test_a_full_disk_is_one_sentence(here: Run, tmp_path: Path) -> None:
    code = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500)); from tournaments.cli import main; main()"
    command = ["play", "random", "random", "--pairs", "1", "--workers", "1"]
    assert here(*command).returncode == 0  # the kernels are cached now
    done = subprocess.run(
        [sys.executable, "-c", code, *command, "--journals", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},  # Python would cut that short as well, and not notice
    )

    assert is_one_sentence(done, 2, "cannot write the journal of play/random/random-2/0000/")


def begin_slow_matches(bot: Callable[..., Path], workers: int) -> subprocess.Popen[str]:
    """Start matches of a slow bot, in a session of their own, and return once a bot is thinking."""
    path = bot(
        "import sys, threading\n\ndef act(observation):\n"
        "    print('thinking', file=sys.stderr, flush=True)\n    threading.Event().wait(0.2)\n    return []\n"
    )
    return begin_matches(str(path), workers)


def begin_matches(spec: str, workers: int) -> subprocess.Popen[str]:
    """Start matches, in a session of their own, and return once a fighter says that it is thinking."""
    # A shell that runs these tests in the background has its children ignore interrupts.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from tournaments.cli import main; main()"
    command = [sys.executable, "-c", code, "play", spec, "random", "--pairs", "500", "--workers", str(workers)]
    playing = subprocess.Popen(command, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert playing.stderr is not None
    for line in playing.stderr:
        if line.endswith("] thinking\n"):
            break
    return playing


@pytest.mark.parametrize(  # where no worker is, both reach one process
    ("workers", "send"), [(1, os.killpg), (2, os.kill), (2, os.killpg)], ids=["one process", "to it alone", "as a terminal does"]
)
def test_an_interrupt_ends_it_and_says_where_each_bot_is(
    bot: Callable[..., Path], workers: int, send: Callable[[int, int], None]
) -> None:
    playing = begin_slow_matches(bot, workers)

    send(playing.pid, signal.SIGINT)
    out, err = playing.communicate(timeout=60)  # returns when no process holds the pipes: no worker is left

    assert (playing.returncode, out) == (130, "")
    # Two that say at once what they do may share a line, and leave an empty one.
    said = [line for line in err.splitlines() if line and not is_progress(line) and not line.endswith("] thinking")]
    stopped, *where = [line for line in said if not line.startswith("    ")]
    assert stopped == "stopped after 0 of 1,000 matches: mybot won 0, random won 0, 0 drawn"
    place = re.compile(
        r"mybot\.py is at tick \d+ of match play/mybot/random/\d{4}/(mybot|random)-blue/0 as (blue|red): line \d in act: .+"
    )
    assert len(where) >= 1
    assert all(map(place.fullmatch, where)), err


def test_a_bot_that_leaves_its_folder_and_its_streams_takes_nothing_with_it(bot: Callable[..., Path], tmp_path: Path) -> None:
    bot(f"import os, sys\nos.chdir('/')\nsys.stdout = sys.stderr = None\n{EAST}")
    command = ["play", "mybot.py", "random", "--pairs", "1", "--journals", "kept", "--transcripts", "seen"]

    done = subprocess.run([*ARENA, *command], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)

    assert (done.returncode, "2 matches" in done.stdout) == (0, True), done.stderr
    assert [len(list((tmp_path / folder).iterdir())) for folder in ("kept", "seen")] == [2, 4]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_programs_that_never_answer_end_with_it(bot: Callable[..., Path], number: int) -> None:
    code = "import sys, threading\ninput()\nprint('[1] thinking', file=sys.stderr, flush=True)\nthreading.Event().wait()\n"
    playing = begin_matches(f"exec:{sys.executable} {bot(code)}", workers=2)

    os.kill(playing.pid, number)
    playing.communicate(timeout=60)  # returns when no process holds the pipes: no program is left

    assert playing.returncode in (130, -number, 128 + number)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_their_parent(bot: Callable[..., Path], number: int) -> None:
    playing = begin_slow_matches(bot, workers=2)

    os.kill(playing.pid, number)
    playing.communicate(timeout=60)  # returns when no process holds the pipes: no worker is left

    assert playing.returncode == -number


def test_a_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -c 'from tournaments.cli import main; main()' play random random --pairs 1 --workers 1 | true"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=300, check=False)

    assert all(map(is_progress, done.stderr.splitlines())), done.stderr
