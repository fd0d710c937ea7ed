"""The soak, small: real processes that fail at random; what it counts; and, of full size, as long as a claim needs."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from arena.errors import ArenaError
from arena.records.journal import journal_name
from benchmarks.measuring import faults, journal_watch, trends
from benchmarks.measuring.audit import audit_league
from benchmarks.measuring.faults import FaultInjector, Kind, Target
from benchmarks.measuring.trends import WARM_UP_S, Cost, Growth, Lives
from benchmarks.soak import measure
from tournaments.commands import bench
from tournaments.league.file import load_league
from tournaments.running.scheduler import Folders, Scheduler
from tournaments.store.store import Store
from tournaments.venues.local import play

Size = Callable[[int, int], int]


def test_nothing_is_lost_whatever_is_killed_stopped_or_cut(size: Size) -> None:
    said: list[str] = []
    is_full = size(0, 1) == 1
    chosen: dict[str, Any] = (
        {}
        if is_full
        else {
            "entries": {"ann": "patrol", "bob": "rush"},
            "has_league": False,
            "every_s": 0.1,
            "n_workers": 1,
            "n_far_workers": 1,
        }
    )

    figures = measure(said.append, duration_s=size(1, 15 * 60), seed=133, **chosen)  # small, it switches the other machine off

    assert figures["broken"] == []
    assert sum(costs["n"] for costs in figures["faults"].values()) >= size(1, 50)
    assert figures["pit"]["stored"] == figures["pit"]["matches"] > 0
    assert "seed 133" in said
    for injector in ("pit", "league") if is_full else ("pit",):
        assert all(n >= 0 for n in figures[injector]["late_turns"].values())


@pytest.fixture
def league(tmp_path: Path) -> Path:
    """Play a league, and return its data folder."""
    file = tmp_path / "league.toml"
    file.write_text('name = "league"\npairs = 2\nseed = 1\n[entries]\none = "rush"\ntwo = "patrol"\n')
    with (
        Store(str(tmp_path / "arena.db")) as store,
        Scheduler(load_league(str(file)), store, Folders(data=tmp_path)) as scheduler,
    ):
        for outcome in scheduler.run(lambda setting, plans: play(replace(setting), plans)):
            assert outcome.identity.startswith("league/")
    return tmp_path


def names(data: Path) -> set[str]:
    return {path.name for path in (data / "journals" / "league").glob("*.journal")}


def audit(data: Path, n_planned: int = 4, **more: Any) -> list[str]:
    return audit_league(data, str(data / "arena.db"), "league", n_planned, more.get("seen", names(data))).broken


def test_what_is_lost_changed_or_was_never_played_breaks_a_promise(league: Path) -> None:
    journals = league / "journals" / "league"
    first, second = sorted(journals.glob("*.journal"))[:2]

    assert [said for said in audit(league) if "signature" not in said] == []  # a local match has none
    assert "4 matches are stored of 5 that were to be played" in audit(league, 5)
    assert f"the journal {journal_name('league/lost')} is gone" in audit(league, seen={journal_name("league/lost")})
    data = bytearray(first.read_bytes())
    data[-40] ^= 1
    first.write_bytes(bytes(data))
    second.write_bytes(second.read_bytes()[: len(second.read_bytes()) // 2])
    said = "\n".join(audit(league))
    assert f"the journal {first.name} does not hold: " in said
    assert said.count("ended otherwise in the store than in") == 2


def test_a_slope_is_found_within_lives_and_noise_is_none() -> None:
    random = np.random.default_rng(5)
    flat, grows = Lives(), Lives()
    for life, level in enumerate((100.0, 900.0, 300.0)):
        for step in range(150):
            at_s, noise = 2.0 * step, float(random.normal(0, 5))
            start = 500.0 * max(0.0, 1 - at_s / 60)  # the warm-up
            flat.add(life, at_s, level - start + noise)
            grows.add(life, at_s, level - start + noise + at_s / 60 * 20)

    found, none = grows.slope(), flat.slope()

    assert found is not None
    assert none is not None
    assert 15 < found.low < 20 < found.high < 25
    assert none.low < 0 < none.high
    assert found.minutes == pytest.approx(3 * (298 - WARM_UP_S) / 60)
    assert Lives().slope() is None


@pytest.mark.parametrize(("per_min", "grows_too_fast"), [(1_400.0, False), (1_700.0, True)])
def test_what_is_to_be_remembered_is_no_growth(monkeypatch: pytest.MonkeyPatch, per_min: float, grows_too_fast: bool) -> None:
    growth, random = Growth(), np.random.default_rng(5)
    for at_s in range(0, 900, 2):
        memory_kb = int(90_000 + per_min * at_s / 60 + random.normal(0, 50))
        monkeypatch.setattr(trends, "read_cost", lambda _, kb=memory_kb: Cost(memory_kb=kb, handles=9, threads=3))
        growth.look({"pit": [1]}, float(at_s))

    _, broken = growth.judge({"pit": 1_000.0})

    assert len(broken) == grows_too_fast
    assert all("the memory_kb of each pit" in sentence for sentence in broken)
    assert growth.judge({})[1]


def test_a_broken_promise_ends_the_command_with_exit_code_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "_find", lambda: {"soak": lambda: lambda progress: {"broken": ["a match is gone"]}})

    with pytest.raises(ArenaError, match="soak broke a promise: a match is gone") as raised:
        bench.bench(["soak"], as_json=True)

    assert raised.value.exit_code == 1
    assert "a match is gone" in capsys.readouterr().out


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Return what tells the time to faults, and to who watches journals."""
    told = SimpleNamespace(now_s=0.0)
    for module in (faults, journal_watch):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: told.now_s))
    return told


