"""A league's file: what it may say, and in which sentence it is refused."""

import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest

from arena.errors import InputError, UnknownNameError
from arena.game.keys import secret_from_seed
from arena.protocol.identity import to_text
from arena.protocol.topics import is_chunk
from arena.records.plan import LeagueMatchId
from arena.sandbox.limits import BEHIND_A_WALL
from tournaments.league.edits import find_edit, hash_definition, is_edited
from tournaments.league.file import LEAGUES, load_league, parse_league
from tournaments.league.league import League
from tournaments.league.schedule import count_matches, plan_league
from tournaments.league.secret import find_secret
from tournaments.league.template import TEMPLATE

TWO = 'entries = ["rush", "patrol"]\n'
BOT = "def act(observation):\n    return [0] * len(observation.units)\n"


def parse(text: str, folder: Path = Path()) -> League:
    return parse_league(text, "friday", folder)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("entris = 1", "did you mean 'entries'"),
        ('entries = ["rush", "patroll"]', "did you mean 'patrol'"),
        ('entries = ["rush", "gone.py"]', "names the bot file gone.py, and there is no"),
        ('entries = ["rush", "rush"]', "two entries named 'rush'"),
        ('[entries]\na = "rush"\na = "patrol"', "not TOML"),
        ('entries = ["rush"]', "it takes two"),
        ("", "has no entries"),
        ('entries = ["rush", 7]', "in quotes"),
        ('[entries]\n"a/b" = "rush"\nc = "rush"', "'a/b'"),
        ('name = "a b"\n' + TWO, "'a b'"),
        ("pairs = 0\n" + TWO, "pairs = 0"),
        ("pairs = true\n" + TWO, "whole number"),
        ("seed = -1\n" + TWO, "seed = -1"),
        ('secret = "ab"\n' + TWO, "64 hexadecimal digits"),
        (f'seed = 1\nsecret = "{"ab" * 32}"\n{TWO}', "both a seed and a secret"),
        (f'name = "{"n" * 64}"\n[entries]\n{"a" * 50} = "rush"\nb = "rush"', "an entry's may have 49 letters"),
        ('venue = "netwrk"\n' + TWO, "did you mean 'network'"),
        ("turn_time_s = true\n" + TWO, "turn_time_s"),
        ("turn_time_s = nan\n" + TWO, "number of seconds"),
        ('ruleset = "papr"\n' + TWO, "did you mean 'paper'"),
        ('rules = "paper"\n' + TWO, "changes to it in [rules]"),
        (TWO + "[rules]\nsid = 16", "did you mean 'side'"),
    ],
)
def test_what_cannot_be_played_is_refused_in_one_sentence(text: str, says: str) -> None:
    with pytest.raises(InputError) as refused:
        parse(text)

    assert says in str(refused.value)
    assert "\n" not in str(refused.value).replace("\\n", "")
    assert refused.value.exit_code == 2


def test_an_unknown_league_names_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'starter'"):
        load_league("startr")


@pytest.mark.parametrize("name", LEAGUES)
def test_a_shipped_league_can_be_played(name: str) -> None:
    assert len(load_league(name).entries) >= 2


def test_the_template_is_a_league_and_says_the_defaults() -> None:
    written = parse(TEMPLATE)
    plain = parse(TWO)

    assert replace(written, entries={}) == replace(plain, entries={})


def test_paths_start_at_the_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(BOT)
    (tmp_path / "league.toml").write_text(
        'turn_time_s = false\n[entries]\nmine = "mine.py"\nrush = "rush"\n[rules]\ntick_limit = 7'
    )

    league = load_league(str(tmp_path / "league.toml"))

    assert league.entries == {"mine": str(tmp_path / "mine.py"), "rush": "rush"}
    assert league.name == "league"
    assert league.ruleset.tick_limit == 7
    assert league.time_control.turn_time_s is None


