"""Matches are what they were: boards, fights, fighters, and what each seat, each program and each page is shown of them."""

import json
import shlex
import subprocess
import sys
from collections.abc import Callable
from hashlib import sha256
from itertools import product
from pathlib import Path

import pytest

from arena.display.replay_frames import describe_match
from arena.errors import JournalError
from arena.game.keys import MatchKeys
from arena.game.ruleset import RULESETS, Ruleset
from arena.game.ruleset import load as load_rules
from arena.game.types import Team
from arena.local.venue import MatchRecord, play, play_batch
from arena.match.effects import Ask, Effect, End, Write
from arena.match.match import Match
from arena.match.time_control import TimeControl
from arena.protocol.observation_codec import ObservationReader, ObservationWriter
from arena.records.journal import Header, Journal, read_journal
from arena.records.plan import MatchPlan
from arena.records.replay import replay
from arena.records.transcript import Head
from policies.program import to_json
from policies.registry import SCRIPTS, load

Arena = Callable[..., subprocess.CompletedProcess[str]]
Same = Callable[[str, str], None]
Plan = Callable[..., MatchPlan]
FIGHTERS = sorted(SCRIPTS)
"""Planners apart, who play otherwise with each number that is tuned."""
SEEDS, N_MAPS = (1, 2), 2
BOARD = """
F...#...
U..A..u.
U.#.....
......u.
.....#..
.#..a..u
........
.......f
"""
UNUSUAL = {
    "side-30": {"side": 30},
    "side-4": {"side": 4, "obstacles": False, "units": {"ugv": {"blue": 1, "red": 1}, "uav": {"blue": 1, "red": 1}}},
    "side-64": {"side": 64, "tick_limit": 40},
    "board": {"board": BOARD},
    "certain-combat": {"random_combat": False},
    "certain-combat-in-reach": {"random_combat": False, "attack_at_range": False, "self_counts": False},
    "no-fog": {"fog": False},
    "unequal": {"units": {"ugv": {"blue": 5, "red": 2}, "uav": {"blue": 0, "red": 3}}},
    "crowded": {"side": 24, "units": {"ugv": {"blue": 12, "red": 12, "attack": 4}, "uav": {"blue": 4, "red": 4}}},
    "third-type": {"units": {"tank": {"step": 1, "sight": 2, "attack": 3, "strength": 5, "blue": 1, "red": 2}}},
    "peace": {"units": {"ugv": {"attack": 0}}},
    "one-tick": {"tick_limit": 1},
    "open-mirror": {"mirror": True, "obstacles": False, "side": 12},
}
PAIRINGS = (("fighter", "rush"), ("squad", "role_team"), ("chameleon", "border_hunter"), ("random", "scout_rush"))
BOT = """
class Bot:
    def start(self, info):
        self.n_acts = len(info.ruleset.units) + info.team
    def act(self, seen):
        self.n_acts += 1
        if self.n_acts % 11 == 0:
            raise ValueError("no idea")
        if self.n_acts % 7 == 0:
            return [9] * len(seen.units)
        if self.n_acts % 5 == 0:
            return []
        known = int(seen.grid.sum()) + len(seen.enemies) + seen.living[0] + seen.tick
        return [(known + unit.index + unit.row + seen.seed + bool(seen.legal_actions[unit.index][1])) % 5 for unit in seen.units]
"""
PROGRAM = """
import json, sys
with open(sys.argv[1], "ab") as log:
    for line in sys.stdin.buffer:
        log.write(line)
        log.flush()
        said = json.loads(line)
        if said["type"] == "observation":
            print([(said["seed"] + unit["index"] + said["tick"]) % 5 for unit in said["units"]], flush=True)
"""


def digest(*parts: bytes) -> str:
    return sha256(b"".join(parts)).hexdigest()


def tell(record: MatchRecord) -> str:
    """Return how a match ended, in a line's words."""
    result = record.result
    winner = "nobody" if result.winner is None else result.winner.name.lower()
    return f"{record.plan.identity} {winner} {result.ending.name.lower()} {result.score:+d} {result.ticks}"


def journal_of(record: MatchRecord) -> bytes:
    assert record.journal is not None
    return record.journal


