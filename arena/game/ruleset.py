"""A ruleset: everything about a game that can be chosen, read from TOML, never changed after.

The shipped rulesets are the files in `rulesets/`; `RULESETS` names them. A file may build on a shipped one with
`base = "paper"` and say only what differs.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from arena.errors import RulesetError, UnknownNameError
from arena.files import parse_toml, read_text
from arena.game.board import Board, parse_board
from arena.game.types import RULES_VERSION, Team

MIN_SIDE, MAX_SIDE = 4, 64
MAX_UNITS = 16
"""Units of one team, of all types together."""
_RANGES = {"step": (0, 8), "sight": (0, 100), "attack": (0, 100), "strength": (0, 1000), "blue": (0, 16), "red": (0, 16)}


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitType:
    """One row of the paper's Table 1. Distances are Euclidean, in cells."""

    name: str
    step: int
    """Cells that it goes in one tick; a type that does not fly goes at most one."""
    sight: int
    attack: int = 0
    strength: int = 1
    flies: bool = False
    """Passes over everything, cannot be hit, cannot capture."""
    blue: int = 0
    """How many the blue team has."""
    red: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ruleset:
    """The rules of a match. Two rulesets of one `hash` play alike."""

    name: str
    side: int = 20
    """Rows, and columns, of the board; even."""
    tick_limit: int = 100
    fog: bool = True
    """Off: both teams see the whole board."""
    random_combat: bool = True
    """Off: a unit on the enemy's half with an enemy in range falls, and no other."""
    attack_at_range: bool = True
    """A unit exactly as far away as the attack range can be hit."""
    self_counts: bool = True
    """A unit adds its own strength to its fight."""
    obstacles: bool = True
    mirror: bool = False
    """The red half is the blue half turned by 180 degrees, units and flag included."""
    flag_in_back_third: bool = False
    """Flags lie in the third of the half's columns that is farthest from the enemy."""
    board: str | None = None
    """A board drawn as text (`arena.game.board`); it sets side, teams and flags."""
    units: tuple[UnitType, ...] = field(default_factory=tuple)
    """Those that walk first, then those that fly, as the kernel wants them."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "units", tuple(sorted(self.units, key=lambda unit: unit.flies)))
        _check(self)
        if self.board is not None:
            board = parse_board(self.board)
            object.__setattr__(self, "side", board.side)
            object.__setattr__(self, "units", _manned(self, board))
        _check_teams(self)

    @property
    def hash(self) -> str:
        """SHA-256 (hex) of what decides the play: all but the name, and the version of the rules."""
        facts = asdict(self)
        del facts["name"]
        text = json.dumps([RULES_VERSION, facts], sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    def team(self, team: Team) -> tuple[UnitType, ...]:
        """Return the type of each unit of `team`, in the order of their indices."""
        counts = [(unit, unit.blue if team is Team.BLUE else unit.red) for unit in self.units]
        return tuple(unit for unit, n in counts for _ in range(n))

    def with_(self, overrides: Mapping[str, Any]) -> "Ruleset":
        """Return a copy with values replaced; `units` may name single values: {"units": {"ugv": {"sight": 5}}}."""
        return _build(self.name, _merge(to_dict(self), overrides))


def to_dict(ruleset: Ruleset) -> dict[str, Any]:
    """Return what a TOML file of this ruleset would hold, `name` apart."""
    facts = asdict(ruleset)
    del facts["name"]
    facts["units"] = {unit.pop("name"): unit for unit in facts["units"]}
    return {key: value for key, value in facts.items() if value is not None}


@lru_cache(maxsize=64)
def rules_values(ruleset: Ruleset) -> dict[str, Any]:
    """Return a ruleset and its name as headers, tickets and lobbies hold them; nobody may change it."""
    return {"name": ruleset.name, **to_dict(ruleset)}


def read_rules(values: Mapping[str, Any]) -> Ruleset:
    """Return the ruleset that `rules_values` wrote; `InputError` if it is none that this version knows."""
    rest = dict(values)
    return from_dict(str(rest.pop("name", "unnamed")), rest)


def from_dict(name: str, values: Mapping[str, Any]) -> Ruleset:
    """Return the ruleset that `to_dict` gave `values` for; an unknown key is an error that names the nearest."""
    base = values.get("base")
    if base is None:
        return _build(name, values)
    rest = {key: value for key, value in values.items() if key != "base"}
    if base not in RULESETS:  # another file could build on this one
        raise UnknownNameError(f"base of ruleset {name}", str(base), RULESETS)
    return _build(name, _merge(to_dict(_shipped(base)), rest))


RULESETS = ("paper", "gym-cap", "exp1", "exp2", "exp3", "exp4", "mirror")


def load(name_or_file: str) -> Ruleset:
    """Return a shipped ruleset by name, or one from a TOML file."""
    if name_or_file.endswith(".toml"):
        path = Path(name_or_file)
        try:
            text = read_text(path)
        except OSError as error:
            raise RulesetError(f"cannot read the ruleset {name_or_file}: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise RulesetError(
                f"the ruleset {name_or_file} is not text in UTF-8: {error.reason} at byte {error.start}"
            ) from error
        return _parse(path.stem, text)
    if name_or_file not in RULESETS:
        raise UnknownNameError("ruleset", name_or_file, RULESETS)
    return _shipped(name_or_file)


def parse_overrides(settings: Iterable[str]) -> dict[str, Any]:
    """Return the nested mapping that settings like "side=16" or "units.ugv.sight=5" spell, values in TOML."""
    merged: dict[str, Any] = {}
    for setting in settings:
        try:
            merged = _merge(merged, parse_toml(setting))
        except ValueError as error:
            raise RulesetError(f"cannot read the setting {setting!r} ({error}); write KEY=VALUE, as in side=16") from error
    return merged


@cache
def _shipped(name: str) -> Ruleset:
    return _parse(name, (files("arena.game") / "rulesets" / f"{name}.toml").read_text(encoding="utf-8"))


def _parse(name: str, text: str) -> Ruleset:
    try:
        values = parse_toml(text)
    except ValueError as error:
        raise RulesetError(f"the ruleset {name} is not TOML: {error}") from error
    return from_dict(name, values)


def _merge(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(old)
    for key, value in new.items():
        before = merged.get(key)
        merged[key] = _merge(before, value) if isinstance(before, Mapping) and isinstance(value, Mapping) else value
    return merged


def _build(name: str, values: Mapping[str, Any]) -> Ruleset:
    facts = dict(values)
    _known(f"key in ruleset {name}", facts, [f.name for f in fields(Ruleset) if f.name != "name"])
    rows = facts.pop("units", {})
    if not isinstance(rows, Mapping):
        raise RulesetError(f"ruleset {name}: units must be tables, as in [units.ugv]")
    units = []
    for unit, row in rows.items():
        if not isinstance(row, Mapping):
            raise RulesetError(f"ruleset {name}: units.{unit} must be a table, as in [units.ugv]")
        _known(f"key of unit {unit} in ruleset {name}", row, [f.name for f in fields(UnitType) if f.name != "name"])
        missing = {"step", "sight"} - set(row)
        if missing:
            raise RulesetError(f"ruleset {name}: unit {unit} has no {sorted(missing)[0]}")
        units.append(UnitType(name=str(unit), **row))
    return Ruleset(name=name, units=tuple(units), **facts)


def _known(kind: str, values: Mapping[str, Any], known: list[str]) -> None:
    for key in values:
        if key not in known:
            raise UnknownNameError(kind, key, known)


def _manned(rules: Ruleset, board: Board) -> tuple[UnitType, ...]:
    """Return the unit types with the counts that a board draws: of the first that walks, and of the first that flies."""
    units = [replace(unit, blue=0, red=0) for unit in rules.units]
    for places, flies in ((board.walkers, False), (board.flyers, True)):
        blue, red = len(places[Team.BLUE]), len(places[Team.RED])
        if not blue and not red:
            continue
        index = next((i for i, unit in enumerate(units) if unit.flies is flies), None)
        if index is None:
            raise RulesetError(
                f"ruleset {rules.name}: the board has units that {'fly' if flies else 'walk'}, and no unit type does"
            )
        units[index] = replace(units[index], blue=blue, red=red)
    return tuple(units)


def _check(rules: Ruleset) -> None:
    """Refuse values that no game can be played with."""

    def whole(what: str, value: object, low: int, high: int) -> None:
        if type(value) is not int or not low <= value <= high:
            raise RulesetError(f"ruleset {rules.name}: {what} is {value!r}; it must be a whole number from {low} to {high}")

    for item in fields(Ruleset):
        if item.type in (bool, "bool") and type(getattr(rules, item.name)) is not bool:
            raise RulesetError(f"ruleset {rules.name}: {item.name} is {getattr(rules, item.name)!r}; it must be true or false")
    if rules.board is not None and not isinstance(rules.board, str):
        raise RulesetError(f"ruleset {rules.name}: board must be text")
    whole("side", rules.side, MIN_SIDE, MAX_SIDE)
    if rules.side % 2:
        raise RulesetError(f"ruleset {rules.name}: side is {rules.side}; it must be even, so that the halves are equal")
    whole("tick_limit", rules.tick_limit, 1, 1_000_000)
    for unit in rules.units:
        for key, (low, high) in _RANGES.items():
            whole(f"units.{unit.name}.{key}", getattr(unit, key), low, high)
        if type(unit.flies) is not bool:
            raise RulesetError(f"ruleset {rules.name}: units.{unit.name}.flies is {unit.flies!r}; it must be true or false")
        if unit.step > 1 and not unit.flies:
            raise RulesetError(
                f"ruleset {rules.name}: units.{unit.name}.step is {unit.step}; only a unit that flies may go farther than 1"
            )


def _check_teams(rules: Ruleset) -> None:
    """Refuse teams that are too large, those that a board draws too, and unequal ones where one mirrors the other."""
    for team in Team:
        if len(rules.team(team)) > MAX_UNITS:
            raise RulesetError(
                f"ruleset {rules.name}: {team.name.lower()} has {len(rules.team(team))} units; {MAX_UNITS} is the most"
            )
    if rules.mirror and rules.board is None and rules.team(Team.BLUE) != rules.team(Team.RED):
        raise RulesetError(f"ruleset {rules.name}: mirror needs two equal teams")
