"""Fighters in processes of their own: what they answer, what becomes of their processes, and that nobody waits for them."""

import io
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from arena.annotations import read_annotations
from arena.errors import InputError, PolicyError
from arena.game.engine import BatchedGame
from arena.game.keys import MatchKeys
from arena.game.ruleset import load
from arena.game.types import Team, Termination
from arena.policy import MatchResult, Thinking
from arena.sandbox import bubblewrap
from arena.sandbox.control_group import ControlGroup
from arena.sandbox.limits import BEHIND_A_WALL
from arena.submission import read_source
from policies.registry import load as load_policy
from policies.workers.files import fighter_in
from policies.workers.policy import LOAD_S, WorkerFactory, WorkerPolicy

PAPER = load("paper")
WAIT_S = 60.0
OVER = MatchResult(ending=Termination.CAPTURE, winner=Team.BLUE, score=100, ticks=1)
UNREADABLE = [-1] * 6
Start = Callable[..., WorkerPolicy]


@pytest.fixture
def board() -> BatchedGame:
    games = BatchedGame(PAPER, 1)
    games.start([0], [MatchKeys(map_key=bytes(32), match_key=bytes(32))])
    return games


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Start a bot of some code, for a match of one seat."""
    factories = []

    def make(
        source: str,
        *,
        keeps_annotations: bool = False,
        turn_time_s: float | None = None,
        load_s: float = LOAD_S,
        **settings: object,
    ) -> WorkerPolicy:
        if "\n" in source:
            (tmp_path / "bot.py").write_text(source)
            source = str(tmp_path / "bot.py")
        factory = WorkerFactory(source, **settings)  # type: ignore[arg-type]
        factories.append(factory)
        factory.prepare(load_s)
        policy = factory(PAPER, Team.BLUE, 1)
        policy.keeps_annotations = keeps_annotations
        if turn_time_s is not None:
            policy.set_turn_time(turn_time_s)
        policy.start(np.arange(1))
        return policy

    yield make
    for factory in factories:
        factory.close()


def act(policy: WorkerPolicy, board: BatchedGame) -> list[int]:
    orders = np.zeros((1, 6), np.int8)
    policy.act(board.observe()[Team.BLUE], orders)
    return orders[0].tolist()


def walls() -> dict[str, object]:
    why = bubblewrap.why_no_wall()
    if why is not None and not os.environ.get("ARENA_REQUIRE_ALL"):
        pytest.skip(why)
    return {"has_wall": True, "limits": BEHIND_A_WALL}


WRITES_JUNK = """
import os
def act(seen):
    for descriptor in range(3, 20):
        try:
            os.write(descriptor, b"\\xff" * 64)
        except OSError:
            continue
"""
ANSWERS_WITHOUT_END = """
import os
from policies.workers.frames import pack
def act(seen):
    for descriptor in range(3, 20):
        try:
            while True:
                os.write(descriptor, b"".join(pack([seat, bytes(6), [0, 0, None, {}], b""]) for seat in range(100)))
        except OSError:
            continue
"""
ANSWERS_FOR_NO_SEAT = ANSWERS_WITHOUT_END.replace("range(100)", "range(10**6, 10**6 + 100)")
FILLS_ITS_OWN_PIPE = """
import fcntl, os, time
from policies.workers.frames import pack
class Bot:
    def start(self, info):
        for number in map(int, os.listdir("/proc/self/fd")):
            try:
                is_pipe = os.readlink(f"/proc/self/fd/{number}").startswith("pipe:")
                is_read = is_pipe and fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY
                pipe = os.open(f"/proc/self/fd/{number}", os.O_WRONLY | os.O_NONBLOCK) if is_read else -1
                while os.write(pipe, bytes(1)):
                    continue
            except OSError:
                continue
        for number in range(3, 20):
            try:
                os.write(number, pack([1, b"", [0, 0, None, {}], b""]))
            except OSError:
                continue
        time.sleep(1000)
    def act(self, seen):
        return [0] * 6