def test_an_edit_is_named(tmp_path: Path) -> None:
    bot = tmp_path / "mine.py"
    bot.write_text(BOT)
    text = 'entries = ["mine.py", "rush"]\n'
    before = parse(text, tmp_path).definition

    assert find_edit(before, parse('pairs = 99\nslots = 1\nentries = ["rush", "mine.py"]', tmp_path).definition) is None
    assert "rules" in str(find_edit(before, parse(text + "[rules]\nside = 16", tmp_path).definition))
    assert find_edit(before, parse('entries = ["patrol", "spiral"]', tmp_path).definition) is None
    assert "turn_time_s" in str(find_edit(before, parse("turn_time_s = 2\n" + text, tmp_path).definition))
    assert "seed or secret" in str(find_edit({**before, "secret": "a"}, {**before, "secret": "b"}))
    bot.write_text(BOT + "\n")
    edited = parse(text, tmp_path).definition
    assert find_edit(before, edited) is None
    assert hash_definition(edited) != hash_definition(before)


def test_a_secret_is_made_once_and_read_by_its_owner_alone(tmp_path: Path) -> None:
    league = parse(TWO)

    secret = find_secret(league, tmp_path / "keys", may_make=True)

    [file] = (tmp_path / "keys").iterdir()
    assert file.stat().st_mode & 0o777 == 0o600
    assert find_secret(league, tmp_path / "keys", may_make=False) == secret
    assert find_secret(league, tmp_path / "other", may_make=True) != secret


