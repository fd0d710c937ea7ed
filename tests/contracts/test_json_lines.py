"""The JSON Schema of the lines between the arena and a program: what a real one is sent and answers is valid, and little else."""

import json
import runpy
import shlex
import sys
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import jsonschema
import pytest
from pages import PAGES, ROOT

from arena.annotations import Annotations
from arena.game.ruleset import Ruleset, load
from arena.local.venue import play_batch
from policies.registry import load as load_fighter

REFERENCE = ROOT / "docs" / "reference"
SCHEMA = json.loads((REFERENCE / "json-lines.schema.json").read_text())
PROGRAM = """
import json, sys
with open(sys.argv[1], "a") as log:
    for line in sys.stdin:
        log.write("to " + line)
        seen = json.loads(line)
        if seen["type"] == "observation":
            answer = [0 for _ in seen["units"]]
            if seen["tick"] % 2:
                side = len(seen["ground"])
                heat = [[column for column in range(side)] for row in range(side)]
                answer = {"orders": answer, "log": ["here"], "draw": [
                    {"cell": [1, 2], "colour": "red", "text": "A"}, {"path": [[0, 0], [0, 1]]}, {"heat": heat, "colour": "blue"}]}
            log.write("from " + json.dumps(answer) + "\\n")
            log.flush()
            print(json.dumps(answer), flush=True)
"""


def check(direction: str, line: Any) -> None:
    jsonschema.Draft202012Validator({"$ref": f"#/$defs/{direction}", **SCHEMA}).validate(line)


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory, small_rules: Ruleset, plan: Callable[..., Any]) -> dict[str, list[Any]]:
    """Return every line of two matches, one on a small drawn board and one of `paper`."""
    folder = tmp_path_factory.mktemp("program")
    (folder / "program.py").write_text(PROGRAM)
    program = load_fighter(f"exec:{shlex.join([sys.executable, str(folder / 'program.py'), str(folder / 'log')])}")
    still = load_fighter("patrol")
    for rules in (small_rules, load("paper").with_({"tick_limit": 5}), small_rules):  # all before the last has been written down
        list(play_batch(rules, [plan("lines/1", "one", "other", 1)], program, still))
    told = [line.split(" ", 1) for line in (folder / "log").read_text().splitlines()]
    return {name: [json.loads(text) for direction, text in told if direction == name] for name in ("to", "from")}


def test_every_line_of_a_match_is_valid(lines: dict[str, list[Any]]) -> None:
    for line in lines["to"]:
        check("toProgram", line)
    for line in lines["from"]:
        check("fromProgram", line)

    assert {line["type"] for line in lines["to"]} == {"start", "observation", "end"}
    assert {type(line) for line in lines["from"]} == {list, dict}


@pytest.mark.parametrize("kind", ["start", "observation", "end"])
def test_a_line_without_one_of_its_fields_or_with_another_is_not_valid(kind: str, lines: dict[str, list[Any]]) -> None:
    line = next(line for line in lines["to"] if line["type"] == kind)
    for name in line:
        with pytest.raises(jsonschema.ValidationError):
            check("toProgram", {key: value for key, value in line.items() if key != name})
    with pytest.raises(jsonschema.ValidationError):
        check("toProgram", {**line, "more": 1})


@pytest.mark.parametrize(
    "wrong", [[5], "north", [0.5], {"log": []}, {"orders": 1}, {"orders": [], "draw": [{"cell": [1]}]}, None]
)
def test_an_answer_that_is_none_is_not_valid(wrong: Any) -> None:
    with pytest.raises(jsonschema.ValidationError):
        check("fromProgram", wrong)


def test_the_answer_of_the_page_is_valid_and_its_drawings_are_kept() -> None:
    text = PAGES["docs/reference/json-lines.md"]
    answer = json.loads(text.partition("```json\n")[2].partition("```")[0])

    check("fromProgram", answer)
    kept = Annotations(20)
    kept.add(deepcopy(answer))
    assert kept.to_dict()["log"] == answer["log"]
    assert [drawing["colour"] for drawing in kept.to_dict()["draw"]] == [drawing["colour"] for drawing in answer["draw"]]


@pytest.mark.parametrize("name", ["observation.md", "zenoh-messages.md", "json-lines.schema.json"])
def test_what_is_generated_is_what_the_code_says(name: str) -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_reference.py"))["pages"]()

    assert (REFERENCE / name).read_text(encoding="utf-8") == made[name], "run `make reference`"