"""
SAYS_WHAT_IT_SEES = "def act(seen):\n    return [len(seen.units) == 6, seen.tick == 0, seen.team == 0, 3, 4, 0]\n"


def test_a_bot_behind_a_wall_is_shown_what_its_team_sees_and_its_orders_are_taken(start: Start, board: BatchedGame) -> None:
    assert act(start(SAYS_WHAT_IT_SEES, **walls()), board) == [1, 1, 1, 3, 4, 0]


def test_so_is_a_program(start: Start, board: BatchedGame, tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text("while True:\n    if 'observation' in input():\n        print([1, 1, 1, 3, 4, 0], flush=True)\n")

    assert act(start(f"exec:python3 {program}", **walls()), board) == [1, 1, 1, 3, 4, 0]


def test_a_network_plays_the_same_in_a_process_behind_a_wall(start: Start, board: BatchedGame) -> None:
    path = Path(load_policy.__code__.co_filename).parent / "weights" / "champion.safetensors"
    ours = load_policy(str(path))(PAPER, Team.BLUE, 1)
    ours.start(np.arange(1))
    expected = np.zeros((1, 6), np.int8)
    ours.act(board.observe()[Team.BLUE], expected)

    assert act(start(str(path), **walls()), board) == expected[0].tolist()


def test_nobody_waits_for_a_bot_that_thinks(start: Start, board: BatchedGame, tmp_path: Path) -> None:
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    woken = Event()
    policy = start(f"def act(seen):\n    open({str(gate)!r}).read()\n    return [2] * 6\n")
    policy._factory.wake = woken.set

    with pytest.raises(Thinking):
        act(policy, board)
    with pytest.raises(Thinking):
        act(policy, board)
    gate.write_text("go")

    end_s = time.monotonic() + WAIT_S
    while time.monotonic() < end_s:
        assert woken.wait(WAIT_S)
        woken.clear()
        try:
            assert act(policy, board) == [2] * 6
            return
        except Thinking:
            continue
    raise AssertionError("it never answered")


def test_each_match_has_a_process_that_knows_nothing_of_the_one_before(start: Start, board: BatchedGame) -> None:
    source = "n = 0\ndef act(seen):\n    global n\n    n += 1\n    return [n] * 6\n"
    policy = start(source)

    first = [act(policy, board), act(policy, board)]
    policy.end(0, OVER)
    policy.start(np.arange(1))

    assert first == [[1] * 6, [2] * 6]
    assert act(policy, board) == [1] * 6


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("import os\ndef act(seen):\n    os._exit(3)\n", "its process ended with exit code 3"),
        ("def act(seen):\n    bytearray(5 << 30)\n", "its process met its limit of memory (memory_mb = 2000)"),
        (WRITES_JUNK, "its process wrote what is no answer"),
    ],
    ids=["exits", "takes memory", "writes junk"],
)
def test_what_becomes_of_its_process_costs_the_seat_its_orders_and_is_told(
    source: str, says: str, start: Start, board: BatchedGame
) -> None:
    policy = start(source, **walls())

    assert [act(policy, board), act(policy, board)] == [UNREADABLE] * 2
    faults = policy.take_faults(0)
    assert faults.raised == 2
    assert says in (faults.first_traceback or "") or "MemoryError" in (faults.first_traceback or "")


def test_a_process_has_ended_though_one_that_it_started_holds_its_pipes(start: Start, board: BatchedGame) -> None:
    policy = start(
        "import os, time\ndef act(seen):\n    if os.fork():\n        os._exit(3)\n    time.sleep(1000)\n", patience_s=20.0
    )

    assert act(policy, board) == UNREADABLE
    assert policy.take_faults(0).first_traceback == "its process ended with exit code 3"


def test_a_shared_process_that_has_ended_is_forgotten_with_the_memory_that_it_held(start: Start, board: BatchedGame) -> None:
    policy = start("import os\ndef act(seen):\n    os._exit(3)\n", is_shared=True)
    assert act(policy, board) == UNREADABLE

    policy.start(np.arange(1))

    assert len(policy._factory._workers) == 1
    assert policy._factory.memory_bytes()


def test_who_answers_without_being_asked_is_ended_before_its_answers_fill_the_memory(start: Start, board: BatchedGame) -> None:
    policy = start(ANSWERS_WITHOUT_END, **walls())

    answers = [act(policy, board) for _ in range(4)]

    assert answers[-1] == UNREADABLE
    assert "more answers than questions" in (policy.take_faults(0).first_traceback or "")


def test_neither_does_who_answers_for_seats_that_are_not_its_own_keep_anybody_busy(start: Start, board: BatchedGame) -> None:
    policy = start(ANSWERS_FOR_NO_SEAT, **walls())
    policy._factory._patience_s = 20.0

    assert act(policy, board) == UNREADABLE
    assert "more answers than questions" in (policy.take_faults(0).first_traceback or "")


def test_nobody_waits_for_a_bot_that_does_not_read_what_it_is_told(start: Start, board: BatchedGame) -> None:
    policy = start(FILLS_ITS_OWN_PIPE, **walls())
    policy._factory.wake = lambda: None

    with pytest.raises(Thinking):
        act(policy, board)


def test_a_process_that_has_ended_is_told_nothing_through_another_file(start: Start, board: BatchedGame, tmp_path: Path) -> None:
    policy = start("import os\ndef act(seen):\n    os._exit(3)\n")
    row = policy._rows[0]
    assert row is not None
    act(policy, board)
    row.worker._listener.join(WAIT_S)
    files = [(tmp_path / str(number)).open("wb") for number in range(20)]  # they take the numbers of its pipes

    policy.end(0, OVER)
    row.worker.kill()

    for file in files:
        file.close()
    assert [(tmp_path / str(number)).read_bytes() for number in range(20)] == [b""] * 20


def test_a_bot_that_prints_where_nothing_can_be_written_plays_on(
    start: Start, board: BatchedGame, monkeypatch: pytest.MonkeyPatch
) -> None:
    policy = start("def act(seen):\n    print('x')\n    return [2] * 6\n")
    policy._factory._patience_s = 20.0
    full = os.fdopen(os.open("/dev/full", os.O_WRONLY), "wb", buffering=0)
    with io.TextIOWrapper(full, write_through=True) as stderr:
        monkeypatch.setattr("sys.stderr", stderr)
        answers = [act(policy, board) for _ in range(2)]
        policy._factory.close()
        monkeypatch.undo()

    assert answers == [[2] * 6] * 2


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        ("[0] * 5", "5 orders for 6 units"),
        ("[0, 9] * 3", "unit 1 is ordered 9, and an order is a number from 0 to 4"),
        ("'north'", "'north' is no list of orders"),
        ("None", "None is no list of orders"),
    ],
)
def test_what_is_no_order_is_unreadable_and_is_told_why(answer: str, why: str, start: Start, board: BatchedGame) -> None:
    policy = start(f"def act(seen):\n    return {answer}\n")

    assert act(policy, board) == UNREADABLE
    faults = policy.take_faults(0)
    assert faults.illegal == 1
    assert [sentence for sentence, _ in faults.reasons.values()] == [f"tick 0: {why}; all its units stay"]


NOTES = """
def act(seen):
    seen.log("tick", seen.tick)
    seen.draw.cell(3, 4, "red", "A")
    return [0] * 6
