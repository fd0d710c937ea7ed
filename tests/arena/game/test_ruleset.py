"""Rulesets: what ships, what is refused and in which words, and what the hash holds."""

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from arena.errors import InputError, RulesetError, UnknownNameError
from arena.game.ruleset import MAX_UNITS, RULESETS, from_dict, load, parse_overrides, to_dict
from arena.game.types import Team

HASHES = {
    "paper": "c2947cfb85c8c2dbdc4789e7bf06d23fe95024bfe9da0a39c14eb0466d75c9e0",
    "gym-cap": "395d9522a90751880417282b3a4a3a100f0b3d5801d577c5e969e1d8edcfeda1",
    "exp1": "95ea41c6b9325200068de9714456790dbfcbe80612c53a851406bb3a8d8d25f3",
    "exp2": "3c79b81d729ee566a5613e2b237a8388dac859df6964b98bd65418e526258951",
    "exp3": "f86f90b842b13c9115e2d43140853128ba78dd99129ca6e02bbbd52661505cca",
    "exp4": "c2947cfb85c8c2dbdc4789e7bf06d23fe95024bfe9da0a39c14eb0466d75c9e0",
    "mirror": "dbbfe5ea80e33949b868fd68611ea3cff6ae0df70583b325705fa7f3746086f9",
}


@pytest.mark.parametrize("name", RULESETS)
def test_a_shipped_ruleset_keeps_its_hash(name: str) -> None:
    """A changed hash is a changed game: raise `RULES_VERSION`, say so in the changelog, and pin the new one."""
    assert load(name).hash == HASHES[name]


def test_the_hash_ignores_the_name() -> None:
    assert load("exp4").hash == load("paper").hash
    assert replace(load("paper"), name="other").hash == load("paper").hash


def test_the_hash_ignores_the_order_of_keys() -> None:
    values = to_dict(load("paper"))
    backwards = {key: values[key] for key in reversed(values)}

    assert from_dict("paper", backwards).hash == load("paper").hash


@pytest.mark.parametrize(
    "setting",
    [
        "side=18",
        "tick_limit=101",
        "fog=false",
        "random_combat=false",
        "attack_at_range=false",
        "self_counts=false",
        "obstacles=false",
        "mirror=true",
        "flag_in_back_third=true",
        "units.ugv.sight=5",
        "units.ugv.step=0",
        "units.ugv.attack=1",
        "units.ugv.strength=2",
        "units.ugv.blue=5",
        "units.ugv.red=5",
        "units.uav.flies=false",
        "units.tank={step=1,sight=1}",
    ],
)
def test_the_hash_notices_every_other_value(setting: str) -> None:
    overrides = parse_overrides([setting])
    if setting == "units.uav.flies=false":
        overrides["units"]["uav"]["step"] = 1

    assert load("paper").with_(overrides).hash != load("paper").hash


BOARD = """
F...
U..u
...a
...f
"""


def test_a_board_sets_side_and_teams_and_changes_the_hash() -> None:
    drawn = load("paper").with_({"board": BOARD})

    assert (drawn.side, [unit.name for unit in drawn.team(Team.RED)]) == (4, ["ugv", "uav"])
    assert drawn.hash != load("paper").with_({"board": BOARD.replace("F...", "F..#")}).hash
    assert from_dict("paper", to_dict(drawn)) == drawn


@pytest.mark.parametrize("name", RULESETS)
def test_a_ruleset_is_what_its_dict_says(name: str) -> None:
    assert from_dict(name, to_dict(load(name))) == load(name)


def test_the_paper_is_the_paper() -> None:
    paper = load("paper")

    assert (paper.side, paper.tick_limit, paper.fog, paper.random_combat) == (20, 100, True, True)
    assert [(unit.name, unit.step, unit.sight, unit.attack, unit.strength, unit.flies) for unit in paper.units] == [
        ("ugv", 1, 3, 2, 1, False),
        ("uav", 3, 4, 0, 0, True),
    ]
    assert [unit.name for unit in paper.team(Team.RED)] == ["ugv"] * 4 + ["uav"] * 2


def test_the_experiments_are_table_4() -> None:
    facts = [
        (load(f"exp{n}").fog, len(load(f"exp{n}").team(Team.BLUE)), len(load(f"exp{n}").team(Team.RED))) for n in (1, 2, 3, 4)
    ]

    assert facts == [(False, 4, 0), (False, 4, 4), (True, 4, 4), (True, 6, 6)]


def test_gym_cap_sees_farther_and_longer_and_hits_nearer() -> None:
    gym = load("gym-cap")

    assert [unit.sight for unit in gym.units] == [5, 7]
    assert (gym.tick_limit, gym.attack_at_range, gym.self_counts) == (150, False, False)


def test_walkers_come_before_fliers_however_the_file_orders_them() -> None:
    rules = from_dict("own", {"units": {"eye": {"step": 2, "sight": 5, "flies": True}, "foot": {"step": 1, "sight": 2}}})

    assert [unit.name for unit in rules.units] == ["foot", "eye"]


