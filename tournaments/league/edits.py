"""Whether a league is still the one that its results were played in, and what was edited if not."""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

from tournaments.league.versions import entry_of


def hash_definition(definition: Mapping[str, Any]) -> str:
    """Return SHA-256 (hex) of a league's definition; the ruleset's name is no rule."""
    deciding = {key: value for key, value in definition.items() if key != "ruleset"}
    return sha256(json.dumps(deciding, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def is_edited(stored: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    """Whether anything that results depend on was edited, entries included, in the sense of `find_edit`."""
    return stored["entries"] != now["entries"] or find_edit(stored, now) is not None


def find_edit(stored: Mapping[str, Any], now: Mapping[str, Any]) -> str | None:
    """Return in words what was edited that results depend on for ever, in two `League.definition`; None if nothing was.

    `secret` may be added to either. Entries are no such thing: they have versions.
    """
    if stored["rules"] != now["rules"]:
        return f"its rules were edited (were {stored['ruleset']} {stored['rules'][:8]}, are {now['ruleset']} {now['rules'][:8]})"
    for key, value in stored["clock"].items():
        if value != now["clock"][key]:
            return f"{key} was edited (was {value}, is {now['clock'][key]})"
    if ("season" in stored) != ("season" in now):
        return "its pairing was edited (was a season, is a league)" if "season" in stored else "it was a league, and is a season"
    if ("sprt" in stored) != ("sprt" in now):
        return "its pairing was edited (was sprt, is another)" if "sprt" in stored else "its pairing was edited (is sprt now)"
    for name, value in stored.get("sprt", {}).items():
        if value != now["sprt"][name]:
            return f"{name} of its test was edited (was {value:g}, is {now['sprt'][name]:g})"
    if stored.get("maps", "paired") != now.get("maps", "paired"):
        return f"maps was edited (was {stored.get('maps', 'paired')}, is {now.get('maps', 'paired')})"
    before, after = (facts.get("challenger") for facts in (stored, now))
    if before != after and (before is None or after is None or entry_of(before) != entry_of(after)):
        return f"challenger was edited (was {before}, is {after})"
    if stored.get("secret") != now.get("secret"):
        return "its seed or secret was edited"
    return None
