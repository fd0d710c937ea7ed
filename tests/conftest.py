"""How large the tests are: ARENA_TEST_SIZE=small (default) or full, as `make test-full` sets it."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest
from hypothesis import HealthCheck, settings

from tournaments.cli import main

SIZES = {"small": 40, "full": 1_000}
SIZE = os.environ.get("ARENA_TEST_SIZE", "small")
if SIZE not in SIZES:
    raise pytest.UsageError(f"ARENA_TEST_SIZE is {SIZE!r}; it must be one of {', '.join(SIZES)}")

# No deadline: the first example of a kernel pays for its compilation.
for name, max_examples in SIZES.items():
    settings.register_profile(
        name, max_examples=max_examples, deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
    )
settings.load_profile(SIZE)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels once, before several workers and all their processes do so at the same time."""
    if getattr(session.config.option, "numprocesses", None) and not hasattr(session.config, "workerinput"):
        compile_kernels()


def compile_kernels() -> None:
    command = [sys.executable, "-c", "from clients.doctor import compile_all; compile_all()"]
    subprocess.run(command, check=True)


@pytest.fixture(scope="session")
def compiled(pytestconfig: pytest.Config) -> None:
    """Have all kernels in the cache, so that no command says that it compiles them."""
    if not hasattr(pytestconfig, "workerinput"):
        compile_kernels()


@pytest.fixture(scope="session")
def size() -> Callable[[int, int], int]:
    """Choose how many matches a test plays: `size(small, full)`."""
    return lambda small, full: full if SIZE == "full" else small


@pytest.fixture(scope="session")
def arena(compiled: None) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the command line as a user does: `arena("rules", "paper")`."""

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", "from tournaments.cli import main; main()", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)

    return run


@pytest.fixture(autouse=True)
def config_of_its_own(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep a test's keys, and the pits that it trusts, away from the user's and from other tests'."""
    monkeypatch.setenv("ARENA_CONFIG", str(tmp_path_factory.mktemp("config")))


@pytest.fixture
def here(
    compiled: None, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., subprocess.CompletedProcess[str]]]:
    """Run the command line as `arena` does, but in this process: nothing is started and imported anew for it."""
    handler = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(sys, "path", list(sys.path))  # a bot adds its folder

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = ["arena", *map(str, arguments)]
        monkeypatch.setattr(sys, "argv", command)
        capfd.readouterr()
        with pytest.raises(SystemExit) as left:
            main()
        said = capfd.readouterr()
        return subprocess.CompletedProcess(command, int(left.value.code or 0), said.out, said.err)

    yield run
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture
def one_core(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the local venue find one core, and so play in this process: where workers are not the point, they need not start."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