def test_a_secret_that_is_gone_is_not_made_anew(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the secret that they follow from"):
        find_secret(parse(TWO), tmp_path, may_make=False)


def test_a_schedule_plays_every_pair_twice_on_one_map_with_sides_swapped() -> None:
    league = parse('pairs = 3\nentries = ["rush", "patrol", "random", "spiral"]')
    plans = plan_league(league, secret_from_seed(1))

    pairs: dict[str, list[object]] = {}
    for plan in plans:
        pairs.setdefault(LeagueMatchId.parse(plan.identity).pair_id, []).append(plan)
    assert len(plans) == len({plan.identity for plan in plans}) == count_matches(4, 3)
    assert len({plan.keys.match_key for plan in plans}) == len(plans)
    assert len(pairs) == 3 * len(list(combinations(league.entries, 2)))
    assert len({plan.keys.map_key for plan in plans}) == len(pairs)
    for first, second in pairs.values():
        assert (first.blue, first.red) == (second.red, second.blue)
        assert first.keys.map_key == second.keys.map_key
    assert all(is_chunk(chunk) for plan in plans for chunk in plan.identity.split("/"))


def test_half_a_schedule_is_balanced_and_more_pairs_keep_what_was_planned() -> None:
    league = parse('pairs = 2\nentries = ["rush", "patrol", "random"]')
    plans = plan_league(league, secret_from_seed(1))
    half = plans[: len(plans) // 2]

    assert {frozenset((plan.blue, plan.red)) for plan in half} == set(map(frozenset, combinations(league.entries, 2)))
    assert plan_league(replace(league, n_pairs=1), secret_from_seed(1)) == half
    assert plan_league(replace(league, entries=dict(reversed(league.entries.items()))), secret_from_seed(1)) == plans


GAUNTLET = 'pairing = "gauntlet"\nchallenger = "rush"\nentries = ["rush", "patrol", "defend", "random"]\npairs = 3'


def test_in_a_gauntlet_one_meets_all_the_others() -> None:
    league = parse_league(GAUNTLET, "g", Path())
    plans = plan_league(league, bytes(32))

    assert {frozenset((plan.blue, plan.red)) for plan in plans} == {
        frozenset(("rush", other)) for other in ("patrol", "defend", "random")
    }
    assert len(plans) == count_matches(4, 3, is_gauntlet=True) == 18


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('pairing = "gauntlet"\nentries = ["rush", "patrol"]', "has a challenger in a gauntlet or an sprt, and only there"),
        ('challenger = "rush"\nentries = ["rush", "patrol"]', "has a challenger in a gauntlet or an sprt, and only there"),
        ('pairing = "gauntlet"\nhero = "rush"\nentries = ["rush", "patrol"]', 'hero = "rush"; the key is called challenger now'),
        ('pairing = "gauntlet"\nchallenger = "rsh"\nentries = ["rush", "patrol"]', "did you mean 'rush'"),
        (
            'pairing = "gauntlet"\nchallenger = ["rush"]\nentries = ["rush", "patrol"]',
            "unknown challenger of league g \"['rush']\"",
        ),
        ('trusted = [["rush"]]\nentries = ["rush", "patrol"]', "unknown entry that league g trusts \"['rush']\""),
        ('pairing = "knockout"\nentries = ["rush", "patrol"]', "unknown pairing of league g 'knockout'"),
        ('maps = "old"\nentries = ["rush", "patrol"]', "unknown maps of league g 'old'"),
        (
            'sandbox = "none"\n[entries]\nrush = "rush"\nmine = "exec:./bot"',
            'a program without a wall may remember it; write maps = "fresh"',
        ),
    ],
)
def test_a_pairing_or_maps_that_cannot_be_is_said_in_one_sentence(text: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        parse_league(text, "g", Path())

    assert says in str(error.value)


KEY, OTHER_KEY = (to_text(bytes([number]) * 32) for number in (1, 2))
FRESH = 'maps = "fresh"\n[entries]\nrush = "rush"\n'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (FRESH + 'far = "key:abc"', "league g names an entry by its key, and 'abc' is no public key"),
        (f'[entries]\nrush = "rush"\nfar = "key:{KEY}"', 'who joins by itself may remember it; write maps = "fresh"'),
        (f'venue = "local"\n{FRESH}far = "key:{KEY}"', "names far by its key, and who joins by itself can only come to venue"),
        (f'{FRESH}far = "key:{KEY}"\nnear = "key:{KEY}"', "names far and near by one key"),
        (f'pairing = "sprt"\n{FRESH}far = "key:{KEY}"', "tests far in batches of matches"),
        ('listen = "7447"\n' + TWO, 'listen = "7447"; it must be an endpoint such as tcp/0.0.0.0:7447'),
        ("listen = 7447\n" + TWO, "it must be an endpoint"),
        ('entries = ["rush", "gone.safetensors"]', "names the checkpoint gone.safetensors, and there is no"),
        ('pairing = "sprt"\nentries = ["rush", "patrol", "random"]', "one of two entries is better, and has 3"),
        (TWO + "[sprt]\nelo0 = 0", 'plays none; write pairing = "sprt"'),
        ('pairing = "sprt"\nsprt = 5\n' + TWO, "says sprt = 5; write its bounds below [sprt]"),
        ('pairing = "sprt"\n' + TWO + "[sprt]\nelo = 5", "did you mean 'elo1'"),
        ('pairing = "sprt"\n' + TWO + "[sprt]\nelo1 = nan", "says elo1 = NaN in its test"),
        ('pairing = "sprt"\n' + TWO + "[sprt]\nalpha = true", "says alpha = true in its test"),
        ('pairing = "sprt"\n' + TWO + "[sprt]\nelo0 = 60", "elo0 must be the lower one"),
        ('pairing = "sprt"\n' + TWO + "[sprt]\nbeta = 0.7", "it must be above 0 and below 0.5"),
    ],
)
def test_an_entry_from_elsewhere_or_a_test_that_cannot_be_is_said_in_one_sentence(text: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        parse_league(text, "g", Path())

    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_an_entry_may_be_a_public_key() -> None:
    league = parse_league(f'{FRESH}far = "key:{KEY}"\nother = "key:{OTHER_KEY}"', "g", Path())

    assert {name: to_text(key) for name, key in league.remote.items()} == {"far": KEY, "other": OTHER_KEY}
    with pytest.raises(InputError, match="names far by its key"):
        league.check_venue("local")


def test_an_entry_may_come_with_settings(tmp_path: Path) -> None:
    (tmp_path / "best.safetensors").write_bytes(b"one")
    given = {"plain": "best.safetensors", "mirrored": "best.safetensors:mirror=true", "greedy": "champion:temperature=0"}
    league = parse("[entries]\n" + "\n".join(f'{name} = "{spec}"' for name, spec in given.items()), tmp_path)
    written = league.definition["entries"]

    assert league.entries["mirrored"] == f"{tmp_path / 'best.safetensors'}:mirror=true"
    assert set(league.sandboxes) == {"plain", "mirrored"}
    assert len({*written.values()}) == 3
    with pytest.raises(InputError, match=r"names the checkpoint gone\.safetensors, and there is no"):
        parse('[entries]\na = "gone.safetensors:mirror=true"\nb = "rush"', tmp_path)


def test_a_checkpoint_is_an_entry_as_a_bot_file_is(tmp_path: Path) -> None:
    file = tmp_path / "best.safetensors"
    file.write_bytes(b"one")
    league = parse('entries = ["best.safetensors", "rush"]', tmp_path)
    before = league.definition
    file.write_bytes(b"two")
    after = parse('entries = ["best.safetensors", "rush"]', tmp_path).definition

    assert league.entries == {"best": str(file), "rush": "rush"}
    assert before["entries"]["best"].startswith("best.safetensors ")
    assert is_edited(before, after)


def test_the_first_of_two_is_tested_unless_a_challenger_is_named() -> None:
    first = parse('pairing = "sprt"\nentries = ["rush", "patrol"]')
    bounds = "[sprt]\nelo0 = -5\nelo1 = 5\nalpha = 0.01"
    named = parse(f'pairing = "sprt"\nchallenger = "patrol"\nentries = ["rush", "patrol"]\n{bounds}')

    assert (first.challenger, named.challenger) == ("rush", "patrol")
    assert first.definition["sprt"] == {"elo0": 0.0, "elo1": 50.0, "alpha": 0.05, "beta": 0.05}
    assert named.definition["sprt"] == {"elo0": -5.0, "elo1": 5.0, "alpha": 0.01, "beta": 0.05}
    assert find_edit(first.definition, parse('pairing = "sprt"\npairs = 99\nentries = ["rush", "patrol"]').definition) is None


@pytest.mark.parametrize(
    ("edited", "named"),
    [
        ('pairing = "sprt"\nentries = ["patrol", "rush"]', "challenger was edited (was rush, is patrol)"),
        ('pairing = "sprt"\nentries = ["rush", "patrol"]\n[sprt]\nelo1 = 60', "elo1 of its test was edited (was 50, is 60)"),
        (TWO, "its pairing was edited (was sprt, is another)"),
    ],
)
def test_an_edited_test_is_named(edited: str, named: str) -> None:
    before = parse('pairing = "sprt"\nentries = ["rush", "patrol"]').definition

    assert find_edit(before, parse(edited).definition) == named


def test_where_maps_are_fresh_no_map_comes_twice_and_matches_keep_their_keys() -> None:
    text = 'entries = ["rush", "patrol"]\npairs = 20'
    fresh, paired = (plan_league(parse_league(text + extra, "g", Path()), bytes(32)) for extra in ('\nmaps = "fresh"', ""))

    assert len({plan.keys.map_key for plan in fresh}) == 40
    assert len({plan.keys.map_key for plan in paired}) == 20
    assert [plan.keys.match_key for plan in fresh] == [plan.keys.match_key for plan in paired]


def test_an_edit_of_maps_or_challenger_is_named() -> None:
    facts = [
        parse_league(text + 'entries = ["rush", "patrol"]', "g", Path()).definition
        for text in ("", 'maps = "fresh"\n', 'pairing = "gauntlet"\nchallenger = "rush"\n')
    ]

    assert find_edit(facts[0], facts[1]) == "maps was edited (was paired, is fresh)"
    assert find_edit(facts[0], facts[2]) == "challenger was edited (was None, is rush)"
    assert find_edit(facts[0], facts[0]) is None


SEASON = "[season]\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (SEASON + "deadlin = 1", "did you mean 'deadline'"),
        (SEASON + 'deadline = "tomorrow"', "write a time such as"),
        (SEASON + "final_pairs = -1", "from 0 to 1000"),
        (SEASON + 'submissions = "7448"', "an endpoint such as tcp/0.0.0.0:7448"),
        (SEASON + 'invites = "gone.txt"', "a file with a code on each line"),
        ("pairs = 3\n" + SEASON, "chooses its pairs itself"),
        ("season = 3", "write its terms below [season]"),
        (f'{SEASON}page = "https://[here"', 'page = "https://[here"; it must be an address such as'),
        (f'name = "{"s" * 60}"\n[season]\n[entries]\n{"a" * 60} = "rush"', "an entry's may have 51 letters"),
    ],
)
def test_a_season_that_cannot_be_is_said_in_one_sentence(text: str, says: str) -> None:
    with pytest.raises(InputError, match=re.escape(says)):
        parse(text)