def test_how_long_nobody_played_is_counted_from_the_fault_on_and_not_where_nobody_had_to(
    tmp_path: Path, clock: SimpleNamespace
) -> None:
    repaired = list[float]()
    kind = Kind(
        name="stop",
        find=lambda: [Target(name="one", inflict=lambda: lambda: repaired.append(clock.now_s), entry="ann")],
        lasts_s=(5.0, 5.0),
    )
    injector = FaultInjector("pit", journal_watch.JournalWatch(tmp_path), [kind], 1, every_s=0.001)

    def play(identity: str) -> None:
        with (tmp_path / journal_name(identity)).open("ab") as journal:
            journal.write(b"tick")

    for second in range(1, 60):
        clock.now_s = float(second)
        play("pit/000000/bob/cyd")
        if second in (1, 20) or 8 < second < 20 or second > 30:
            play("pit/000000/ann/bob")
        if second == 25:
            injector.excuse()
        injector.tend(may_begin=second in (1, 20))

    assert repaired == [6.0, 25.0]
    assert injector.costs() == {"stop": {"n": 2, "late_turns": 0, "still_s": 8.0, "still_most_s": 8.0}}
    assert injector.broken() == []
    assert injector.is_calm


def test_a_fault_that_strikes_all_lasts_until_each_match_that_was_played_goes_on_or_is_over(
    tmp_path: Path, league: Path, clock: SimpleNamespace
) -> None:
    kind = Kind(name="off", find=lambda: [Target(name="far", inflict=lambda: None, is_of_all=True)])
    injector = FaultInjector("pit", journal_watch.JournalWatch(tmp_path), [kind], 1, every_s=0.001)
    ended = sorted((league / "journals" / "league").glob("*.journal"))[0]
    (tmp_path / ended.name).write_bytes(ended.read_bytes())  # which ends as the fault begins
    for identity in ("pit/000000/ann/bob", "pit/000001/cyd/dan", "pit/000002/eve/fay"):
        (tmp_path / journal_name(identity)).touch()

    for second in range(1, 150):
        clock.now_s = float(second)
        playing = ["pit/000000/ann/bob"]
        if second == 1 or 12 < second < 50:
            playing.append("pit/000001/cyd/dan")
        if second < 30:
            playing.append("pit/000002/eve/fay")
        for identity in playing:
            with (tmp_path / journal_name(identity)).open("ab") as journal:
                journal.write(b"tick")
        injector.tend(may_begin=second in (1, 29))

    first, second = injector.faults
    assert (first.still_s, first.is_stuck) == (12.0, False)
    assert second.is_stuck
    assert len(injector.broken()) == 1


def test_nobody_is_waited_for_while_there_is_nothing_to_play(tmp_path: Path, clock: SimpleNamespace) -> None:
    kind = Kind(name="kill", find=lambda: [Target(name="one", inflict=lambda: None)])
    injector = FaultInjector("league", journal_watch.JournalWatch(tmp_path), [kind], 1, every_s=0.001)

    for second in range(1, 300):
        clock.now_s = float(second)
        if second in (1, 150):
            with (tmp_path / journal_name("league/a/b")).open("ab") as journal:
                journal.write(b"tick")
        if second == 80:
            injector.excuse()  # it had been played
        injector.tend(may_begin=second in (1, 160))

    assert [fault.is_stuck for fault in injector.faults] == [False, True]
