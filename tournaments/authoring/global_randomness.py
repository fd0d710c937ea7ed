"""Where a bot's file draws from chance that no replay brings back: generators of the process or of the system."""

import ast
from collections.abc import Iterator

_MODULES = {"random", "numpy.random", "secrets"}
_FUNCTIONS = {"os.urandom", "uuid.uuid1", "uuid.uuid4"}
_SEEDABLE = {"random.Random", "numpy.random.default_rng", "numpy.random.RandomState", "numpy.random.SeedSequence"}
"""Generators of one's own: they replay if they are given a seed."""
_OF_A_SEED = {"Generator", "PCG64", "PCG64DXSM", "Philox", "MT19937", "SFC64", "BitGenerator"}


def find_global_randomness(source: str) -> list[tuple[int, str]]:
    """Return the calls of global randomness in Python source: line and name, as in (12, "random.choice").

    Names are followed through `import` and `from ... import` alone; what is assigned or handed on is not seen. Source that is not
    Python, or is nested without end, has none.
    """
    try:
        return _find(ast.parse(source))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []


def _find(tree: ast.AST) -> list[tuple[int, str]]:
    names = dict(_imports(tree))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    found = {(call.lineno, name) for call in calls if (name := _full_name(call.func, names)) and _is_global(name, call)}
    return sorted(found)


def _imports(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield what each imported name stands for."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                whole = alias.name if alias.asname else alias.name.partition(".")[0]
                yield alias.asname or whole, whole
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                yield alias.asname or alias.name, f"{node.module}.{alias.name}"


def _full_name(node: ast.expr, names: dict[str, str]) -> str | None:
    if isinstance(node, ast.Name):
        return names.get(node.id)
    if isinstance(node, ast.Attribute) and (before := _full_name(node.value, names)):
        return f"{before}.{node.attr}"
    return None


def _is_global(name: str, call: ast.Call) -> bool:
    module, _, function = name.rpartition(".")
    if name in _SEEDABLE:
        return not call.args and not call.keywords
    return name in _FUNCTIONS or (module in _MODULES and function not in _OF_A_SEED)