"""


@pytest.mark.parametrize("is_kept", [True, False])
def test_what_a_bot_notes_comes_back_where_it_is_asked_for(is_kept: bool, start: Start, board: BatchedGame) -> None:
    policy = start(NOTES, keeps_annotations=is_kept)

    assert act(policy, board) == [0] * 6
    noted = read_annotations(policy.take_annotations(0), PAPER.side)
    drawn = [{"cell": [3, 4], "colour": "red", "text": "A"}]
    assert noted == {"log": ["tick 0"] * is_kept, "draw": drawn * is_kept}
    assert policy.take_annotations(0) == b""


SAYS_WHAT_IS_WANTED = """
from arena.annotations import Annotations
from arena.policy import BatchPolicy
class Wanted(BatchPolicy):
    def act(self, seen, orders):
        pass
    def take_annotations(self, seat):
        notes = Annotations(self.ruleset.side)
        notes.log(self.keeps_annotations, self.explains)
        return notes.pack()
"""


@pytest.mark.parametrize("explains", [False, True])
def test_a_fighter_in_a_process_hears_whether_it_is_to_explain_itself(
    explains: bool, board: BatchedGame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "wanted.py").write_text(SAYS_WHAT_IS_WANTED)
    (tmp_path / "wanted-1.dist-info").mkdir()
    (tmp_path / "wanted-1.dist-info" / "METADATA").write_text("Name: wanted\nVersion: 1\n")
    (tmp_path / "wanted-1.dist-info" / "entry_points.txt").write_text("[arena.policies]\nwanted = wanted:Wanted\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    factory = WorkerFactory("wanted")
    try:
        policy = factory(PAPER, Team.BLUE, 1)
        policy.keeps_annotations, policy.explains = True, explains
        policy.start(np.arange(1))
        act(policy, board)

        assert read_annotations(policy.take_annotations(0), PAPER.side)["log"] == [f"True {explains}"]
    finally:
        factory.close()


HEARS_TURN_TIMES = """
from arena.policy import BatchPolicy

