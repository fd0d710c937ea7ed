"""How the house is kept, where neither ruff nor import-linter looks."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("arena", "clients", "policies", "tournaments")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def is_command(path: Path) -> bool:
    return path.name == "cli.py" or path.parent.name == "commands"


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", [path for path in SOURCES if not is_command(path) and path.name != "console.py"], ids=name_of)
def test_only_a_cli_prints_logs_to_somewhere_or_chooses_an_exit_code(path: Path) -> None:
    calls = {ast.unparse(node.func) for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)}

    assert not calls & {"print", "typer.echo", "logging.basicConfig", "sys.exit", "exit", "quit", "os._exit"}


@pytest.mark.parametrize("path", [path for path in SOURCES if is_command(path)], ids=name_of)
def test_what_a_cli_prints_is_cleaned_in_one_place(path: Path) -> None:
    calls = {ast.unparse(node.func) for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)}

    assert not calls & {"print", "typer.echo", "typer.secho", "click.echo", "sys.stdout.write", "sys.stderr.write"}


@pytest.mark.parametrize("path", [path for path in SOURCES if is_command(path)], ids=name_of)
def test_a_cli_imports_only_light_modules_at_its_top(path: Path) -> None:
    tree = ast.parse(path.read_text())
    imported = {node.module for node in tree.body if isinstance(node, ast.ImportFrom)}
    imported |= {alias.name for node in tree.body if isinstance(node, ast.Import) for alias in node.names}
    own = {module for module in imported if module and module.partition(".")[0] in PACKAGES}

    commands = {name_of(other).removesuffix(".py").replace("/", ".") for other in SOURCES if is_command(other)}
    assert own <= commands | {"arena.console", "arena.errors", "arena.match.time_control"}
    assert not {str(module).partition(".")[0] for module in imported} & {"numpy", "numba", "torch", "zenoh", "scipy", "rich"}


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_a_room_is_not_larger_than_one_idea(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 350


def test_no_folder_of_tests_is_a_package() -> None:
    """`tests/arena/__init__.py` alone would shadow `arena`."""
    assert list((ROOT / "tests").rglob("__init__.py")) == []


def test_names_of_test_files_are_unique() -> None:
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]

    assert len(names) == len(set(names))


def test_every_package_is_a_package_from_the_top() -> None:
    """A folder of modules without `__init__.py` would be left out of what is installed and of what the linter sees."""
    assert {path.parent for path in SOURCES} <= {path.parent for path in SOURCES if path.name == "__init__.py"}


def test_every_version_is_pinned_and_none_is_a_local_build() -> None:
    pins = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]

    assert all(line.count("==") == 1 and "+" not in line for line in pins)
