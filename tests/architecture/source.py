"""The project's Python files as syntax trees, for tests of its structure."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("cli", "pipeline", "kernels")


def sources(*places):
    """Python files below folders of the project, or the files themselves."""
    for place in places:
        path = ROOT / place
        yield from sorted(path.rglob("*.py")) if path.is_dir() else [path]


def tree(path):
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def imported(nodes):
    """Full names of the modules that import statements among the nodes may load."""
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "packages are imported by their full names"
            names |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def anywhere(path):
    return imported(ast.walk(tree(path)))


def within(names, *packages):
    """Those of the names that are one of the packages or lie in it."""
    return {name for name in names if any(name == p or name.startswith(f"{p}.") for p in packages)}


def relative(path):
    return path.relative_to(ROOT).as_posix()
