"""The local venue: a match is the same however it is run, and a bad fighter costs its own seat alone."""

import multiprocessing
import os
import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arena.errors import ArenaError, InputError
from arena.game.observation import Observation
from arena.game.ruleset import RULESETS, Ruleset, load
from arena.game.types import Team, Termination
from arena.local.venue import MATCHES_PER_TASK, MatchRecord, play, play_batch, split
from arena.policy import BatchFactory, MatchInfo, MatchResult
from arena.records.journal import Mark, journal_name, read_journal
from arena.records.journal_folder import JournalFolder, load_journal
from arena.records.plan import MatchPlan
from arena.records.replay import verify
from policies import registry
from policies.each_seat import EachSeatFactory

PAPER = load("paper")
Plan = Callable[..., MatchPlan]
EAST = 2


def journals_of(records: Sequence[MatchRecord]) -> dict[str, bytes]:
    return {record.plan.identity: record.journal or b"" for record in records}


def marks_of(record: MatchRecord, team: Team) -> list[Mark]:
    return [tick.marks[team] for tick in read_journal(record.journal or b"").ticks]


def in_rows(name: str, rows: int) -> BatchFactory:
    """Return one of our fighters, as one that wants few rows."""

    def make(ruleset: Ruleset, team: Team, n_seats: int) -> Any:
        return registry.load(name)(ruleset, team, n_seats)

    make.most_seats = rows  # type: ignore[attr-defined]
    return make


@pytest.fixture(scope="module")
def plans(planned: Plan) -> list[MatchPlan]:
    return [planned(f"paper/{number}", *(("rush", "patrol"), ("patrol", "rush"))[number % 2]) for number in range(24)]


@pytest.fixture(scope="module")
def expected(plans: list[MatchPlan]) -> dict[str, bytes]:
    """Return each plan's journal, played alone."""
    alone = [play_batch(PAPER, [plan], registry.load(plan.blue), registry.load(plan.red)) for plan in plans]
    return journals_of([record for records in alone for record in records])


@pytest.mark.parametrize("rows", [1, 2, 5, 64])
def test_a_match_is_the_same_in_any_number_of_rows(plans: list[MatchPlan], expected: dict[str, bytes], rows: int) -> None:
    of_rush = [plan for plan in plans if plan.blue == "rush"]
    records = list(play_batch(PAPER, of_rush, in_rows("rush", rows), registry.load("patrol")))

    assert journals_of(records) == {plan.identity: expected[plan.identity] for plan in of_rush}


@pytest.mark.parametrize("n_workers", [1, 2])
def test_a_match_is_the_same_with_any_number_of_workers(
    plans: list[MatchPlan], expected: dict[str, bytes], n_workers: int
) -> None:
    assert journals_of(list(play(PAPER, plans, registry.load, n_workers=n_workers))) == expected


def test_a_match_is_the_same_in_any_order_of_plans(plans: list[MatchPlan], expected: dict[str, bytes]) -> None:
    shuffled = random.Random(3).sample(plans, len(plans))

    assert journals_of(list(play(PAPER, shuffled, registry.load, n_workers=1))) == expected


def test_more_matches_than_a_task_holds_are_each_played_once(planned: Plan, small_rules: Ruleset) -> None:
    many = [planned(f"small/{number}") for number in range(MATCHES_PER_TASK + 3)]

    records = list(play(small_rules, many, lambda _: registry.load("random"), n_workers=1))

    assert sorted(record.plan.identity for record in records) == sorted(plan.identity for plan in many)


@pytest.mark.parametrize(("n_matches", "n_workers", "n_tasks"), [(1_000, 16, 32), (640, 4, 16), (40, 16, 2), (20_000, 1, 5)])
def test_one_pairing_is_work_for_every_core(planned: Plan, n_matches: int, n_workers: int, n_tasks: int) -> None:
    many = [planned(f"small/{number}") for number in range(n_matches)]

    tasks = split(many, n_workers)

    assert len(tasks) == n_tasks
    assert max(map(len, tasks)) - min(map(len, tasks)) <= 1
    assert sorted(plan.identity for task in tasks for plan in task) == sorted(plan.identity for plan in many)


def test_no_plans_give_no_matches(tmp_path: Path) -> None:
    assert list(play(PAPER, [], registry.load, journals=tmp_path)) == []


def test_journals_in_a_folder_are_the_same_and_their_owner_s_alone(
    plans: list[MatchPlan], expected: dict[str, bytes], tmp_path: Path
) -> None:
    records = list(play(PAPER, plans, registry.load, journals=tmp_path / "made" / "anew", n_workers=1))

    files = {path.name: path for path in (tmp_path / "made" / "anew").iterdir()}
    assert all(record.journal is None for record in records)
    assert {name: path.read_bytes() for name, path in files.items()} == {
        journal_name(identity): data for identity, data in expected.items()
    }
    assert {path.stat().st_mode & 0o777 for path in files.values()} == {0o600}
    assert all(verify(load_journal(path)) for path in files.values())