def test_a_season_has_terms_and_may_begin_without_entries(tmp_path: Path) -> None:
    (tmp_path / "codes").write_text("a\nb\n")
    season = parse(SEASON + 'deadline = 2027-01-31T18:00:00Z\nfreeze = 2027-01-30T18:00:00Z\ninvites = "codes"', tmp_path)
    terms = season.season

    assert terms is not None
    assert (season.entries, season.definition["season"], terms.invites) == ({}, True, tmp_path / "codes")
    assert [terms.is_open(at_s) for at_s in (0.0, 1_801_418_399.0, 1_801_418_400.0)] == [True, True, False]
    assert [terms.is_frozen(at_s) for at_s in (0.0, 1_801_332_000.0)] == [False, True]


STRANGERS = 'entries = ["rush", "mine.py"]\n'


@pytest.mark.parametrize("venue", ["local", "ray"])
def test_a_file_that_nobody_trusts_is_refused_where_nothing_stands_between_it_and_the_board(venue: str, tmp_path: Path) -> None:
    (tmp_path / "mine.py").touch()

    with pytest.raises(
        InputError,
        match=rf'plays mine without walls in venue = "{venue}", .* write trusted = \["mine"\], else leave out sandbox = "none"$',
    ):
        parse(f'venue = "{venue}"\nsandbox = "none"\n{STRANGERS}', tmp_path)

    assert parse(f'venue = "{venue}"\ntrusted = ["mine"]\n{STRANGERS}', tmp_path).trusted == {"mine"}
    assert parse(f'venue = "{venue}"\n{STRANGERS}', tmp_path).sandboxes["mine"].has_wall


