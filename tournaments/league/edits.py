"""Whether a league is still the one that its results were played in, and what was edited if not."""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any


def hash_definition(definition: Mapping[str, Any]) -> str:
    """Return SHA-256 (hex) of a league's definition; the ruleset's name is no rule."""
    deciding = {key: value for key, value in definition.items() if key != "ruleset"}
    return sha256(json.dumps(deciding, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def find_edit(stored: Mapping[str, Any], now: Mapping[str, Any]) -> str | None:
    """Return in words what was edited between two `League.definition`, to which `secret` may be added; None if nothing was."""
    if stored["rules"] != now["rules"]:
        return f"its rules were edited (were {stored['ruleset']} {stored['rules'][:8]}, are {now['ruleset']} {now['rules'][:8]})"
    before, after = stored["entries"], now["entries"]
    for name in sorted(set(before) - set(after)):
        return f"the entry {name} was taken out"
    for name in sorted(set(after) - set(before)):
        return f"the entry {name} was added"
    for name in sorted(before):
        if before[name] != after[name]:
            file, other = before[name].partition(" ")[0], after[name].partition(" ")[0]
            how = f"the content of {file} is another" if file == other else f"was {file}, is {other}"
            return f"the entry {name} was edited ({how})"
    for key, value in stored["clock"].items():
        if value != now["clock"][key]:
            return f"{key} was edited (was {value}, is {now['clock'][key]})"
    if ("sprt" in stored) != ("sprt" in now):
        return "its pairing was edited (was sprt, is another)" if "sprt" in stored else "its pairing was edited (is sprt now)"
    for name, value in stored.get("sprt", {}).items():
        if value != now["sprt"][name]:
            return f"{name} of its test was edited (was {value:g}, is {now['sprt'][name]:g})"
    for key, default in (("maps", "paired"), ("challenger", None)):
        if stored.get(key, default) != now.get(key, default):
            return f"{key} was edited (was {stored.get(key, default)}, is {now.get(key, default)})"
    if stored.get("secret") != now.get("secret"):
        return "its seed or secret was edited"
    return None