@pytest.mark.parametrize("n_workers", [1, 2])
def test_journals_of_many_matches_are_the_same_in_bundles(
    plans: list[MatchPlan], expected: dict[str, bytes], n_workers: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    former = tmp_path / journal_name(plans[0].identity)
    former.write_bytes(b"does not hold")
    monkeypatch.setattr("arena.local.venue.MOST_FILES", len(plans) - 1)

    told = {record.plan.identity for record in play(PAPER, plans, registry.load, journals=tmp_path, n_workers=n_workers)}

    bundles = {path.name for path in tmp_path.glob("*.journals")}
    kept = JournalFolder(tmp_path)
    assert told == kept.identities() == set(expected)
    assert {identity: kept.read(identity) for identity in told} == expected
    assert {path.name for path in tmp_path.iterdir()} == bundles | {f"{former.name}.1"}
    assert 0 < len(bundles) < len(plans)


def test_a_match_is_told_once_its_journal_is_in_a_bundle(
    plans: list[MatchPlan], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arena.local.venue.MOST_FILES", 0)
    kept = JournalFolder(tmp_path)

    for record in play(PAPER, plans, registry.load, journals=tmp_path, n_workers=1):
        assert kept.holds(record.plan.identity)


def test_a_record_s_result_is_what_its_journal_says(plans: list[MatchPlan]) -> None:
    for record in play(PAPER, plans, registry.load, n_workers=1):
        assert read_journal(record.journal or b"").ending == record.result


def test_a_folder_that_cannot_be_written_is_one_sentence(plans: list[MatchPlan], tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()

    with pytest.raises(InputError, match=r"cannot keep journals in .*file: it is no folder"):
        list(play(PAPER, plans, registry.load, journals=file))
    with pytest.raises(InputError, match=r"cannot keep journals in .*: Not a directory"):
        list(play(PAPER, plans, registry.load, journals=file / "below"))


@pytest.mark.parametrize("n_workers", [1, 2])
def test_a_journal_that_cannot_be_written_is_one_sentence(plans: list[MatchPlan], tmp_path: Path, n_workers: int) -> None:
    (tmp_path / journal_name(plans[5].identity)).mkdir()

    with pytest.raises(InputError, match=r"cannot write the journal of paper/5 in .*: Is a directory"):
        list(play(PAPER, plans, registry.load, journals=tmp_path, n_workers=n_workers))


def test_bundles_that_the_disk_does_not_take_are_one_sentence_and_hold_what_it_took(
    plans: list[MatchPlan], expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arena.local.venue.MOST_FILES", 0)
    monkeypatch.setattr("arena.local.saving._RECORDS_PER_WRITE", 2)
    write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[: 10_000 - os.fstat(descriptor).st_size]))

    told: list[MatchRecord] = []
    with pytest.raises(InputError, match=r"cannot write the journals? of paper/\d+ .*in .*: No space left on device"):
        told.extend(play(PAPER, plans, registry.load, journals=tmp_path, n_workers=1))

    kept = JournalFolder(tmp_path)
    held = kept.identities()
    assert {record.plan.identity for record in told} <= held < set(expected)
    assert held
    assert {identity: kept.read(identity) for identity in held} == {identity: expected[identity] for identity in held}


@pytest.mark.parametrize("name", RULESETS)
def test_any_ruleset_can_be_played(name: str, planned: Plan) -> None:
    matches = [planned(f"{name}/{number}", "rush", "patrol") for number in range(4)]

    records = list(play(load(name), matches, registry.load, n_workers=1))

    assert len(records) == len(matches)
    assert all(record.faults[team].raised == record.faults[team].illegal == 0 for record in records for team in Team)


@pytest.mark.parametrize("fighter", [*registry.SCRIPTS, "planner-fast"])  # other planners are the same with more time
@pytest.mark.parametrize(
    "units",
    [
        {"ugv": {"blue": 0, "red": 0}, "uav": {"blue": 0, "red": 0}},
        {"ugv": {"blue": 0}, "uav": {"blue": 0}},
        {"ugv": {"red": 0}, "uav": {"red": 0}},
        {"ugv": {"blue": 0, "red": 1}},
    ],
    ids=["nobody", "no blue", "no red", "blue only flies"],
)
def test_a_side_may_be_empty(fighter: str, units: dict[str, Any], planned: Plan) -> None:
    rules = PAPER.with_({"units": units, "tick_limit": 20})

    [record] = play(rules, [planned("empty", fighter, fighter)], registry.load)

    assert verify(read_journal(record.journal or b"")) == record.result.ticks
    assert record.result.ending is not Termination.ELIMINATION


def test_a_board_of_one_s_own_is_played_as_drawn(small_rules: Ruleset, planned: Plan, every_tick: Any) -> None:
    stay = every_tick([0, 0])

    records = list(play_batch(small_rules, [planned("a"), planned("b")], stay, stay))

    first, second = (read_journal(record.journal or b"") for record in records)
    assert [record.result.ending for record in records] == [Termination.TICK_LIMIT] * 2
    assert first.header.ruleset.board == second.header.ruleset.board
    assert first.header.keys != second.header.keys


@dataclass
class Memory:
    """What the bots of a test were told, by the bot's number."""

    made: int = 0
    told: list[tuple[int, Any]] = field(default_factory=list)

    def make(self) -> "Bot":
        self.made += 1
        return Bot(self, self.made)


class Bot:
    def __init__(self, memory: Memory, number: int) -> None:
        self.memory, self.number = memory, number

    def start(self, info: MatchInfo) -> None:
        self.memory.told.append((self.number, info))

    def act(self, observation: Observation) -> Sequence[int]:
        self.memory.told.append((self.number, observation.tick))
        return [EAST] * len(observation.units)

    def end(self, result: MatchResult) -> None:
        self.memory.told.append((self.number, result))


def test_each_match_has_a_bot_of_its_own_that_hears_its_ticks_alone(planned: Plan) -> None:
    """Rows whose match has ended, and that wait for the last to end, ask nobody."""
    memory = Memory()
    matches = [planned(f"paper/{number}", "bot", "rush") for number in range(40)]

    records = list(play_batch(PAPER, matches, EachSeatFactory(memory.make), registry.load("rush")))

    assert memory.made == len(matches)
    lengths = []
    for number in range(1, memory.made + 1):
        info, *ticks, result = [what for who, what in memory.told if who == number]
        assert isinstance(info, MatchInfo)
        assert isinstance(result, MatchResult)
        assert (info.ruleset, info.team, ticks) == (PAPER, Team.BLUE, list(range(result.ticks)))
        lengths.append(result.ticks)
    assert sorted(lengths) == sorted(record.result.ticks for record in records)
    assert len(set(lengths)) > 5


def test_red_hears_its_own_score(planned: Plan) -> None:
    blue, red = Memory(), Memory()
    [record] = play_batch(PAPER, [planned("paper/3")], EachSeatFactory(blue.make), EachSeatFactory(red.make))

    assert record.result.score != 0
    assert blue.told[-1] == (1, record.result)
    assert red.told[-1][1].score == -record.result.score


def bad(kind: str) -> Any:
    """Return what makes a bot that fails in one way."""

    class Bad:
        def __init__(self) -> None:
            if kind == "constructor":
                raise RuntimeError("no weights")

        def start(self, info: MatchInfo) -> None:
            if kind == "start":
                raise RuntimeError("no start")

        def act(self, observation: Observation) -> Any:
            if kind == "raises":
                raise RuntimeError(f"no idea on tick {observation.tick}")
            if kind == "exits":
                sys.exit(3)
            answers = {
                "nothing": None,
                "text": "north",
                "too few": [EAST],
                "too many": [EAST] * 99,
                "out of range": [EAST] * (len(observation.units) - 1) + [5],
                "minus one": [-1] * len(observation.units),
                "not numbers": [object()] * len(observation.units),
                "half a step": [0.5] * len(observation.units),
                "not a number": [float("nan")] * len(observation.units),
                "a board": np.zeros((20, 20)),
            }
            return answers.get(kind, [EAST] * len(observation.units))

        def end(self, result: MatchResult) -> None:
            if kind == "end":
                raise RuntimeError("no end")

    return Bad


RAISING = ["raises", "exits", "constructor"]
RUBBISH = [
    "nothing",
    "text",
    "too few",
    "too many",
    "out of range",
    "minus one",
    "not numbers",
    "half a step",
    "not a number",
    "a board",
]


@pytest.mark.parametrize("kind", RAISING + RUBBISH)
def test_a_bad_bot_s_units_stay_and_the_match_goes_on(kind: str, planned: Plan) -> None:
    matches = [planned(f"paper/{number}", "bad", "rush") for number in range(5)]

    records = list(play_batch(PAPER, matches, EachSeatFactory(bad(kind)), registry.load("rush")))

    for record in records:
        journal, n_ticks = read_journal(record.journal or b""), record.result.ticks
        faults = record.faults[Team.BLUE]
        assert verify(journal) == n_ticks
        assert {tick.orders[:6] for tick in journal.ticks} == {bytes(6)}
        assert marks_of(record, Team.BLUE) == [Mark.UNREADABLE] * n_ticks
        assert marks_of(record, Team.RED) == [Mark(0)] * n_ticks
        assert (faults.raised if kind in RAISING else faults.illegal) == n_ticks + (kind == "constructor")
        assert (record.faults[Team.RED].raised, record.faults[Team.RED].illegal) == (0, 0)
    assert len(records) == 5
    assert len({record.result.ticks for record in records}) > 1


@pytest.mark.parametrize(
    ("kind", "says"), [("raises", "no idea on tick 0"), ("exits", "SystemExit: 3"), ("constructor", "no weights")]
)
def test_the_first_traceback_is_kept_and_is_the_bot_s_own(kind: str, says: str, planned: Plan) -> None:
    [record] = play_batch(PAPER, [planned("paper/1")], EachSeatFactory(bad(kind)), registry.load("rush"))

    shown = record.faults[Team.BLUE].first_traceback or ""
    assert shown.startswith("Traceback")
    assert says in shown
    assert shown.count('File "') == 1
    assert record.faults[Team.RED].first_traceback is None


@pytest.mark.parametrize("kind", ["start", "end"])
def test_a_bot_that_fails_at_the_edges_is_counted_and_plays(kind: str, planned: Plan) -> None:
    [record] = play_batch(PAPER, [planned("paper/1")], EachSeatFactory(bad(kind)), EachSeatFactory(bad("good")))

    assert (record.faults[Team.BLUE].raised, record.faults[Team.RED].raised) == (1, 0)
    assert f"no {kind}" in (record.faults[Team.BLUE].first_traceback or "")
    assert marks_of(record, Team.BLUE) == [Mark(0)] * record.result.ticks


def test_two_bad_bots_are_marked_apart(planned: Plan) -> None:
    [record] = play_batch(PAPER, [planned("paper/1")], EachSeatFactory(bad("raises")), EachSeatFactory(bad("text")))

    journal = read_journal(record.journal or b"")
    assert {tick.marks for tick in journal.ticks} == {(Mark.UNREADABLE, Mark.UNREADABLE)}
    assert record.result.ending is Termination.TICK_LIMIT
    assert (record.faults[Team.BLUE].raised, record.faults[Team.RED].illegal) == (100, 100)


class Sometimes:
    """Fails on every third tick."""

    def act(self, observation: Observation) -> Sequence[int]:
        return [EAST] * len(observation.units) if observation.tick % 3 else []


def test_only_the_bad_ticks_are_marked(planned: Plan) -> None:
    [record] = play_batch(PAPER, [planned("paper/1")], EachSeatFactory(Sometimes), registry.load("patrol"))

    marks = marks_of(record, Team.BLUE)
    assert marks == [Mark(0) if tick % 3 else Mark.UNREADABLE for tick in range(len(marks))]
    assert record.faults[Team.BLUE].illegal == len(marks[::3])


@pytest.fixture
def in_workers(tmp_path: Path, planned: Plan) -> Callable[[str], list[MatchRecord]]:
    """Play a bot file against `rush` in two workers."""

    def run(code: str) -> list[MatchRecord]:
        bot = tmp_path / "bot.py"
        bot.write_text(code)
        matches = [planned(f"paper/{number}", *((str(bot), "rush"), ("rush", str(bot)))[number % 2]) for number in range(4)]
        return list(play(PAPER, matches, registry.load, n_workers=2))

    return run


def test_a_bot_that_kills_its_worker_is_one_sentence(in_workers: Callable[[str], list[MatchRecord]]) -> None:
    with pytest.raises(ArenaError, match="a worker died: a fighter ended its process") as found:
        in_workers("import os\n\ndef act(observation):\n    os._exit(3)\n")

    assert found.value.exit_code == 1


def test_an_error_of_a_worker_comes_home(in_workers: Callable[[str], list[MatchRecord]]) -> None:
    with pytest.raises(InputError, match=r"bot.py has no bot; write a function act"):
        in_workers("acct = None\n")


def test_what_bots_print_in_workers_goes_to_stderr(
    in_workers: Callable[[str], list[MatchRecord]], capfd: pytest.CaptureFixture[str]
) -> None:
    in_workers("import os\n\ndef act(observation):\n    print('bot says')\n    os.write(1, b'bot writes\\n')\n")

    out, err = capfd.readouterr()
    assert out == ""
    assert "bot says" in err
    assert "bot writes" in err


def test_leaving_early_ends_the_workers(plans: list[MatchPlan]) -> None:
    matches = play(PAPER, plans, registry.load, n_workers=2)
    next(matches)
    matches.close()  # type: ignore[attr-defined]

    assert multiprocessing.active_children() == []
