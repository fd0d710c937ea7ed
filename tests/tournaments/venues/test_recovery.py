"""Results that are read from journals: the same as were told, and nothing that is not the plan's."""

import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from arena.errors import JournalError
from arena.game.keys import secret_from_seed
from arena.game.ruleset import load
from arena.game.types import Team, Termination
from arena.local.venue import play_batch
from arena.match.effects import Effect, End, Write
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.protocol.identity import Identity
from arena.protocol.messages import Receipt
from arena.records.journal import (
    Header,
    Mark,
    identity_of,
    journal_name,
    read_journal,
    write_receipt,
    write_seats,
    write_signature,
)
from arena.records.journal_folder import JournalFolder, find_journals
from arena.records.plan import MatchPlan
from policies.registry import load as load_policy
from tournaments.fixture import plan_fixture
from tournaments.league.file import load_league
from tournaments.outcome import Outcome, SeatOutcome
from tournaments.running.scheduler import Folders, Scheduler, Venue
from tournaments.store.store import Store
from tournaments.venues.local import play as play_local
from tournaments.venues.network import play as play_network
from tournaments.venues.recovery import find_ended, set_aside
from tournaments.venues.setting import VenueSetting

RULES = load("paper").with_({"tick_limit": 12})
PLANS = plan_fixture("friday", "rush", "flawed", 3, secret_from_seed(1))
FLAWED = """
class Flawed:
    def start(self, info):
        raise RuntimeError("counted nowhere: no turn was lost by it")
    def act(self, observation):
        if observation.tick % 5 == 2:
            raise RuntimeError("a turn lost")
        return [9] if observation.tick % 5 == 3 else [0 for unit in observation.units]
"""


def make_setting(folder: Path) -> VenueSetting:
    bot = folder / "flawed.py"
    bot.write_text(FLAWED)
    return VenueSetting(
        ruleset=RULES, entries={"rush": "rush", "flawed": str(bot)}, time_control=TimeControl(), slots=1,
        journals=folder / "journals", keys=folder / "keys", homes=folder / "homes",
    )  # fmt: skip


def by_identity(outcomes: list[Outcome]) -> dict[str, Outcome]:
    return {outcome.identity: outcome for outcome in outcomes}


def test_what_is_read_is_what_was_told_its_faults_included(tmp_path: Path) -> None:
    setting = make_setting(tmp_path)
    told = by_identity(list(play_local(setting, PLANS)))  # by workers, where there are cores

    assert by_identity(list(find_ended(setting.journals, RULES, PLANS))) == told
    assert len(told) == len(PLANS)
    assert sum(seat.faults.get("unreadable", 0) for outcome in told.values() for seat in outcome.seats.values()) > 0


def test_a_seat_of_a_batch_that_plays_match_after_match_is_counted_anew_in_each(tmp_path: Path) -> None:
    flawed = replace(load_policy(make_setting(tmp_path).entries["flawed"]), most_seats=1)
    plans = [plan for plan in PLANS if plan.red == "flawed"]

    for record in play_batch(RULES, plans, load_policy("rush"), flawed):
        marks = [tick.marks for tick in read_journal(record.journal or b"").ticks]
        assert record.n_unreadable == tuple(sum(Mark.UNREADABLE in mark[team] for mark in marks) for team in Team)


@pytest.mark.usefixtures("one_core")
def test_no_match_that_has_a_whole_journal_is_played_again(tmp_path: Path) -> None:
    setting = make_setting(tmp_path)
    told = by_identity(list(play_local(setting, PLANS)))
    written = {path: path.stat().st_mtime_ns for path in setting.journals.glob("*.journal")}
    gone = setting.journals / journal_name(PLANS[2].identity)
    gone.unlink()

    again = by_identity(list(play_local(setting, PLANS)))

    assert again == told
    assert {path for path, at in written.items() if path.stat().st_mtime_ns != at} == {gone}