def play_one(rules: Ruleset, plan: MatchPlan) -> bytes:
    """Play a match, and return its journal."""
    [record] = play_batch(rules, [plan], load(plan.blue), load(plan.red))
    return journal_of(record)


@pytest.fixture(scope="module")
def some_matches(plan: Plan, small_rules: Ruleset) -> dict[str, tuple[bytes, Journal]]:
    """Return a journal under each of several rulesets."""
    rules = {name: load_rules(name) for name in RULESETS}
    rules |= {name: load_rules("paper").with_(UNUSUAL[name]) for name in ("side-30", "board", "unequal", "third-type")}
    rules["small"] = small_rules
    matches = {name: play_one(one, plan(f"seen/{name}", "squad", "fighter", 1)) for name, one in rules.items()}
    return {name: (data, read_journal(data)) for name, data in matches.items()}


# Whole matches


@pytest.mark.parametrize("name", RULESETS)
def test_every_fighter_plays_a_shipped_ruleset_as_before(name: str, plan: Plan, here: Arena, same: Same, tmp_path: Path) -> None:
    rules, step = load_rules(name), 1 + RULESETS.index(name)
    plans = [
        plan(f"{name}/{blue}/{red}/{seed}/{pair}", blue, red, seed, f"{blue}/{red}", pair)
        for number, blue in enumerate(FIGHTERS)
        for red in (FIGHTERS[(number + ahead) % len(FIGHTERS)] for ahead in (step, step + 6))
        for seed, pair in product(SEEDS, range(N_MAPS))
    ]

    told = sorted(tell(record) for record in play(rules, plans, load, journals=tmp_path, n_workers=1))
    checked = here("replay", "verify", "--local", tmp_path, "--json")

    hashes = {Path(one["file"]).name: one["canonical_hash"] for one in json.loads(checked.stdout) if one["ok"]}
    lines = [f"{line} {hashes[line.partition(' ')[0].replace('/', '+') + '.journal']}" for line in told]
    assert len(lines) == len(plans) == len(FIGHTERS) * 2 * len(SEEDS) * N_MAPS
    same(f"matches/{name}.txt", "\n".join([f"rules {rules.hash}", *lines, ""]))


@pytest.mark.parametrize("name", UNUSUAL)
def test_an_unusual_ruleset_gives_the_journals_of_before(name: str, plan: Plan, same: Same) -> None:
    rules = load_rules("paper").with_(UNUSUAL[name])
    lines = [f"rules {rules.hash}"]
    for blue, red in PAIRINGS:
        plans = [plan(f"{name}/{blue}/{red}/{seed}", blue, red, seed) for seed in SEEDS]
        records = play_batch(rules, plans, load(blue), load(red))
        lines += sorted(f"{tell(record)} {len(journal_of(record))} {digest(journal_of(record))}" for record in records)

    same(f"unusual/{name}.txt", "\n".join([*lines, ""]))


def test_the_bytes_of_a_short_journal_are_those_of_before(small_journal: bytes, same: Same) -> None:
    same("journal.hex", small_journal.hex("\n", 32) + "\n")


def test_a_full_batch_whose_rows_are_used_again_gives_the_journals_of_before(plan: Plan, same: Same) -> None:
    plans = [plan(f"batch/{number}", "fighter", "squad", 1) for number in range(600)]

    journals = {record.plan.identity: journal_of(record) for record in play(load_rules("exp4"), plans, load, n_workers=1)}

    same("batch.txt", f"{len(journals)} {digest(*(journals[plan.identity] for plan in plans))}\n")


def test_a_cheat_is_shown_what_it_was_shown(plan: Plan, same: Same) -> None:
    plans = [plan(f"cheat/{seed}", "oracle_rush", "squad", seed) for seed in range(8)]

    records = play_batch(load_rules("paper"), plans, load("oracle_rush", cheats=True), load("squad"))

    same("cheat.txt", "\n".join(sorted(f"{tell(record)} {digest(journal_of(record))}" for record in records)) + "\n")