class Hearing(BatchPolicy):
    heard = 0

    def set_turn_time(self, seconds):
        self.heard = 10 * self.heard + seconds

    def start(self, seats):
        self.heard_at_start = self.heard

    def act(self, observations, orders):
        orders[:] = [self.heard_at_start] * 6
"""


def test_a_fighter_of_a_package_hears_in_its_process_how_long_a_turn_may_take(
    start: Start, board: BatchedGame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "hearing.py").write_text(HEARS_TURN_TIMES)
    package = tmp_path / "hearing-1.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: hearing\nVersion: 1\n")
    (package / "entry_points.txt").write_text("[arena.policies]\nhearing = hearing:Hearing\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    assert act(start("hearing"), board) == [0] * 6, "where no clock runs"
    assert act(start("hearing", turn_time_s=3.0), board) == [3] * 6


FORGES_ITS_NOTES = """
import os
from policies.workers.frames import pack
def act(seen):
    for number in range(3, 10):
        try:
            os.write(number, pack([1, bytes(6), [0, 0, None, {}], JUNK]))
        except OSError:
            pass
    return [0] * 6
"""


@pytest.mark.parametrize("junk", [b"\x81\xa3log\x01", b"junk", bytes(100_000)], ids=["other", "junk", "long"])
def test_annotations_that_a_process_made_up_are_dropped_and_its_orders_count(
    junk: bytes, start: Start, board: BatchedGame
) -> None:
    policy = start(FORGES_ITS_NOTES.replace("JUNK", repr(junk)), keeps_annotations=True)

    assert act(policy, board) == [0] * 6
    assert policy.take_annotations(0) == b""
    (sentence, count), *_ = policy.take_faults(0).reasons.values()
    assert "annotations" in sentence
    assert count == 1


def test_what_a_bot_raises_is_told_with_its_line(start: Start, board: BatchedGame) -> None:
    policy = start("def act(seen):\n    return 1 / 0\n")

    assert act(policy, board) == UNREADABLE
    assert 'bot.py", line 2, in act' in (policy.take_faults(0).first_traceback or "")


def test_half_a_letter_in_what_a_bot_raises_does_not_end_its_process(start: Start, board: BatchedGame) -> None:
    raises = "class Bot:\n    def start(self, info):\n        raise ValueError('\\udcff')\n"
    policy = start(raises + "    def act(self, seen):\n        return [2] * 6\n")

    assert act(policy, board) == [2] * 6
    assert "ValueError: \\udcff" in (policy.take_faults(0).first_traceback or "")


def test_it_is_known_how_many_matches_can_begin_without_waiting_for_a_process(start: Start) -> None:
    policy = start(NOTES, n_spare=2)
    factory = policy._factory
    ready = [factory.count_ready()]  # one plays

    policy.end(0, OVER)
    ready.append(factory.count_ready())  # the next has hardly begun to load
    factory.wait([], lambda: factory.count_ready() == 2)
    factory._spare[0].kill()
    ready.append(factory.count_ready())  # of one that cannot, it is told in the match
    policy.start(np.arange(1))

    assert ready == [1, 1, 2]
    assert [worker.failure for worker in factory._spare] == [None]


def test_faults_can_be_asked_for_after_the_match(start: Start, board: BatchedGame) -> None:
    policy = start("def act(seen):\n    return 1 / 0\n")
    act(policy, board)

    policy.end(0, OVER)

    assert policy.take_faults(0).raised == 1


def test_what_it_prints_is_passed_on_up_to_its_limit_and_then_it_waits(
    start: Start, board: BatchedGame, capfd: pytest.CaptureFixture[str]
) -> None:
    met: list[str] = []
    limits = BEHIND_A_WALL.with_(["output_kb=10"])
    policy = start(
        "def act(seen):\n    for _ in range(10000): print('x' * 1000)\n    return [0] * 6\n",
        **{**walls(), "limits": limits, "on_limit": met.append},
    )

    policy._factory.wake = lambda: None
    with pytest.raises(Thinking):
        act(policy, board)
    while not met:
        os.sched_yield()

    assert 9_000 < len(capfd.readouterr().err) <= 10 << 10
    assert met == ["output"]


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("import no_such_module\n", "bot.py, line 1: the bot cannot be imported: ModuleNotFoundError"),
        ("import os\nos._exit(0)\n", "cannot start: its process ended with exit code 0"),
        ("x = bytearray(5 << 30)\n", "cannot start: "),
        ("import time\ntime.sleep(1000)\n", "cannot start: it was not ready after 2 s"),
    ],
)
def test_a_bot_that_cannot_start_is_told_of_in_a_sentence(source: str, says: str, start: Start) -> None:
    load_s = 2.0 if "sleep" in source else LOAD_S
    with pytest.raises(PolicyError) as refused:
        start(source, **walls(), load_s=load_s)

    assert says in str(refused.value)


@pytest.mark.parametrize("folder", ["/", "/../", str(Path.home()), "/proc", str(Path.home().parent)])
def test_no_command_line_opens_the_wall_by_naming_a_folder(folder: str, start: Start) -> None:
    with pytest.raises(InputError, match="behind its wall it would see all that is in there"):
        start(f"exec:/bin/sh -c true {folder}", **walls())


def submit(folder: Path, **files: str) -> str:
    """Return the fighter of a submission that was written to a folder."""
    (folder / "from").mkdir()
    (folder / "there").mkdir()
    for name, text in files.items():
        (folder / "from" / name.replace("_py", ".py")).write_text(text)
    read_source(folder / "from", 1 << 20).write(folder / "there")
    return fighter_in(folder / "there")


def test_a_submitted_bot_finds_the_files_beside_it_behind_its_wall(start: Start, board: BatchedGame, tmp_path: Path) -> None:
    bot = submit(tmp_path, bot_py="from plan import act\n", plan_py="def act(seen):\n    return [3] * len(seen.units)\n")

    policy = start(bot, **walls())

    assert act(policy, board) == [3] * 6


PROGRAM = """
import json, os, sys
sees = any(os.path.exists(path) for path in sys.argv[1:])
for line in sys.stdin:
    if json.loads(line)["type"] == "observation":
        print([4 if sees else 2] * 6, flush=True)
