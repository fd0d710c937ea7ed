"""Bots that attack the machine they play on: each is really run in a league, gets nothing, and disturbs nobody."""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bots import BOTS, source_of
from family import marked

from arena.errors import InputError
from arena.game.ruleset import load
from arena.jit import cache_root
from arena.network.address import free_port
from arena.sandbox import bubblewrap
from arena.sandbox.limits import BEHIND_A_WALL
from arena.sandbox.process import Sandbox
from tournaments.league.file import load_league
from tournaments.running.preflight import check_entries

WALKER = "def act(seen):\n    return [(seen.tick // 3 + unit) % 5 for unit in range(len(seen.units))]\n"
LEAGUE = """
name = "pit"
seed = 5
pairs = 1
turn_time_s = 0.6
bank_s = 3
listen = "tcp/127.0.0.1:{port}"
{pairing}
[limits]
memory_mb = 400
processes = 40
disk_mb = 16
output_kb = 64
[entries]
{entries}
"""


@pytest.fixture(autouse=True)
def _needs_a_wall() -> None:
    why = bubblewrap.why_no_wall()
    if why is not None and not os.environ.get("ARENA_REQUIRE_ALL"):
        pytest.skip(why)


@pytest.fixture
def decoy() -> Iterator[subprocess.Popen[bytes]]:
    """A process of the host that somebody might want to kill."""
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(10000)"]) as process:
        yield process
        process.kill()


def run_league(folder: Path, specs: list[str], pairing: str, port: int) -> tuple[dict[str, object], str]:
    """Run a league of bot files and our own fighters; return its report, and all that was said in its logs."""
    entries = "\n".join(f'{Path(spec).stem} = "{spec}"' for spec in specs)
    (folder / "pit.toml").write_text(LEAGUE.format(port=port, pairing=pairing, entries=entries))
    command = [sys.executable, "-c", "from tournaments.cli import main; main()", "tournament", "run", "pit.toml"]
    ran = subprocess.run(
        [*command, "--data", "data", "--json"], cwd=folder, capture_output=True, text=True, check=False,
        env={**os.environ, "ARENA_TEST_SECRET": "1", "PGPASSWORD": "1"}, timeout=1500,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr[-3000:]
    logs = list((folder / "data" / "journals" / "pit").glob("*.log"))
    assert all(log.stat().st_size < 1 << 20 for log in logs)
    return json.loads(ran.stdout), ran.stderr + "".join(log.read_text(errors="replace") for log in logs)


def results(folder: Path, *names: str) -> set[tuple[object, ...]]:
    """Return how the matches between some entries ended."""
    from tournaments.store.store import Store

    with Store(str(folder / "data" / "arena.db")) as store:
        row = store.get("pit")
        return {
            (outcome.identity, outcome.winner, outcome.result.ticks, outcome.result.ending)
            for outcome in store.outcomes(row)
            if {outcome.blue, outcome.red} == set(names)
        }


def digest(*paths: Path) -> str:
    """Return a hash of files."""
    whole = hashlib.sha256()
    for path in paths:
        whole.update(path.read_bytes())
    return whole.hexdigest()


def test_a_league_of_hostile_bots_ends_by_itself_and_they_get_nothing(
    tmp_path: Path, decoy: subprocess.Popen[bytes], size: Callable[[int, int], int]
) -> None:
    port, alone, together = free_port(), tmp_path / "alone", tmp_path / "together"
    mark = f"outlives{os.getpid()}"
    for folder in (alone, together):
        folder.mkdir()
        (folder / "walker.py").write_text(WALKER)
    data = together / "data"
    paths = [together / "walker.py", together / "pit.toml", data, data / "arena.db", data / "keys", data / "journals" / "pit"]
    facts = {
        "names": ["walker.py", "pit.toml", "pit.key", "arena.db"],
        "paths": [str(path) for path in (*paths, Path.home() / ".ssh", Path.home() / ".pgpass", "/etc/shadow")],
        "port": port,
        "pids": [decoy.pid],
        "mark": mark,
    }
    for name in BOTS:
        (together / f"{name}.py").write_text(source_of(name, **facts))
    bots = [together / f"{name}.py" for name in (*BOTS, "walker")]
    kernels = sorted(path for path in cache_root().rglob("*") if path.is_file())
    before = digest(*bots, *kernels)
    pairing = 'pairing = "gauntlet"\nchallenger = "rush"' if size(0, 1) == 0 else 'pairing = "round-robin"'

    run_league(alone, ["rush", "walker.py"], "", port)
    report, said = run_league(together, ["rush", *(bot.name for bot in bots)], pairing, port)

    assert "LOOT" not in said, [line for line in said.splitlines() if "LOOT" in line][:10]
    assert results(together, "rush", "walker") == results(alone, "rush", "walker")
    assert len(results(alone, "rush", "walker")) == 2
    assert decoy.poll() is None
    assert digest(*bots, *kernels) == before
    assert not marked(mark), "a daemon outlived its league"
    faults = {row["entry"]: row["faults"] for row in report["standings"]}  # type: ignore[index, attr-defined]
    assert faults["allocates"]["memory limit"] > 0
    assert faults["forks"]["processes limit"] > 0
    assert faults["shouts"]["output limit"] > 0
    assert not any(kind.endswith("limit") and n for name in ("rush", "walker") for kind, n in faults[name].items())


@pytest.mark.parametrize("shape", [[1 << 40, 1 << 20], [-1], ["x"], [[[[1]]]]])
def test_a_checkpoint_that_bites_is_refused_in_a_sentence(shape: list[object], tmp_path: Path) -> None:
    header = json.dumps({"weight": {"dtype": "F32", "shape": shape, "data_offsets": [0, 4]}}).encode()
    file = tmp_path / "bites.safetensors"
    file.write_bytes(len(header).to_bytes(8, "little") + header + bytes(4))
    sandbox = Sandbox(has_wall=True, limits=BEHIND_A_WALL)

    with pytest.raises(InputError) as refused:
        check_entries({"bites": str(file)}, load("paper"), {"bites": sandbox})

    assert str(refused.value).startswith("bites cannot start: ")
    assert "Traceback" not in str(refused.value)


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "[" * 100_000,
        "x = " + "{a=" * 50_000,
        "[" + "a." * 100_000 + "b]\nx = 1",
        "pairs = " + "9" * 5_000,
        "a = 1\n" * 2,
    ],
    ids=["lists", "tables", "keys", "digits", "twice"],
)
def test_a_league_file_that_bites_is_refused_in_a_sentence(text: str, tmp_path: Path) -> None:
    file = tmp_path / "bites.toml"
    file.write_text(text)

    with pytest.raises(InputError) as refused:
        load_league(str(file))

    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400
