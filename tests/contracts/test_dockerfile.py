"""The Dockerfile, as far as it can be tested without an engine: its own lines, in a clean folder with only what it copies."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from arena.jit import cache_root

ROOT = Path(__file__).parents[2]
LINES = (ROOT / "Dockerfile").read_text(encoding="utf-8").replace("\\\n", " ").splitlines()


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

    assert last_stage[user] == "USER arena"
    assert not any(line.startswith("USER root") for line in last_stage[user:])


def test_its_health_check_is_a_command_that_fails_without_a_pit(image: dict[str, str], tmp_path: Path) -> None:
    check = re.findall(r'"([^"]*)"', steps("HEALTHCHECK")[0].partition("CMD")[2])

    done = subprocess.run(check, cwd=tmp_path, env=image, capture_output=True, text=True, timeout=120, check=False)

    assert done.returncode == 1
    assert "no pit answers" in done.stdout
