"""Write what the reference takes from the code: the observation, the messages, the JSON Schema. `make reference` runs it."""

import ast
import inspect
import json
import re
from collections.abc import Collection, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from arena.annotations import COLOURS
from arena.game.observation import FIELDS, NO_CLOCK_MS, Board, EnemyUnit, Observation, Observations, OwnUnit
from arena.game.observation_fields import GROUND_CODES
from arena.game.ruleset import Ruleset, UnitType, load
from arena.game.types import Action, Code, Team, Termination
from arena.policy import MatchResult
from arena.protocol.messages import LATER, PROTOCOL_VERSION, Message

REFERENCE = Path(__file__).parent / "reference"
Schema = dict[str, Any]
TEAMS = [team.name.lower() for team in Team]


def pages() -> dict[str, str]:
    """Return every file that is made, by its name."""
    return {
        "observation.md": "\n".join(observation_page()),
        "zenoh-messages.md": "\n".join(messages_page()),
        "json-lines.schema.json": json.dumps(schema(), indent=2) + "\n",
    }


def notes(kind: type) -> dict[str, str]:
    """Return what stands under each field of a dataclass, inherited ones too, and the first line of each property and method."""
    [body] = [node.body for node in ast.parse(inspect.getsource(kind).strip()).body if isinstance(node, ast.ClassDef)]
    said = notes(kind.__bases__[0]) if is_dataclass(kind.__bases__[0]) else {}
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            text = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
            said[node.target.id] = " ".join(text.split())
        elif isinstance(node, ast.FunctionDef):
            said[node.name] = (ast.get_docstring(node) or "").partition("\n")[0]
    return said


def table(*columns: str, rows: Iterator[tuple[object, ...]]) -> Iterator[str]:
    """Yield a table in Markdown."""
    yield "| " + " | ".join(columns) + " |"
    yield "|" + "---|" * len(columns)
    yield from ("| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in rows)
    yield ""


def _fields_table(kind: type) -> Iterator[str]:
    said, hints = notes(kind), get_type_hints(kind)
    later = {item.name: f" Left out where it is {item.default!r}." for item in fields(kind) if item.metadata == LATER}
    rows = (
        (f"`{item.name}`", f"`{_type(hints[item.name])}`", said[item.name] + later.get(item.name, "")) for item in fields(kind)
    )
    yield from table("field", "type", "meaning", rows=rows)


def observation_page() -> Iterator[str]:
    """Yield the lines of the page on observations."""
    said = notes(Observation)
    yield "# The observation\n"
    yield "Made by `make reference` from `arena/game/observation.py`. All that a team may know, and nothing else.\n"
    yield "## What a bot gets\n\nThe argument of `act` is an `arena.Observation`.\n"
    yield from _fields_table(Observation)
    yield "Computed from these when asked for:\n"
    methods = [name for name in said if name not in {item.name for item in fields(Observation)} and name != "from_board"]
    yield from table("name", "meaning", rows=((f"`{_call(name)}`", said[name]) for name in methods))
    yield "To test a bot, `Observation.from_board(text)` makes one of a drawn board; see [API](api.md).\n"
    for title, kind in (("One of `units`", OwnUnit), ("One of `enemies`", EnemyUnit)):
        yield f"### {title}\n\n{inspect.getdoc(kind)}\n"
        yield from _fields_table(kind)
    yield "## As JSON\n\nA program is sent the same fields under the same names; see [JSON lines](json-lines.md).\n"
    yield "## On the wire\n"
    yield "A client of a pit gets it as bytes of one length per ruleset: these fields, one after another, integers little-endian."
    yield "The offsets are those of blue under `paper`.\n"
    yield from table("at", "field", "type", "how many", "meaning", rows=_layout())


def _layout() -> Iterator[tuple[object, ...]]:
    rules, said, at = load("paper"), notes(Observations), 0
    for name, spec in FIELDS.items():
        if spec.is_on_wire:
            dtype, count = np.dtype(spec.dtype), int(np.prod(spec.shape_of(rules, Team.BLUE)))
            axes = [str(axis) if isinstance(axis, int) else _SIZES[axis.__name__] for axis in spec.axes] or ["1"]
            yield at, f"`{name}`", dtype.name, " x ".join(axes), _meaning(said[name])
            at += count * dtype.itemsize
    yield at, "end", "", "", ""


def _meaning(said: str) -> str:
    return re.sub(r"^Shape \([^)]*\)[:.] ?", "", said).replace("`NO_CLOCK_MS`", f"{NO_CLOCK_MS:#x} where no clock runs")


_SIZES = {"n_own": "own units", "n_enemies": "enemy units", "n_cells": "side x side"}


def _type(hint: Any) -> str:
    """Return a type as a reader of tables wants it."""
    if hint == Board:
        return "int8 array"
    if get_origin(hint) in (UnionType, tuple, list, dict):
        joint = " | " if get_origin(hint) is UnionType else ", "
        inner = joint.join("..." if one is ... else _type(one) for one in get_args(hint))
        return inner if get_origin(hint) is UnionType else f"{get_origin(hint).__name__}[{inner}]"
    return "None" if hint is type(None) else getattr(hint, "__name__", str(hint))


def _call(name: str) -> str:
    """Return a property's name, or a method's with its parameters."""
    found = inspect.getattr_static(Observation, name)
    if isinstance(found, property):
        return name
    return f"{name}({', '.join(list(inspect.signature(found).parameters)[1:])})"


def messages_page() -> Iterator[str]:
    """Yield the lines of the page on messages."""
    kinds: tuple[type, ...] = get_args(Message)
    yield "# The messages of the protocol\n"
    yield "Made by `make reference` from `arena/protocol/messages.py`. A message is a msgpack array: the version of the protocol,"
    yield "the number of its kind, and its fields in this order. `bytes` are msgpack's bin, `str` its text in UTF-8."
    yield f"This is version {PROTOCOL_VERSION}. [The protocol](zenoh.md) says who sends which, and how they are sealed.\n"
    for number, kind in enumerate(kinds):
        yield f"## {number}: {kind.__name__}\n\n{' '.join((inspect.getdoc(kind) or '').split())}\n"
        if fields(kind):
            yield from _fields_table(kind)


def schema() -> Schema:
    """Return the JSON Schema of all lines, to a program and from it."""
    rules, said = _object(Ruleset), notes(Observation)
    del rules["properties"]["name"]
    rules["properties"]["units"] = {
        "type": "object",
        "additionalProperties": _object(UnitType, {"name"}),
        "description": "By name.",
    }
    rules["properties"]["board"] = {"type": "string", "description": notes(Ruleset)["board"]}
    rules["required"] = [name for name in rules["properties"] if name != "board"]
    observation = _object(Observation, without={"annotations"})
    extra = {
        "grid": _cells(list(map(int, Code)), said["grid"]),
        "legal_actions": {
            "type": "array",
            "items": {"type": "array", "items": {"type": "boolean"}, "minItems": len(Action), "maxItems": len(Action)},
            "description": said["legal_actions"],
        },
    }
    observation["properties"] |= extra
    observation["required"] += extra
    result = _object(MatchResult)
    result["properties"]["ending"] = {"enum": [end.name.lower() for end in Termination if end is not Termination.RUNNING]}
    result["properties"]["score"]["description"] = "The program's own, in -100 .. 100."
    start = {"type": "object", "properties": {"team": {"enum": TEAMS}, "ruleset": rules}, "required": ["team", "ruleset"]}
    orders = {
        "type": "array",
        "items": {"enum": list(map(int, Action))},
        "description": "One for each of `units`, in their order.",
    }
    told = {"start": start, "observation": observation, "end": result}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "The lines between the arena and a program",
        "description": "Made by `make reference`. A line to the program is `toProgram`, a line from it `fromProgram`.",
        "$defs": {
            "toProgram": {"oneOf": [{"$ref": f"#/$defs/{name}"} for name in told]},
            "fromProgram": {"oneOf": [{"$ref": "#/$defs/orders"}, {"$ref": "#/$defs/answer"}]},
            **{name: _line(name, one) for name, one in told.items()},
            "orders": orders,
            "answer": _answer(),
        },
    }


