"""A league: who meets whom under which rules, read from TOML, never changed after.

The shipped leagues are the files in `leagues/`; `LEAGUES` names them.
"""

import json
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

from arena.errors import InputError, UnknownNameError
from arena.game.keys import KEY_BYTES
from arena.game.ruleset import RULESETS, Ruleset
from arena.game.ruleset import load as load_rules
from arena.protocol.topics import is_chunk
from arena.referee.match import Terms
from policies.program import PREFIX
from policies.registry import names
from tournaments.confine import NO_LIMITS, Limits

LEAGUES = ("starter",)
VENUES = ("network", "local")
PAIRINGS = ("round-robin", "gauntlet")
MAPS = ("paired", "fresh")
MOST_PAIRS = 1_000_000
_KEYS = (
    "name", "ruleset", "rules", "pairs", "pairing", "hero", "maps", "seed", "secret", "venue", "turn_time_s", "bank_s", "grace_s",
    "slots", "limits", "entries",
)  # fmt: skip


_TERMS = Terms()


class LeagueError(InputError):
    """A league holds a value that cannot be played."""


@dataclass(frozen=True, kw_only=True)
class League:
    """What a league's file says. `facts` is what decides its results."""

    name: str
    ruleset: Ruleset
    entries: Mapping[str, str]
    """The fighter, by name or by the full path of a bot file, behind each entry."""
    n_pairs: int = 10
    """Of each fixture; may be raised while results are stored."""
    hero: str | None = None
    """Who meets all the others in a gauntlet; None in a round robin."""
    maps: str = "paired"
    """`paired`: both matches of a pair on one map; `fresh`: no map twice, for entries that remember."""
    seed: int | None = None
    secret: bytes | None = None
    """None, without a seed: made at the first run, and kept beside the results."""
    venue: str = "network"
    terms: Terms = _TERMS
    slots: int = 8
    """Seats that the process of an entry holds at once."""
    limits: Limits = NO_LIMITS
    """For each process of an entry, in the venue `network`."""

    @cached_property
    def facts(self) -> dict[str, Any]:
        """What decides the results, but for the secret and the number of pairs; an edit is found by comparing these."""
        terms = self.terms
        return {
            "ruleset": self.ruleset.name,
            "rules": self.ruleset.hash,
            "entries": {name: _fingerprint(spec) for name, spec in sorted(self.entries.items())},
            "clock": {"turn_time_s": terms.turn_time_s, "bank_s": terms.bank_s, "grace_s": terms.grace_s},
            **({"maps": self.maps} if self.maps != League.maps else {}),
            **({"hero": self.hero} if self.hero is not None else {}),
        }


def _fingerprint(spec: str) -> str:
    """Return what tells one fighter from another: its name, or its file's name and content."""
    if not spec.endswith(".py"):
        return spec
    path = Path(spec)
    try:
        return f"{path.name} {sha256(path.read_bytes()).hexdigest()}"
    except OSError as error:
        raise LeagueError(f"cannot read the bot file {spec}: {error.strerror}") from error


