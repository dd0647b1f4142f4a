"""The project's Python files as syntax trees, for tests of its structure."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("cli", "pipeline", "kernels")
# libraries that take a tenth of a second or more to import
HEAVY = {
    "colour",
    "jinja2",
    "matplotlib",
    "OpenEXR",
    "PIL",
    "pyfftw",
    "pyopencl",
    "scipy",
    "SurfaceTopography",
    "trimesh",
    "zarr",
}


def sources(*places):
    """Yields the Python files below folders of the project, or the files themselves."""
    for place in places:
        path = ROOT / place
        yield from sorted(path.rglob("*.py")) if path.is_dir() else [path]


def tree(path):
    """Parses a file."""
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def imported(nodes):
    """Returns the full names of modules that import statements among the nodes may load."""
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "packages are imported by their full names"
            names |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def anywhere(path):
    """Returns the names that a file imports, in its functions as well."""
    return imported(ast.walk(tree(path)))


def within(names, *packages):
    """Selects the names that are one of the packages or lie in it."""
    return {name for name in names if any(name == p or name.startswith(f"{p}.") for p in packages)}


def relative(path):
    """Returns a path from the project's root, with slashes."""
    return path.relative_to(ROOT).as_posix()
