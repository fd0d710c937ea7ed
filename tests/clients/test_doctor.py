"""What `arena doctor` says of compiled kernels."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

from arena.jit import cache_root
from arena.protocol.codec import MOST_LISTED
from arena.protocol.messages import Lobby
from clients import doctor

Arena = Callable[..., subprocess.CompletedProcess[str]]


def kernels_of(done: subprocess.CompletedProcess[str]) -> str:
    """Return what was found on kernels."""
    assert done.returncode == 0, done.stderr
    (finding,) = [one["finding"] for one in json.loads(done.stdout) if one["what"] == "kernels" and one["ok"]]
    return str(finding)


def test_it_says_which_kernels_are_missing_and_what_to_do_and_compiles_none(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from tournaments.cli import main; main()", "doctor", "--json"]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}

    finding = kernels_of(
        subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False),
    )

    assert "are not compiled yet (steps, views, boards, turns, random, " in finding
    assert finding.endswith(f"in {tmp_path}; arena doctor --compile does it now")
    assert not list(tmp_path.iterdir())


def test_it_says_that_all_are_compiled_and_where(arena: Arena) -> None:
    finding = kernels_of(arena("doctor", "--compile", "--json"))

    assert finding.startswith("compiled: all ")
    assert finding.endswith(f", in {cache_root()}")


@pytest.mark.parametrize(("n_running", "says"), [(3, "3 matches"), (MOST_LISTED, f"{MOST_LISTED} or more matches")])
def test_it_counts_no_more_matches_than_a_pit_names(monkeypatch: pytest.MonkeyPatch, n_running: int, says: str) -> None:
    lobby = Lobby(
        pit="pit",
        rules="paper",
        rules_hash="",
        ruleset={},
        needs_invite=False,
        n_begun=n_running,
        running=[{}] * n_running,
        waiting=["ann"],
    )
    monkeypatch.setattr(doctor, "open_client", lambda *_: nullcontext())
    monkeypatch.setattr(doctor, "ask_challenge", lambda *_: SimpleNamespace(pit_key=bytes(32)))
    monkeypatch.setattr(doctor, "ask_lobby", lambda *_: lobby)

    _, is_well, found = doctor.examine("arena://127.0.0.1:1/pit", None)[-1]

    assert (is_well, found) == (True, f"rules paper, {says} running, 1 waiting")