def load_league(name_or_file: str) -> League:
    """Return a shipped league by name, or one from a TOML file.

    Raises
    ------
    InputError
        The file cannot be read or says something that cannot be played; the sentence names it.
    """
    if not name_or_file.endswith(".toml"):
        if name_or_file not in LEAGUES:
            raise UnknownNameError("league (or name a file that ends in .toml)", name_or_file, LEAGUES)
        text = (files("tournaments") / "leagues" / f"{name_or_file}.toml").read_text(encoding="utf-8")
        return parse_league(text, name_or_file, Path())
    path = Path(name_or_file)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise LeagueError(f"cannot read the league {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise LeagueError(f"the league {path} is not text in UTF-8: {error.reason} at byte {error.start}") from error
    return parse_league(text, path.stem, path.parent)


def parse_league(text: str, name: str, folder: Path) -> League:
    """Return the league that a file's text describes.

    Parameters
    ----------
    name
        What it is called unless the text says so.
    folder
        Where the paths in the text start.
    """
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise LeagueError(f"the league {name} is not TOML: {error}") from error
    for key in values:
        if key not in _KEYS:
            raise UnknownNameError(f"key in league {name}", key, _KEYS)
    return _Reader(values.pop("name", name), values).read(folder)


class _Reader:
    """Takes a league's values one by one; what is wrong is said with the league's name in front."""

    def __init__(self, name: object, values: dict[str, Any]) -> None:
        if not isinstance(name, str) or not is_chunk(name):
            raise LeagueError(f"the league's name is {name!r}; it must be 1 to 64 letters, digits, - or _")
        self._name, self._values = name, values

    def read(self, folder: Path) -> League:
        seed = self._whole("seed", None, 0, 2**63 - 1)
        secret = self._secret()
        if seed is not None and secret is not None:
            raise self._error("has both a seed and a secret; keep one")
        terms = Terms(
            turn_time_s=self._seconds("turn_time_s", _TERMS.turn_time_s or 0.0) or None,
            bank_s=self._seconds("bank_s", _TERMS.bank_s),
            grace_s=self._seconds("grace_s", _TERMS.grace_s),
        )
        entries = self._entries(folder)
        return League(
            name=self._name,
            ruleset=self._ruleset(folder),
            entries=entries,
            hero=self._hero(entries),
            maps=self._maps(entries),
            n_pairs=self._whole("pairs", League.n_pairs, 1, MOST_PAIRS) or 1,
            seed=seed,
            secret=secret,
            venue=self._one_of("venue", VENUES),
            terms=terms,
            slots=self._whole("slots", League.slots, 1, 256) or 1,
            limits=self._limits(),
        )

    def _error(self, what: str) -> LeagueError:
        return LeagueError(f"league {self._name} {what}")

    def _whole(self, key: str, default: int | None, low: int, high: int) -> int | None:
        value = self._values.get(key, default)
        if value is not None and (type(value) is not int or not low <= value <= high):
            raise self._error(f"says {key} = {_toml(value)}; it must be a whole number from {low} to {high}")
        return value

    def _seconds(self, key: str, default: float) -> float:
        value = self._values.get(key, default)
        if value is False:
            return 0.0
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1e6:
            raise self._error(f"says {key} = {_toml(value)}; it must be a number of seconds, and 0 or false is none")
        return float(value)

    def _limits(self) -> Limits:
        given, known = self._values.get("limits", {}), [field.name for field in fields(Limits)]
        if not isinstance(given, Mapping):
            raise self._error(f"says limits = {_toml(given)}; write them below [limits]: {', '.join(known)}")
        for name, value in given.items():
            if name not in known:
                raise UnknownNameError(f"limit of league {self._name}", name, known)
            if type(value) is not int or value < 1:
                raise self._error(f"says {name} = {_toml(value)} in its limits; it must be a whole number above 0")
        return Limits(**given)

    def _one_of(self, key: str, known: tuple[str, ...]) -> str:
        value = self._values.get(key, known[0])
        if value not in known:
            raise UnknownNameError(f"{key} of league {self._name}", str(value), known)
        return str(value)

    def _hero(self, entries: Mapping[str, str]) -> str | None:
        hero, pairing = self._values.get("hero"), self._one_of("pairing", PAIRINGS)
        if (hero is None) != (pairing == "round-robin"):
            raise self._error(
                'has a hero in a gauntlet, and only there; write pairing = "gauntlet" and hero = "NAME", or neither'
            )
        if hero is not None and hero not in entries:
            raise UnknownNameError(f"hero of league {self._name}", str(hero), entries)
        return None if hero is None else str(hero)

    def _maps(self, entries: Mapping[str, str]) -> str:
        maps = self._one_of("maps", MAPS)
        programs = [name for name, spec in entries.items() if spec.startswith(PREFIX)]
        if maps == "paired" and programs:
            raise self._error(
                f'lets {programs[0]} play both matches of a pair on one map, and a program may remember it; write maps = "fresh"'
            )
        return maps

    def _secret(self) -> bytes | None:
        value = self._values.get("secret")
        if value is None:
            return None
        try:
            secret = bytes.fromhex(value)
        except (ValueError, TypeError):
            secret = b""
        if len(secret) != KEY_BYTES:
            raise self._error(f"has a secret that is not {2 * KEY_BYTES} hexadecimal digits; leave it out, and one is made")
        return secret

    def _ruleset(self, folder: Path) -> Ruleset:
        name, overrides = self._values.get("ruleset", "paper"), self._values.get("rules", {})
        if not isinstance(name, str):
            raise self._error(f"says ruleset = {_toml(name)}; it must be a name or a file that ends in .toml, in quotes")
        if not isinstance(overrides, Mapping):
            raise self._error(
                f'says rules = {_toml(overrides)}; name a ruleset by ruleset = "paper", and changes to it in [rules]'
            )
        return load_rules(str(folder / name) if name.endswith(".toml") else name).with_(overrides)

    def _entries(self, folder: Path) -> dict[str, str]:
        given = self._values.get("entries")
        if isinstance(given, Mapping):
            pairs = list(given.items())
        elif isinstance(given, list):
            pairs = [(Path(spec).stem if str(spec).endswith(".py") else str(spec), spec) for spec in given]
        else:
            raise self._error('has no entries; name them, as in: entries = ["rush", "mybot.py"]')
        entries: dict[str, str] = {}
        known = names()
        for name, spec in pairs:
            if not isinstance(spec, str):
                raise self._error(
                    f"says {name} = {_toml(spec)}; an entry is a policy's name, a bot file or exec:COMMAND, in quotes"
                )
            if not is_chunk(name):
                raise self._error(f"has an entry {name!r}; a name must be 1 to 64 letters, digits, - or _")
            if name in entries:
                raise self._error(f"has two entries named {name!r}; name them apart, as in: [entries] {name}-2 = {_toml(spec)}")
            entries[name] = self._fighter(spec, folder, known)
        if len(entries) < 2:
            raise self._error(f"has {len(entries)} {'entry' if entries else 'entries'}; it takes two to fight")
        return entries

    def _fighter(self, spec: str, folder: Path, known: Iterable[str]) -> str:
        if spec.endswith(".py"):
            path = (folder / spec).absolute()
            if not path.is_file():
                raise self._error(f"names the bot file {spec}, and there is no {path}")
            return str(path)
        if spec not in known and not spec.startswith(PREFIX):
            raise UnknownNameError(f"policy in league {self._name}", spec, known)
        return spec


def _toml(value: object) -> str:
    return json.dumps(value, default=str)


TEMPLATE = f"""\
# A league: arena tournament run THIS.toml
# Stopped at any moment, it goes on where it was when it is run again. Pairs may be raised later; rules, entries, secret and
# clock may not be edited once results are stored: give the league another name instead.

# name = "friday"         # the file's own name without it; letters, digits, - and _

ruleset = "paper"         # {", ".join(RULESETS)}, or a file
pairs = {League.n_pairs}                # of each fixture; a pair is two matches, sides swapped
pairing = "round-robin"   # or "gauntlet", with hero = "NAME": one against all others
maps = "paired"           # or "fresh": no map twice, for programs and others who remember from match to match
venue = "network"         # every entry and the referee a process of its own; "local": all in one process, no clock

# seed = 1                # makes the league reproducible, and guessable by anyone; without it, a secret is made and kept

turn_time_s = {_TERMS.turn_time_s}         # for each turn; 0 runs no clock
bank_s = {_TERMS.bank_s}             # extra time of a seat, for a whole match
grace_s = {_TERMS.grace_s}            # how long a seat may be away in a match
slots = {League.slots}                 # matches that an entry plays at once

# [rules]                 # what differs from the ruleset, as `arena rules paper` shows it
# tick_limit = 150
# [rules.units.ugv]
# sight = 5

# [limits]                # of each process of an entry, for fighters that others wrote; "network" only
# memory_mb = 6000
# cpu_s = 3600

[entries]                 # a name, and a policy of `arena policies`, a bot file beside this one, or a program
rush = "rush"
patrol = "patrol"
# mine = "mybot.py"
# other = "exec:java -jar other.jar"
"""
"""What `arena tournament init` writes."""
