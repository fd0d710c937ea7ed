"""What `pip install arena-pit` installs: small, without torch, and true to the lowest versions that it allows.

The package is built from its source archive and installed where every direct dependency has its lowest version. That needs the
package index; without it these tests are skipped, and fail where ARENA_REQUIRE_ALL=1 promises that nothing is skipped.
"""

import os
import subprocess
import sys
import tarfile
import tomllib
import venv
from collections.abc import Iterable
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PIP = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "--no-input", "--retries", "5"]
MOST_BYTES = 4_000_000
LEAGUE = 'ruleset = "paper"\npairs = 1\nvenue = "network"\nseed = 1\nentries = ["rush", "patrol"]\n'
pytestmark = pytest.mark.skipif(sys.version_info >= (3, 13), reason="the lowest numpy has no wheel for this Python")


def lowest(requirements: Iterable[str]) -> list[str]:
    """Pin each requirement that has a lower bound to it."""
    pins = []
    for wanted in map(Requirement, requirements):
        pins += [f"{wanted.name}=={bound.version}" for bound in wanted.specifier if bound.operator == ">="]
    return pins


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the source archive, and from what it holds the wheel; return the folder of both."""
    folder, backend = tmp_path_factory.mktemp("dist"), tmp_path_factory.mktemp("backend")
    needed = lowest(PYPROJECT["build-system"]["requires"])
    done = subprocess.run(
        [*PIP, "install", "--target", backend, *needed], capture_output=True, text=True, timeout=300, check=False
    )
    if done.returncode and os.environ.get("ARENA_REQUIRE_ALL") != "1":
        pytest.skip(f"the package index cannot be reached: {done.stderr.strip()[-200:]}")
    assert done.returncode == 0, done.stderr
    build = [sys.executable, "-m", "hatchling", "build", "-d", folder, "-t"]
    environment = os.environ | {"PYTHONPATH": str(backend)}
    subprocess.run([*build, "sdist"], cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, timeout=300, check=True)
    with tarfile.open(next(folder.glob("*.tar.gz"))) as archive:
        archive.extractall(folder, filter="data")
    (source,) = (path for path in folder.iterdir() if path.is_dir())
    subprocess.run([*build, "wheel"], cwd=source, env=environment, stdout=subprocess.DEVNULL, timeout=300, check=True)
    return folder


@pytest.fixture(scope="module")
def wheel(dist: Path) -> Path:
    return next(dist.glob("*.whl"))


class Installed:
    """A virtual environment that holds the wheel, and the lowest versions of what it needs."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        venv.create(folder / "venv", with_pip=False)
        self._bin, self._home = folder / "venv" / "bin", folder
        pins = folder / "lowest.txt"
        pins.write_text("\n".join(lowest(PYPROJECT["project"]["dependencies"])))
        install = [*PIP, "--python", self._bin / "python", "install", "--only-binary", ":all:", "--constraint", pins, wheel]
        subprocess.run(install, timeout=600, check=True)

    def packages(self) -> set[str]:
        """Return the names of what is installed."""
        return {path.name.partition("-")[0].lower().replace("_", "-") for path in self._home.rglob("*.dist-info")}

    def arena(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {
            "HOME": str(self._home),
            "ARENA_CONFIG": str(self._home),
            "NUMBA_CACHE_DIR": str(self._home / "kernels"),
            "NUMBA_OPT": "1",  # this test is about whether kernels compile, not how fast they are
            "NUMBA_LOOP_VECTORIZE": "0",
        }
        command = [self._bin / "arena", *map(str, arguments)]
        return subprocess.run(command, cwd=self._home, env=environment, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory, wheel: Path) -> Installed:
    return Installed(tmp_path_factory.mktemp("installed"), wheel)


def test_the_wheel_is_small_and_holds_our_packages_alone(wheel: Path) -> None:
    names = ZipFile(wheel).namelist()
    folders = {name.partition("/")[0] for name in names if ".dist-info/" not in name}

    assert wheel.stat().st_size < MOST_BYTES
    assert folders == {"arena", "clients", "policies", "tournaments"}
    assert [name for name in names if name.endswith(".safetensors")] == ["policies/weights/champion.safetensors"]


def test_it_pulls_no_part_that_is_optional(installed: Installed) -> None:
    extras = PYPROJECT["project"]["optional-dependencies"]
    optional = {Requirement(name).name for extra, names in extras.items() if extra not in ("all", "dev") for name in names}

    assert {"arena-pit", "numba"} <= installed.packages()
    assert not installed.packages() & (optional - {"arena-pit"})


def test_every_extra_but_those_of_developers_is_part_of_all() -> None:
    extras = PYPROJECT["project"]["optional-dependencies"]

    assert Requirement(*extras["all"]).extras == extras.keys() - {"all", "dev", "docs"}


def test_help_lists_the_commands(installed: Installed) -> None:
    done = installed.arena("--help")

    assert done.returncode == 0, done.stderr
    assert all(command in done.stdout for command in ("join", "play", "replay", "tournament"))


@pytest.mark.skipif(os.environ.get("ARENA_TEST_SIZE") != "full", reason="compiles the rules for a minute; make test-full")
def test_with_the_lowest_versions_a_league_is_played_over_the_network_and_reported(installed: Installed, tmp_path: Path) -> None:
    league = tmp_path / "lowest.toml"
    league.write_text(LEAGUE)

    done = installed.arena("tournament", "run", league, "--data", tmp_path)

    assert done.returncode == 0, done.stderr
    assert "2 matches" in done.stdout
    assert (tmp_path / "reports" / "lowest.html").is_file()
    verified = installed.arena("replay", "verify", "--local", tmp_path / "journals" / "lowest")
    assert verified.returncode == 0, verified.stdout + verified.stderr
    journal = next((tmp_path / "journals").rglob("*.journal"))
    drawn = installed.arena("replay", "export", journal, "--gif", "--out", tmp_path / "match.gif")
    assert drawn.returncode == 0, drawn.stderr


@pytest.mark.parametrize(
    ("arguments", "package", "extra"),
    [
        (("play", "champion", "rush"), "torch", "learned"),
        (("train",), "torch", "train"),
        (("web",), "uvicorn", "web"),
        (("serve", "--web", "8000"), "starlette", "web"),
        (("serve", "--metrics", "127.0.0.1:9100"), "prometheus_client", "web"),
        (("join", "--policy", "human"), "textual", "tui"),
        (("tournament", "run", "starter", "--venue", "ray"), "ray", "cluster"),
        (("leaderboard", "--db", "postgresql://arena@127.0.0.1:1/arena"), "psycopg", "postgres"),
    ],
    ids=[
        "play champion",
        "arena train",
        "arena web",
        "serve --web",
        "serve --metrics",
        "join --policy human",
        "--venue ray",
        "--db postgresql",
    ],
)
def test_a_missing_extra_is_one_sentence_with_its_command(
    installed: Installed, arguments: tuple[str, ...], package: str, extra: str
) -> None:
    done = installed.arena(*arguments)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert f"needs {package}, which is not installed here: pip install 'arena-pit[{extra}]'" in done.stderr


@pytest.mark.parametrize("name", ["paper", "reflex"])
def test_a_fighter_whose_weights_are_left_out_says_where_they_are(installed: Installed, name: str) -> None:
    done = installed.arena("play", name, "rush")

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert f"policies/weights/{name}.safetensors" in done.stderr