@pytest.mark.parametrize(
    ("text", "walled"),
    [
        ("", {"mine", "other"}),
        ('trusted = ["mine"]', {"other"}),
        ('maps = "fresh"\nsandbox = "none"', set()),
        ("slots = 3", {"mine", "other"}),
    ],
)
def test_walls_stand_round_files_and_programs_unless_the_league_says_otherwise(
    text: str, walled: set[str], tmp_path: Path
) -> None:
    (tmp_path / "mine.py").touch()
    entries = '[entries]\nrush = "rush"\nmine = "mine.py"\nother = "exec:other"\n[limits]\nfiles = 9'

    sandboxes = parse(f"{text}\n{entries}", tmp_path).sandboxes

    assert set(sandboxes) == {"mine", "other"}
    assert {name for name, sandbox in sandboxes.items() if sandbox.has_wall} == walled
    assert {sandbox.limits.files for sandbox in sandboxes.values()} == {9}
    assert {sandbox.limits.memory_mb for sandbox in sandboxes.values() if sandbox.has_wall} <= {BEHIND_A_WALL.memory_mb}


def test_paths_in_the_command_line_of_a_program_begin_at_the_leagues_folder(tmp_path: Path) -> None:
    (tmp_path / "bots").mkdir()
    script = tmp_path / "bots" / "fast.js"
    script.touch()
    text = 'maps = "fresh"\nentries = ["rush", "exec:node bots/fast.js --level bots", "exec:./bots/slow bots/none"]'

    league = parse(text, tmp_path)

    assert league.entries["fast"] == f"exec:node {script} --level bots"
    assert league.entries["slow"] == f"exec:{tmp_path}/bots/slow bots/none"


def test_a_league_with_a_program_is_the_same_wherever_its_folder_lies(tmp_path: Path) -> None:
    leagues = []
    for folder in (tmp_path / "here", tmp_path / "there"):
        folder.mkdir()
        (folder / "fast.js").touch()
        leagues.append(parse('entries = ["rush", "exec:node fast.js"]', folder))

    here, there = leagues
    assert here.entries != there.entries
    assert not is_edited(here.definition, there.definition)
    assert here.definition["entries"]["fast"].startswith("exec:node fast.js ")