"""


def test_a_submitted_program_runs_in_its_folder_and_is_shown_nothing_that_its_command_line_names(
    start: Start, board: BatchedGame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "secret.key").write_text("secret")
    monkeypatch.chdir(tmp_path)
    program = submit(tmp_path, program=f"python3 main.py {tmp_path}/secret.key secret.key ../secret.key", main_py=PROGRAM)

    policy = start(program, **walls())

    assert act(policy, board) == [2] * 6


def test_a_bot_that_never_answers_is_ended_where_it_is_waited_for(start: Start, board: BatchedGame) -> None:
    policy = start("def act(seen):\n    while True: pass\n", patience_s=2.0)

    assert act(policy, board) == UNREADABLE
    assert "did not answer within 2 s" in (policy.take_faults(0).first_traceback or "")


def test_a_spare_process_that_has_ended_plays_no_match(tmp_path: Path, board: BatchedGame) -> None:
    bot = tmp_path / "bot.py"
    bot.write_text("def act(seen):\n    return [1 for _ in seen.units]\n")
    factory = WorkerFactory(str(bot), n_spare=1)
    try:
        factory.prepare()
        spare = factory.acquire()
        factory.release(spare)  # another starts for the match to come
        (spare,) = factory._spare
        spare.kill("the machine was short of memory")

        policy = factory(PAPER, Team.BLUE, 1)
        policy.start(np.arange(1))

        assert act(policy, board) == [1] * 6
    finally:
        factory.close()


FORKS = """
import os, time
def act(seen):
    while True:
        try:
            if os.fork() == 0:
                time.sleep(1000)
        except OSError:
            time.sleep(0.01)
"""


def test_a_limit_is_told_of_while_the_process_goes_on(start: Start, board: BatchedGame) -> None:
    group = ControlGroup.make(BEHIND_A_WALL)
    if group is None:
        pytest.skip("this user can make no control group here")
    group.remove()
    told = Event()
    policy = start(FORKS, **walls(), on_limit=lambda limit: told.set() if limit == "processes" else None)
    policy._factory.wake = lambda: None

    with pytest.raises(Thinking):
        act(policy, board)

    assert told.wait(WAIT_S)
