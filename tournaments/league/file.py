"""Read a league from TOML; whatever cannot be played is refused in one sentence.

The shipped leagues are the files in `leagues/`; `LEAGUES` names them.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import fields
from importlib.resources import files
from pathlib import Path
from typing import Any

from arena.errors import InputError, UnknownNameError
from arena.files import parse_toml, read_text
from arena.game.keys import KEY_BYTES
from arena.game.ruleset import Ruleset
from arena.game.ruleset import load as load_rules
from arena.match.time_control import MOST_S, TimeControl
from arena.protocol.topics import is_chunk
from arena.sandbox.limits import MOST, Limits
from policies.program import PREFIX as PROGRAM
from policies.registry import names, split_settings, without_settings
from tournaments.league.entries import find_program, kind_of_file, name_of, public_key_of
from tournaments.league.league import BOUNDS, DEFAULT_TERMS, MAPS, PAIRINGS, VENUES, League, LeagueError
from tournaments.league.season import SeasonTerms, most_name_letters, parse_terms
from tournaments.ratings.sprt import Sprt

LEAGUES = ("starter", "fighters", "fighters-gym-cap")
MOST_PAIRS = 1_000_000
SANDBOXES = ("bubblewrap", "none")
_KEYS = (
    "name", "ruleset", "rules", "pairs", "pairing", "challenger", "sprt", "maps", "seed", "secret", "venue", "listen",
    "turn_time_s", "bank_s", "grace_s", "slots", "sandbox", "trusted", "limits", "entries", "season",
)  # fmt: skip
_BOUNDS = {"elo0": 0.0, "elo1": 50.0}
_MOST_ELO = 2_000.0


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
        text = read_text(path)
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
        values = parse_toml(text)
    except ValueError as error:
        raise LeagueError(f"the league {name} is not TOML: {error}") from error
    if "hero" in values:
        raise LeagueError(f"league {name} says hero = {_toml(values['hero'])}; the key is called challenger now")
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
        time_control = TimeControl(
            turn_time_s=self._seconds("turn_time_s", DEFAULT_TERMS.turn_time_s or 0.0) or None,
            bank_s=self._seconds("bank_s", DEFAULT_TERMS.bank_s),
            grace_s=self._seconds("grace_s", DEFAULT_TERMS.grace_s),
        )
        season = self._season(folder)
        given = self._given()
        entries = self._entries(given, folder, least=0 if season is not None else 2)
        longest = max(entries, key=len, default="")
        if len(longest) > (most := most_name_letters(self._name)):
            raise self._error(
                f"has an entry {longest}; under a league's name as long as this, an entry's may have {most} letters"
            )
        league = League(
            name=self._name,
            ruleset=self._ruleset(folder),
            entries=entries,
            commands={name: spec for name, spec in given if name in entries and spec.startswith(PROGRAM)},
            challenger=self._challenger(entries),
            sprt=self._sprt(entries),
            maps=self._one_of("maps", MAPS),
            n_pairs=self._whole("pairs", League.n_pairs, 1, MOST_PAIRS) or 1,
            seed=seed,
            secret=secret,
            venue=self._one_of("venue", VENUES),
            listen=self._listen(),
            time_control=time_control,
            slots=self._whole("slots", League.slots, 1, 256),
            has_walls=self._one_of("sandbox", SANDBOXES) != "none",
            trusted=self._trusted(entries),
            season=season,
            limits=self._limits(),
        )
        self._check_strangers(league)
        return league

    def _season(self, folder: Path) -> SeasonTerms | None:
        if "season" not in self._values:
            return None
        for key in ("pairs", "pairing", "challenger", "sprt"):
            if key in self._values:
                raise self._error(f"says {key}, and a season chooses its pairs itself; take it out")
        self._values.setdefault("entries", {})
        try:
            return parse_terms(self._values["season"], folder)
        except UnknownNameError:
            raise
        except InputError as error:
            raise self._error(str(error)) from error

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
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= MOST_S:
            raise self._error(f"says {key} = {_toml(value)}; it must be a number of seconds, and 0 or false is none")
        return float(value)

    def _limits(self) -> Limits:
        given, known = self._values.get("limits", {}), [field.name for field in fields(Limits)]
        if not isinstance(given, Mapping):
            raise self._error(f"says limits = {_toml(given)}; write them below [limits]: {', '.join(known)}")
        for name, value in given.items():
            if name not in known:
                raise UnknownNameError(f"limit of league {self._name}", name, known)
            if type(value) is not int or not 1 <= value <= MOST:
                raise self._error(f"says {name} = {_toml(value)} in its limits; it must be a whole number from 1 to {MOST}")
        return Limits(**given)

    def _trusted(self, entries: Mapping[str, str]) -> frozenset[str]:
        """Return the entries that need no wall, which says something of files and programs alone."""
        given = self._values.get("trusted", [])
        if not isinstance(given, list):
            raise self._error(f"says trusted = {_toml(given)}; it must be a list of entries' names")
        for name in given:
            if not isinstance(name, str) or name not in entries:
                raise UnknownNameError(f"entry that league {self._name} trusts", str(name), entries)
        return frozenset(given)

    def _one_of(self, key: str, known: tuple[str, ...]) -> str:
        value = self._values.get(key, known[0])
        if value not in known:
            raise UnknownNameError(f"{key} of league {self._name}", str(value), known)
        return str(value)

    def _challenger(self, entries: Mapping[str, str]) -> str | None:
        challenger, pairing = self._values.get("challenger"), self._one_of("pairing", PAIRINGS)
        if pairing == "sprt" and challenger is None:
            return next(iter(entries))
        if (challenger is None) != (pairing == "round-robin"):
            raise self._error(
                "has a challenger in a gauntlet or an sprt, and only there; "
                'write pairing = "gauntlet" and challenger = "NAME", or neither'
            )
        if challenger is not None and (not isinstance(challenger, str) or challenger not in entries):
            raise UnknownNameError(f"challenger of league {self._name}", str(challenger), entries)
        return challenger

    def _sprt(self, entries: Mapping[str, str]) -> Sprt | None:
        given = self._values.get("sprt")
        if self._one_of("pairing", PAIRINGS) != "sprt":
            if given is not None:
                raise self._error('has bounds of a test, and plays none; write pairing = "sprt", or take [sprt] out')
            return None
        if len(entries) != 2:
            raise self._error(f"tests whether one of two entries is better, and has {len(entries)}")
        given = {} if given is None else given
        if not isinstance(given, Mapping):
            raise self._error(f"says sprt = {_toml(given)}; write its bounds below [sprt]: {', '.join(BOUNDS)}")
        for name, value in given.items():
            if name not in BOUNDS:
                raise UnknownNameError(f"bound of league {self._name}", name, BOUNDS)
            if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _MOST_ELO:
                raise self._error(f"says {name} = {_toml(value)} in its test; it must be a number")
        try:
            return Sprt(**_BOUNDS | {name: float(value) for name, value in given.items()})
        except ValueError as error:
            raise self._error(f"asks for a test that cannot be: {error}") from error

    def _listen(self) -> str:
        value = self._values.get("listen", League.listen)
        port = str(value).rpartition(":")[2]
        if value != "" and not (str(value).startswith("tcp/") and port.isdecimal() and 0 < int(port) < 2**16):
            raise self._error(f"says listen = {_toml(value)}; it must be an endpoint such as tcp/0.0.0.0:7447")
        return str(value)

    def _check_strangers(self, league: League) -> None:
        """Refuse entries that could remember a map, or could not come, or would be one player under two names."""
        for name, spec in league.entries.items():
            is_open = spec.startswith(PROGRAM) and not league.sandboxes[name].has_wall
            who = "a program without a wall" if is_open else "who joins by itself" if name in league.remote else ""
            if who and league.maps == "paired":
                raise self._error(
                    f'lets {name} play both matches of a pair on one map, and {who} may remember it; write maps = "fresh"'
                )
        league.check_venue(league.venue)
        if league.remote and league.sprt is not None:
            raise self._error(
                f"tests {' and '.join(league.remote)} in batches of matches, and starts its entries anew for each; "
                "who joins by itself can play in another pairing"
            )
        names_of: dict[bytes, str] = {}
        for name, key in league.remote.items():
            if names_of.setdefault(key, name) != name:
                raise self._error(f"names {names_of[key]} and {name} by one key, and nobody may play against himself")

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

    def _given(self) -> list[tuple[str, Any]]:
        """Return the entries as they are written, by name."""
        given = self._values.get("entries")
        if isinstance(given, Mapping):
            return list(given.items())
        if isinstance(given, list):
            return [(name_of(str(spec)), spec) for spec in given]
        raise self._error('has no entries; name them, as in: entries = ["rush", "mybot.py"]')

    def _entries(self, given: Iterable[tuple[str, Any]], folder: Path, *, least: int) -> dict[str, str]:
        entries: dict[str, str] = {}
        known = names()
        for name, spec in given:
            if not isinstance(spec, str):
                raise self._error(
                    f"says {name} = {_toml(spec)}; an entry is a policy's name, a file, exec:COMMAND or key:PUBLICKEY, in quotes"
                )
            if not is_chunk(name):
                raise self._error(f"has an entry {name!r}; a name must be 1 to 64 letters, digits, - or _")
            if name in entries:
                raise self._error(f"has two entries named {name!r}; name them apart, as in: [entries] {name}-2 = {_toml(spec)}")
            entries[name] = self._fighter(spec, folder, known)
        if len(entries) < least:
            raise self._error(f"has {len(entries)} {'entry' if entries else 'entries'}; it takes two to fight")
        return entries

    def _fighter(self, spec: str, folder: Path, known: Iterable[str]) -> str:
        kind = kind_of_file(spec)
        if kind is not None:
            file, settings = split_settings(spec)
            path = (folder / file).absolute()
            if not path.is_file():
                raise self._error(f"names the {kind} {file}, and there is no {path}")
            return f"{path}{settings}"
        if spec.startswith(PROGRAM):
            return find_program(spec, folder)
        try:
            is_remote = public_key_of(spec) is not None
        except InputError as error:
            raise self._error(f"names an entry by its key, and {error}") from error
        if not is_remote and without_settings(spec) not in known:
            raise UnknownNameError(f"policy in league {self._name}", spec, known)
        return spec


def _toml(value: object) -> str:
    return json.dumps(value, default=str)