@pytest.mark.parametrize("name", ["paper", "board", "unequal"])
def test_a_bot_that_fails_at_times_is_marked_as_before(name: str, plan: Plan, same: Same, tmp_path: Path) -> None:
    (tmp_path / "shaky.py").write_text(BOT)
    rules = load_rules("paper").with_(UNUSUAL.get(name, {}))
    shaky, lines = load(str(tmp_path / "shaky.py")), []
    for blue, red in ((shaky, load("rush")), (load("patrol"), shaky)):
        plans = [plan(f"bot/{name}/{len(lines)}/{seed}", "one", "other", seed) for seed in SEEDS]
        for record in sorted(play_batch(rules, plans, blue, red), key=lambda record: record.plan.identity):
            faults = [(one.raised, one.illegal, (one.first_traceback or "").splitlines()[-1:]) for one in record.faults]
            lines.append(f"{tell(record)} {faults} {list(record.n_unreadable)} {digest(journal_of(record))}")

    same(f"bots/{name}.txt", "\n".join([*lines, ""]))


def test_a_refereed_match_is_ruled_as_before(same: Same) -> None:
    """Orders that come late, twice, too short or not at all; a seat that leaves and comes back; and a clock that runs."""
    rules = load_rules("paper").with_({"board": BOARD, "tick_limit": 30})
    keys = MatchKeys(map_key=bytes(32), match_key=b"\x01" * 32)
    header = Header(identity="ruled/0", blue="ann", red="bob", ruleset=rules, keys=keys)
    match = Match(header, TimeControl(turn_time_s=1.0, bank_s=3.0, grace_s=5.0, most_missed=4), 0.0)
    journal, said, now_s = match.start_record, ["begins"], 0.0

    def do(what: str, events: list[Effect]) -> None:
        nonlocal journal
        words = []
        for event in events:
            if isinstance(event, Write):
                journal += event.data
                words.append("write")
            elif isinstance(event, Ask):
                words.append(f"ask {event.team.name.lower()} {event.tick} {digest(event.observation)[:16]}")
            elif isinstance(event, End):
                words.append(f"end {event.result.to_dict()}")
            else:
                words.append("publish")
        said.append(f"{now_s:.2f} {what}: {', '.join(words) or 'nothing'}; {list(match.facts)}")

    for team in Team:
        do(f"ready {team.name}", match.ready(team, now_s))
    for turn in range(14):
        orders = [bytes((turn + unit) % 5 for unit in range(match_size)) for match_size in (3, 4)]
        now_s += 0.25
        blue, red = match.tick, match.tick - (turn == 3)
        do("blue answers", match.submit(Team.BLUE, blue, orders[0][: 1 + turn], now_s))
        if turn == 5:
            do("blue answers again", match.submit(Team.BLUE, blue, orders[0], now_s))
            match.count_garbled(Team.BLUE)
            match.count_forged(Team.RED)
        if turn == 7:
            do("red leaves", match.leave(Team.RED, now_s))
            now_s += 2.0
            do("time passes", match.advance(now_s))
            do("red is back", match.ready(Team.RED, now_s))
        now_s += 1.0 if turn % 2 else 0.0
        if turn < 9:
            do("red answers", match.submit(Team.RED, red, orders[1] + b"\x09" * (turn == 2), now_s))
        while turn >= 9 and match.tick == blue and match.result is None:
            now_s += 0.5
            do("time passes", match.advance(now_s))
        if turn == 3:
            do("red answers", match.submit(Team.RED, match.tick, b"\x07" * 4, now_s))
    do("blue gives up", match.forfeit(Team.BLUE, "gave up"))

    said += [f"{team.name} {match.record(team).faults()} {match.record(team).latencies_s}" for team in Team]
    said += [f"{team.name} {digest(*(piece for part in match.history(team, 2) for piece in part))}" for team in Team]
    said += [f"journal {len(journal)} {digest(journal)}", f"head {match.head.hex()}"]
    same("refereed.txt", "\n".join([*said, ""]))


# What is seen of them


