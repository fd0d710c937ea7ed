"""The README and the pages of docs keep their word: links, paths, options, targets and extras are what they say."""

import re
import runpy
import tomllib
from collections.abc import Iterator
from typing import Any

import pytest
from pages import LINES, PAGES, ROOT, words
from typer.main import get_command

from tournaments.cli import COMMANDS, app

MOST_WORDS = 700
INDENTED = re.compile(r"^ {4}(?:.* (?:--|do) )?(arena .*)$")
ROOMS = ("arena", "benchmarks", "clients", "docs", "policies", "tests", "tournaments")


def anchors(page: str) -> set[str]:
    """Return what a link can point at in a page, as GitHub names headings."""
    headings = re.findall(r"^#+ (.*)$", page, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def links() -> Iterator[tuple[str, str]]:
    for name, page in PAGES.items():
        for target in re.findall(r"\]\(([^)]+)\)", page):
            if "://" not in target:
                yield name, target


def test_the_readme_is_short() -> None:
    assert len(PAGES["README.md"].split()) <= MOST_WORDS


@pytest.mark.parametrize(("page", "target"), sorted(set(links())))
def test_a_link_leads_somewhere(page: str, target: str) -> None:
    file, _, anchor = target.partition("#")
    place = (ROOT / page).parent / file if file else ROOT / page

    assert place.is_file()
    assert not anchor or anchor in anchors(place.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", sorted(set(re.findall(rf"`((?:{'|'.join(ROOMS)})/(?!PIT/)[\w./-]+)`", "\n".join(LINES)))))
def test_a_path_that_is_named_exists(path: str) -> None:
    assert (ROOT / path).exists()


@pytest.mark.parametrize("line", sorted({found[1] for found in map(INDENTED.match, LINES) if found}))
def test_a_command_line_is_one_that_the_arena_takes(line: str) -> None:
    command: Any = get_command(app)
    context = command.make_context("arena", words(line))
    while True:
        rest = [*context._protected_args, *context.args]
        if not rest or not hasattr(context.command, "get_command"):
            break
        inner = context.command.get_command(context, rest[0])
        context = inner.make_context(rest[0], rest[1:], parent=context)


@pytest.mark.parametrize("line", sorted(set(re.findall(r"`(arena [a-z][^`]*)`", "\n".join(LINES)))))
def test_a_command_that_is_mentioned_has_the_options_that_it_is_mentioned_with(line: str) -> None:
    command: Any = get_command(app)
    name, *rest = words(line.replace("\\|", ","))
    nodes = [command.get_command(command.make_context("arena", [name, "--help"], resilient_parsing=True), name)]
    if rest and hasattr(nodes[0], "commands") and not rest[0].startswith("-"):
        nodes += [nodes[0].commands[sub] for sub in rest[0].split(",")]
    known = {option for node in nodes for parameter in node.params for option in parameter.opts + parameter.secondary_opts}

    assert {word.partition("=")[0] for word in rest if word.startswith("--")} <= known | {"--help"}


def test_every_command_has_its_row() -> None:
    rows = re.findall(r"^\| `arena ([a-z-]+)", PAGES["docs/reference/commands.md"], re.MULTILINE)

    assert set(rows) == set(COMMANDS)


def test_every_extra_has_its_row() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]

    assert set(re.findall(r"^\| `([a-z0-9]+)`", PAGES["docs/how-to/install.md"], re.MULTILINE)) == extras.keys() - {"dev", "docs"}


def test_targets_that_are_named_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    named = {name for line in LINES for name in re.findall(r"(?:^ {4}|`)make ([a-z-]+)", line)}

    assert named <= targets


def test_the_map_of_modules_is_the_one_that_is_generated() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_layout.py"))["layout"]()

    assert made == (ROOT / "docs" / "reference" / "layout.md").read_text(encoding="utf-8"), "run `make layout`"