@pytest.mark.usefixtures("one_core")
def test_what_a_bundle_lacks_is_played_again_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("arena.local.venue.MOST_FILES", 1)
    setting, kept = make_setting(tmp_path), JournalFolder(tmp_path / "journals")
    told = by_identity(list(play_local(setting, PLANS)))
    journals = {identity: kept.read(identity) for identity in told}
    last = sorted(setting.journals.iterdir())[-1]
    whole = {path: path.read_bytes() for path in setting.journals.iterdir()}

    for n_cut in (1, 500, len(whole[last]) - 40):  # of the index, of a journal, of all but the first bytes
        for path in setting.journals.iterdir():
            path.unlink()
        for path, data in whole.items():
            path.write_bytes(data[:-n_cut] if path == last else data)
        before = JournalFolder(setting.journals).identities()

        assert by_identity(list(play_local(setting, PLANS))) == told
        kept = JournalFolder(setting.journals)
        assert {identity: kept.read(identity) for identity in kept.identities()} == journals
        added = [identity for path in set(setting.journals.iterdir()) - set(whole) for identity in names_in(path)]
        assert sorted(added) == sorted(set(journals) - before)
        assert bool(added) == (n_cut > 1)


def names_in(path: Path) -> list[str]:
    return [identity_of(found.name) for found in find_journals([path])]


@pytest.mark.usefixtures("one_core")
def test_a_bundle_of_a_newer_arena_stops_a_league_before_anything_is_played_twice(tmp_path: Path) -> None:
    setting = make_setting(tmp_path)
    setting.journals.mkdir()
    (setting.journals / "000001.journals").write_bytes(b"ARENA-JOURNALS-2\nin another way")

    with pytest.raises(JournalError, match="is of format 2, which this arena does not know; install a newer arena"):
        list(play_local(setting, PLANS))
    assert len(list(setting.journals.iterdir())) == 1
    set_aside(setting.journals)
    assert not setting.journals.exists()


@pytest.mark.usefixtures("one_core")
def test_a_journal_that_was_cut_short_is_no_result(tmp_path: Path) -> None:
    setting, plan = make_setting(tmp_path), PLANS[0]
    list(play_local(setting, [plan]))
    path = setting.journals / journal_name(plan.identity)
    whole = path.read_bytes()

    for n_bytes in (0, 1, 20, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:n_bytes])
        assert list(find_ended(setting.journals, RULES, [plan])) == [], n_bytes


