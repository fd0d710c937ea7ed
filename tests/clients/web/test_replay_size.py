"""How much a replay of 100 ticks weighs, with all that a bot notes: what is sent, and what is saved as one file."""

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from urllib.request import Request, urlopen

import numpy as np
import pytest
from serving import Archive, serving

from arena.annotations import Annotations
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.local.venue import play_batch
from policies import registry
from tournaments.fixture import plan_fixture

MOST_BYTES = 200_000
N_TICKS = 100


@pytest.fixture(scope="module")
def data() -> bytes:
    """Return the journal of a match that had all its ticks."""
    plans = plan_fixture("friday", "turtle", "turtle", 4, secret_from_seed(3))
    records = play_batch(load("paper"), plans, registry.load("turtle"), registry.load("turtle"))
    return next(record.journal for record in records if record.result.ticks == N_TICKS and record.journal is not None)


@pytest.fixture
def noted(data: bytes, transcribe: Callable[..., Path], tmp_path: Path) -> bytes:
    """Return a transcript of it whose bot notes a line, a path and a heat of pure noise on every tick."""
    rng = np.random.default_rng(0)

    def note(notes: Annotations, tick: int) -> None:
        notes.log(f"tick {tick}: the flag is {rng.integers(99)} cells away, and unit {tick % 6} goes there")
        notes.draw.path(rng.integers(0, 20, (20, 2)).tolist())
        notes.draw.heat(rng.random((20, 20)))

    return transcribe(tmp_path / "a.transcript", note, data).read_bytes()


def receive(request: Request) -> bytes:
    """Return what comes over the wire, as for a browser."""
    request.add_header("accept-encoding", "gzip")
    with urlopen(request) as answer:
        assert answer.headers["content-encoding"] == "gzip"
        return bytes(answer.read())


def test_a_replay_of_100_ticks_is_small_with_all_that_a_bot_noted(data: bytes, noted: bytes) -> None:
    with serving(Archive({"match": data})) as home:
        replayed = receive(Request(f"{home}/api/replay/match"))
        opened = receive(Request(f"{home}/api/open/frames", noted, {"origin": home}))
        files = [
            gzip.decompress(receive(request))
            for request in (Request(f"{home}/api/download/html/match"), Request(f"{home}/api/open/html", noted, {"origin": home}))
        ]

    for sent, n_ticks in ((replayed, N_TICKS + 1), (opened, N_TICKS)):
        assert len(json.loads(gzip.decompress(sent))["ticks"]) == n_ticks
    drawn = json.loads(gzip.decompress(opened))["ticks"][-1]["annotations"]
    assert (len(drawn["log"]), [list(one) for one in drawn["draw"]]) == (1, [["path", "colour"], ["heat", "colour"]])
    sizes = [len(replayed), len(opened), *map(len, files)]
    assert max(sizes) < MOST_BYTES, sizes