def test_a_file_says_only_what_differs_from_its_base(tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_text('base = "exp3"\nside = 8\n[units.ugv]\nsight = 6\n')

    rules = load(str(path))

    assert (rules.name, rules.side, rules.units[0].sight, rules.units[0].blue) == ("small", 8, 6, 4)
    assert len(rules.team(Team.RED)) == 4


def test_overrides_reach_into_a_unit_and_leave_the_rest() -> None:
    rules = load("paper").with_(parse_overrides(["side=16", "units.ugv.sight=5", "units.ugv.blue = 2"]))

    assert (rules.side, rules.units[0].sight, rules.units[0].blue, rules.units[0].red) == (16, 5, 2, 4)
    assert load("paper").side == 20


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"sidee": 20}, "unknown key in ruleset own 'sidee'; did you mean 'side'?"),
        ({"fogg": True}, "unknown key in ruleset own 'fogg'; did you mean 'fog'?"),
        ({"zzz": 1}, "unknown key in ruleset own 'zzz'; known: "),
        ({"name": "x"}, "unknown key in ruleset own 'name'"),
        ({"units": {"ugv": {"step": 1, "sigth": 3}}}, "unknown key of unit ugv in ruleset own 'sigth'; did you mean 'sight'?"),
        ({"base": "papr"}, "unknown base of ruleset own 'papr'; did you mean 'paper'?"),
        ({"base": 3}, "unknown base of ruleset own '3'"),
        ({"base": "own.toml"}, "unknown base of ruleset own 'own.toml'"),
        ({"base": "paper", "sidee": 2}, "did you mean 'side'?"),
        ({"side": 19}, "side is 19; it must be even"),
        ({"side": 2}, "side is 2; it must be a whole number from 4 to 64"),
        ({"side": 66}, "side is 66; it must be a whole number from 4 to 64"),
        ({"side": 20.0}, "side is 20.0; it must be a whole number"),
        ({"side": "20"}, "side is '20'; it must be a whole number"),
        ({"side": True}, "side is True; it must be a whole number"),
        ({"tick_limit": 0}, "tick_limit is 0; it must be a whole number from 1"),
        ({"fog": 1}, "fog is 1; it must be true or false"),
        ({"random_combat": "yes"}, "random_combat is 'yes'; it must be true or false"),
        ({"board": 7}, "board must be text"),
        ({"units": [1]}, "units must be tables"),
        ({"units": {"ugv": 4}}, "units.ugv must be a table"),
        ({"units": {"ugv": {"step": 1}}}, "unit ugv has no sight"),
        ({"units": {"ugv": {"step": 1, "sight": -1}}}, "units.ugv.sight is -1; it must be a whole number from 0"),
        ({"units": {"ugv": {"step": 1.5, "sight": 1}}}, "units.ugv.step is 1.5"),
        ({"units": {"ugv": {"step": 2, "sight": 1}}}, "units.ugv.step is 2; only a unit that flies"),
        ({"units": {"ugv": {"step": 1, "sight": 1, "flies": 0}}}, "units.ugv.flies is 0; it must be true or false"),
        ({"units": {"a": {"step": 1, "sight": 1, "blue": 9}, "b": {"step": 1, "sight": 1, "blue": 9}}}, "blue has 18 units; 16"),
        ({"mirror": True, "units": {"ugv": {"step": 1, "sight": 1, "blue": 2, "red": 1}}}, "mirror needs two equal teams"),
    ],
)
def test_a_bad_ruleset_is_refused_in_a_sentence_that_names_the_culprit(values: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError) as refusal:
        from_dict("own", values)

    assert sentence in str(refusal.value)
    assert refusal.value.exit_code == 2


def test_the_largest_team_is_playable() -> None:
    unit = {"step": 1, "sight": 1, "blue": MAX_UNITS, "red": MAX_UNITS}

    assert len(from_dict("own", {"units": {"ugv": unit}}).team(Team.RED)) == MAX_UNITS


def test_an_unknown_ruleset_names_the_nearest_known_one() -> None:
    with pytest.raises(UnknownNameError, match="unknown ruleset 'gymcap'; did you mean 'gym-cap'"):
        load("gymcap")


def test_a_file_that_is_not_there_or_not_toml_or_not_text_is_an_input_error(tmp_path: Path) -> None:
    broken, binary = tmp_path / "broken.toml", tmp_path / "binary.toml"
    broken.write_text("side = = 3")
    binary.write_bytes(b"\xff\xfe\x00")

    with pytest.raises(RulesetError, match="cannot read the ruleset"):
        load(str(tmp_path / "absent.toml"))
    with pytest.raises(RulesetError, match="the ruleset broken is not TOML"):
        load(str(broken))
    with pytest.raises(RulesetError, match="is not text in UTF-8"):
        load(str(binary))


@pytest.mark.parametrize("setting", ["side", "side=", "=3", "side=x16", "units.ugv.sight"])
def test_a_setting_that_cannot_be_read_is_shown_with_an_example(setting: str) -> None:
    with pytest.raises(RulesetError, match="write KEY=VALUE, as in side=16"):
        parse_overrides([setting])


def test_an_unknown_setting_names_the_nearest_key() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'tick_limit'"):
        load("paper").with_(parse_overrides(["ticklimit=3"]))


@pytest.mark.parametrize("name", RULESETS)
def test_a_shipped_file_opens_with_one_comment_that_says_what_it_is(name: str) -> None:
    import arena.game.ruleset

    path = Path(arena.game.ruleset.__file__).parent / "rulesets" / f"{name}.toml"
    first = path.read_text(encoding="utf-8").partition("\n")[0]

    assert first.startswith("# ")
    assert first.endswith(".")
    tomllib.loads(path.read_text(encoding="utf-8"))