@pytest.mark.usefixtures("one_core")
@pytest.mark.parametrize("what", ["keys", "rules", "colours", "orders"])
def test_a_journal_that_is_not_the_plans_is_no_result(what: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    setting, plan, rules = make_setting(tmp_path), PLANS[0], RULES
    list(play_local(setting, [plan]))
    path = setting.journals / journal_name(plan.identity)
    if what == "keys":
        plan = plan._replace(keys=PLANS[1].keys)
    elif what == "rules":
        rules = RULES.with_({"tick_limit": 13})
    elif what == "colours":
        plan = plan._replace(blue=plan.red, red=plan.blue)
    else:
        journal, data = read_journal(path.read_bytes()), bytearray(path.read_bytes())
        at = data.index(journal.ticks[0].chain) - len(journal.ticks[0].orders) - len(Team)
        data[at] = (data[at] + 1) % 5
        path.write_bytes(data)

    assert list(find_ended(setting.journals, rules, [plan])) == []
    assert [record.levelname for record in caplog.records if "is played again" in record.message] == ["WARNING"]


def on_the_network(plan: MatchPlan, folder: Path, *, is_void: bool = False) -> Match:
    """Write the journal of a match in which blue is late at every third tick, and cannot be read at others; return the match."""
    header = Header(identity=plan.identity, blue=plan.blue, red=plan.red, ruleset=RULES, keys=plan.keys)
    match, pit = Match(header, TimeControl(turn_time_s=1.0, bank_s=0.0), 0.0), Identity.make()
    events: list[Effect] = []
    for team in Team:
        events += match.ready(team, 0.0)
    now_s, n_units = 0.0, {team: len(RULES.team(team)) for team in Team}
    while not any(isinstance(event, End) for event in events):
        if is_void and match.tick == 2:
            events += match.void("the pit burnt down")
            break
        tick = match.tick
        events += match.submit(Team.RED, tick, bytes(n_units[Team.RED]), now_s)
        if tick % 3 != 1:
            events += match.submit(Team.BLUE, tick, bytes(n_units[Team.BLUE]) if tick % 4 else b"\xff", now_s)
        else:
            now_s += 1.0
            events += match.advance(now_s)
    seats = write_seats(pit.public, {team: Identity.make().public for team in Team}, bytes(64))
    records = b"".join(event.data for event in events if isinstance(event, Write))
    receipt = write_receipt(Team.BLUE, Receipt(n_shown=1, head=bytes(32), signature=bytes(64)))
    folder.mkdir(exist_ok=True)
    path = folder / journal_name(plan.identity)
    path.write_bytes(match.start_record + seats + records + receipt + write_signature(bytes(64)))
    return match


def test_a_match_of_the_network_counts_the_same_whether_it_was_told_or_read(tmp_path: Path) -> None:
    match = on_the_network(PLANS[0], tmp_path)
    path = tmp_path / journal_name(PLANS[0].identity)
    counted = {team: {kind: n for kind, n in match.record(team).faults().items() if n} for team in Team}

    for n_cut in (0, 1, 65, 100):  # a signature, or a receipt, that was not written to its end
        path.write_bytes(path.read_bytes()[: -n_cut or None])
        [outcome] = find_ended(tmp_path, RULES, PLANS)
        assert {team: seat.faults for team, seat in outcome.seats.items()} == counted
        assert outcome.seats[Team.RED] == SeatOutcome()

    assert counted[Team.BLUE] == {"late": 4, "unreadable": 2}
    assert (outcome.result.ending, outcome.result.ticks) == (Termination.TICK_LIMIT, RULES.tick_limit)


@pytest.mark.usefixtures("one_core")
@pytest.mark.parametrize("play", [play_local, play_network])
def test_a_void_match_is_no_result_and_is_played_again(
    play: Callable[[VenueSetting, Sequence[MatchPlan]], Iterator[Outcome]], tmp_path: Path
) -> None:
    setting, plan = make_setting(tmp_path), PLANS[0]
    on_the_network(plan, setting.journals, is_void=True)
    assert list(find_ended(setting.journals, RULES, [plan])) == []

    [outcome] = play(setting, [plan])

    assert outcome.result.ending not in (Termination.VOID, Termination.RUNNING)
    [again] = find_ended(setting.journals, RULES, [plan])
    assert again.result == outcome.result


@pytest.mark.usefixtures("one_core")
def test_the_journals_of_another_league_are_set_aside_each_time_under_a_name_of_its_own(tmp_path: Path) -> None:
    setting = make_setting(tmp_path)
    list(play_local(setting, PLANS[:1]))
    shutil.copytree(setting.journals, tmp_path / "copy")
    name = journal_name(PLANS[0].identity)

    set_aside(setting.journals)
    shutil.copytree(tmp_path / "copy", setting.journals)
    set_aside(setting.journals)
    set_aside(setting.journals)  # nothing is there

    assert not setting.journals.exists()
    assert [(tmp_path / f"journals.before-{number}" / name).is_file() for number in (1, 2, 3)] == [True, True, False]


def run(data: Path, file: Path, play: Venue) -> list[Outcome]:
    """Run a league to its end, and return what is stored."""
    data.mkdir(exist_ok=True)
    with Store(str(data / "arena.db")) as store, Scheduler(load_league(str(file)), store, Folders(data=data)) as scheduler:
        for _ in scheduler.run(play):
            pass
        return store.outcomes(scheduler.row)


def lose(setting: VenueSetting, plans: Sequence[MatchPlan]) -> Iterator[Outcome]:
    """Play, and be killed before a result is told."""
    list(play_local(setting, plans))
    raise KeyboardInterrupt
    yield


@pytest.mark.usefixtures("one_core")
@pytest.mark.parametrize("is_edited", [False, True])
def test_what_was_played_counts_unless_the_league_was_edited_before_its_first_result(is_edited: bool, tmp_path: Path) -> None:
    file, bot, data = tmp_path / "friday.toml", tmp_path / "flawed.py", tmp_path / "data"
    file.write_text('pairs = 1\nseed = 1\nentries = ["rush", "flawed.py"]\n[rules]\ntick_limit = 12')
    bot.write_text(FLAWED)
    with pytest.raises(KeyboardInterrupt):
        run(data, file, lose)
    journals = data / "journals" / "friday"
    before = {path.name: path.stat().st_mtime_ns for path in journals.glob("*.journal")}
    if is_edited:
        bot.write_text(FLAWED.replace("return [9]", "return [1]"))

    stored = run(data, file, play_local)

    kept = {path.name: path.stat().st_mtime_ns for path in journals.glob("*.journal")}
    assert set(kept) == set(before)
    assert (kept == before) == (not is_edited)
    assert stored == run(tmp_path / "undisturbed", file, play_local)
    assert (data / "journals" / "friday.before-1").exists() == is_edited
