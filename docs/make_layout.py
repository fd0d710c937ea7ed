"""Write `docs/reference/layout.md`: a line for every module, which is the first of its docstring. `make layout` runs it."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("tournaments", "clients", "policies", "arena", "benchmarks")
HEAD = "# What stands in every file\n\nMade by `make layout` from the first line of each module.\n"


def layout() -> str:
    """Return the page."""
    return "\n".join([HEAD, *(line for package in PACKAGES for line in _describe(ROOT / package))])


def _describe(package: Path) -> Iterator[str]:
    """Yield a section for a package, and one for each of its rooms."""
    for folder in [package, *sorted(path.parent for path in package.rglob("__init__.py") if path.parent != package)]:
        modules = [path for path in sorted(folder.glob("*.py")) if path.name != "__init__.py"]
        yield f"{'##' if folder == package else '###'} `{folder.relative_to(ROOT)}/`\n"
        yield f"{first_line(folder / '__init__.py')}\n"
        if modules:
            yield "| file | what stands in it |\n|---|---|"
            yield from (f"| `{path.name}` | {first_line(path)} |" for path in modules)
            yield ""


def first_line(path: Path) -> str:
    """Return the first line of a module's docstring."""
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")[0]


if __name__ == "__main__":
    (ROOT / "docs" / "reference" / "layout.md").write_text(layout(), encoding="utf-8")