def test_each_seat_is_shown_the_bytes_of_before(some_matches: dict[str, tuple[bytes, Journal]], same: Same) -> None:
    lines = []
    for name, (_, journal) in some_matches.items():
        shown: dict[Team, list[bytes]] = {team: [] for team in Team}
        clocked: dict[Team, list[bytes]] = {team: [] for team in Team}
        heads = {team: Head() for team in Team}
        for games in replay(journal):
            for team, seen in games.observe().items():
                writer = ObservationWriter(seen, 0)
                shown[team].append(writer.write())
                heads[team].add(shown[team][-1])
                writer.set_clock(7.25 - 0.5 * len(shown[team]))
                clocked[team].append(writer.write())
                seen.clock_ms[:] = 0xFFFFFFFF
        lines += [
            f"{name} {team.name.lower()} {len(shown[team])} of {len(shown[team][0])} bytes {digest(*shown[team])}"
            f" with a clock {digest(*clocked[team])} head {heads[team].digest.hex()}"
            for team in Team
        ]
        if name == "small":
            lines += [f"{team.name.lower()} {one.hex()}" for team in Team for one in (shown[team][0], clocked[team][-1])]

    same("observations.txt", "\n".join([*lines, ""]))


def test_a_bot_reads_in_the_bytes_what_it_read_before(some_matches: dict[str, tuple[bytes, Journal]], same: Same) -> None:
    lines = []
    for name, (_, journal) in some_matches.items():
        rules = journal.header.ruleset
        readers = {team: ObservationReader(rules, team) for team in Team}
        told: dict[Team, list[str]] = {team: [] for team in Team}
        for games in replay(journal):
            for team, seen in games.observe().items():
                read = readers[team].read(ObservationWriter(seen, 0).write()).seat(0, rules)
                told[team].append(json.dumps(to_json(read)))
                assert told[team][-1] == json.dumps(to_json(seen.seat(0, rules)))
        lines += [f"{name} {team.name.lower()} {digest(*(one.encode() for one in told[team]))}" for team in Team]

    same("bots_see.txt", "\n".join([*lines, ""]))


def test_a_program_is_told_the_lines_of_before(plan: Plan, small_rules: Ruleset, same: Same, tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    log = tmp_path / "log"
    command = shlex.join([sys.executable, str(tmp_path / "program.py"), str(log)])
    program, rush = load(f"exec:{command}"), load("rush")
    matches = (
        ("small", small_rules, program, rush),
        ("paper", load_rules("paper"), rush, program),
        ("unequal", load_rules("paper").with_(UNUSUAL["unequal"]), program, rush),
        ("end", small_rules, program, rush),  # once it hears of this one, it has written down all of those before
    )
    for name, rules, blue, red in matches:
        list(play_batch(rules, [plan(f"program/{name}", "one", "other", 1)], blue, red))

    _, *told = log.read_text().split('{"type":"start"')
    told = [f'{{"type":"start"{lines}' for lines in told]

    assert len(told) == len(matches)
    same("program.jsonl", told[0])
    counts = [
        f"{name} {len(lines.splitlines())} {digest(lines.encode())}"
        for (name, *_), lines in zip(matches, told[:-1], strict=False)
    ]
    same("program.txt", "\n".join([*counts, ""]))


def test_a_page_is_sent_the_scenes_of_before(
    some_matches: dict[str, tuple[bytes, Journal]], small_journal: bytes, same: Same
) -> None:
    told = {name: json.dumps(describe_match(data)) for name, (data, _) in some_matches.items()}

    same("scenes.txt", "".join(f"{name} {len(text)} {digest(text.encode())}\n" for name, text in told.items()))
    same("scenes.json", json.dumps(describe_match(small_journal), indent=1) + "\n")


@pytest.mark.parametrize("name", ["changed", "cut", "unfinished"])
def test_a_journal_that_does_not_hold_is_told_as_before(name: str, small: Journal, small_journal: bytes, same: Same) -> None:
    end = small_journal.index(small.ticks[-1].chain) + len(small.ticks[-1].chain)
    third = small_journal.index(small.ticks[2].chain)
    data = {
        "changed": small_journal[:third] + bytes(32) + small_journal[third + 32 :],
        "cut": small_journal[: third + 5],
        "unfinished": small_journal[:end],
    }[name]

    try:
        told = json.dumps(describe_match(data)["broken"])
    except JournalError as error:
        told = str(error)

    same(f"broken/{name}.txt", told + "\n")