def _line(name: str, schema: Schema) -> Schema:
    return {
        **schema,
        "properties": {"type": {"const": name}, **schema["properties"]},
        "required": ["type", *schema["required"]],
        "additionalProperties": False,
    }


def _answer() -> Schema:
    whole = {"type": "integer", "minimum": 0}
    cell = {"type": "array", "items": whole, "minItems": 2, "maxItems": 2, "description": "Row and column."}
    number = {
        "type": "array",
        "items": {"type": ["number", "array"]},
        "description": "side x side numbers, row by row or as rows.",
    }
    shapes = {"cell": cell, "path": {"type": "array", "items": cell}, "heat": number}
    words = {"cell": "text", "heat": "label"}
    drawings = [
        {
            "type": "object",
            "properties": {
                name: shape,
                "colour": {"enum": [*COLOURS]},
                **({words[name]: {"type": "string"}} if name in words else {}),
            },
            "required": [name],
        }
        for name, shape in shapes.items()
    ]
    return {
        "type": "object",
        "properties": {
            "orders": {"$ref": "#/$defs/orders"},
            "log": {"type": ["array", "string"], "items": {"type": "string"}, "description": "Lines for the author."},
            "draw": {"type": "array", "items": {"oneOf": drawings}, "description": "Drawings over the board, for the author."},
        },
        "required": ["orders"],
    }


def _object(kind: type, without: Collection[str] = ()) -> Schema:
    """Return the schema of a dataclass, whose fields are all there."""
    said, hints = notes(kind), get_type_hints(kind)
    names = [item.name for item in fields(kind) if item.name not in without]
    properties = {name: _schema_of(name, hints[name]) | ({"description": said[name]} if said[name] else {}) for name in names}
    return {"type": "object", "properties": properties, "required": names, "additionalProperties": False}


def _cells(codes: list[int], meaning: str) -> Schema:
    return {"type": "array", "items": {"type": "array", "items": {"enum": codes}}, "description": meaning}


_PLAIN: dict[Any, Schema] = {
    int: {"type": "integer"},
    str: {"type": "string"},
    bool: {"type": "boolean"},
    float: {"type": "number"},
    type(None): {"type": "null"},
    Team: {"enum": TEAMS},
    Termination: {"type": "string"},
}


def _schema_of(name: str, hint: Any) -> Schema:
    """Return the schema of a field; the table of observations bounds it, if it is there."""
    if hint == Board:
        return _cells([*GROUND_CODES], "")
    if get_origin(hint) is UnionType:
        return {"anyOf": [_schema_of("", one) for one in get_args(hint)]}
    if get_origin(hint) is tuple:
        [first, *rest] = get_args(hint)
        if rest == [...]:
            return {"type": "array", "items": _object(first) if first in (OwnUnit, EnemyUnit) else {}}
        return {"type": "array", "items": _schema_of("", first), "minItems": 1 + len(rest), "maxItems": 1 + len(rest)}
    values = FIELDS[name].values if name in FIELDS else None
    bounds = {"minimum": values[0], "maximum": values[-1]} if isinstance(values, range) else {}
    return _PLAIN[hint] | bounds


if __name__ == "__main__":
    for name, text in pages().items():
        (REFERENCE / name).write_text(text, encoding="utf-8")
