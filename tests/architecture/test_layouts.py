"""What is known of a table layout stands in the registry and in the layout's own folders."""

import ast

import pytest

from pipeline.layouts import LAYOUTS

from .source import PACKAGES, ROOT, anywhere, relative, sources, tree, within

REGISTRY = "pipeline/layouts.py"
# the room that measures both layouts and compares them with the literature, of which one of them is the paper's
EVALUATION = "pipeline/evaluation/"
# "taylor" is there the basis of a series, as "chebyshev" is
SERIES = {"pipeline/diffraction/dft_stack.py"}
FOLDERS = {
    relative(folder)
    for name in LAYOUTS
    for folder in (ROOT / "pipeline").glob(f"*/{name}")
    if folder.is_dir() and not relative(folder).startswith(EVALUATION)
}
CLASSES = {
    node.name
    for source in sources(*FOLDERS)
    for node in ast.walk(tree(source))
    if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
}
OTHERS = [
    path
    for path in sources(*PACKAGES)
    if relative(path) != REGISTRY
    and not relative(path).startswith((EVALUATION, *(f"{folder}/" for folder in FOLDERS)))
]


def packages(folder):
    """Returns the name of the package in a folder."""
    return folder.replace("/", ".")


def test_every_layout_has_its_folders():
    """Each has one in the rooms of the mathematics, the stages and the bundle."""
    assert {f"pipeline/{room}/{name}" for room in ("tables", "stages", "bundle") for name in LAYOUTS} == FOLDERS
    for name, layout in LAYOUTS.items():
        assert layout.settings.__module__.startswith(f"pipeline.tables.{name}.")
        assert (layout.stages, layout.bundle) == (f"pipeline.stages.{name}", f"pipeline.bundle.{name}")


def test_no_other_module_imports_from_a_layouts_folders():
    found = {relative(path): within(anywhere(path), *map(packages, FOLDERS)) for path in OTHERS}
    assert {path: names for path, names in found.items() if names} == {}
    # and the search sees imports that exist
    assert within(anywhere(ROOT / REGISTRY), *map(packages, FOLDERS))


@pytest.mark.parametrize("name", LAYOUTS)
def test_no_layout_imports_from_anothers_folders(name):
    own = [folder for folder in FOLDERS if folder.endswith(f"/{name}")]
    others = [packages(folder) for folder in FOLDERS if folder not in own]
    found = {relative(path): within(anywhere(path), *others) for path in sources(*own)}
    assert {path: names for path, names in found.items() if names} == {}


def words(path):
    """Yields names and texts of a module that are a layout's: its name as a whole text, its classes."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Constant) and node.value in LAYOUTS:
            yield node.value
        if isinstance(node, ast.Name | ast.Attribute):
            name = node.id if isinstance(node, ast.Name) else node.attr
            if name in CLASSES:
                yield name


def test_no_other_module_names_a_layout_or_its_classes():
    found = {relative(path): sorted(set(words(path))) for path in OTHERS}
    assert {path for path, names in found.items() if names} == SERIES
    assert set(words(ROOT / REGISTRY)) >= {"polar", "taylor", "PolarLayout", "TaylorLayout"}
