"""ARCHITECTURE.md describes the project as it is: its picture of the rooms, and every path that it names."""

import ast
import re
from graphlib import TopologicalSorter

import pytest

from .source import PACKAGES, ROOT, imported, relative, sources, tree

PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
# files and folders that the page names and a run makes
MADE = {"tmp/", "out/", "artifact.json"}
# folders below which the page names a path without repeating them
PREFIXES = ("", "pipeline/", "kernels/")
PATH = re.compile(r"`([A-Za-z_][\w/.*-]*(?:/|\.(?:py|cl|glsl|md|toml|csv|json)))`")


def room_of(module):
    """Returns the room of a module's full name, or of a name in it."""
    package, _, rest = module.partition(".")
    if package != "pipeline":
        return package
    first = rest.partition(".")[0]
    if (ROOT / "pipeline" / first).is_dir() and first:
        return first
    if not (ROOT / "pipeline" / f"{first}.py").exists() or first in ("api", "__init__"):
        # the package itself, or a name of the public API that it hands on
        return "api"
    return "layouts" if first == "layouts" else "pipeline"


def loaded(node):
    """Yields all nodes below a node that may run: not the imports for type checkers alone."""
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
            yield child
            yield from loaded(child)


def arrows():
    """Finds the rooms that each room imports, anywhere in its files."""
    found = {}
    for path in sources(*PACKAGES):
        room = room_of(relative(path).removesuffix(".py").replace("/", "."))
        names = {name for name in imported(loaded(tree(path))) if name.partition(".")[0] in PACKAGES}
        # "from pipeline import layouts" names the package as well, which is not the room that it imports from
        rooms = {room_of(name) for name in names - set(PACKAGES)}
        found[room] = found.get(room, set()) | rooms - {room}
    return found


def picture():
    """Parses the page's picture: the rooms that each room imports, from the top down."""
    block = re.search(r"^```text\n(cli +->.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert block is not None
    # an indented line continues the one above it
    lines = [line.partition("->") for line in re.sub(r"\n +", " ", block[1]).splitlines()]
    return {room.strip(): set(below.split()) for room, _, below in lines}


def test_a_package_is_the_room_of_its_modules():
    assert [room_of(name) for name in ("kernels.device", "cli.main")] == ["kernels", "cli"]
    assert [room_of(f"pipeline.{name}") for name in ("optics.brdf", "layouts", "errors")] == [
        "optics",
        "layouts",
        "pipeline",
    ]
    assert room_of("pipeline.api.Bundle") == room_of("pipeline.bake") == room_of("pipeline") == "api"


def test_the_picture_is_what_the_imports_say():
    assert picture() == arrows()


def test_arrows_only_run_down():
    """Every room imports only rooms below it in the picture, so there is no cycle."""
    order = list(picture())
    upwards = [f"{a} -> {b}" for a, rooms in picture().items() for b in rooms if order.index(b) <= order.index(a)]
    assert upwards == []


def test_the_imports_have_no_cycle():
    """The same of the imports themselves."""
    assert set(TopologicalSorter(arrows()).static_order()) == arrows().keys()


@pytest.mark.parametrize("path", sorted(set(PATH.findall(PAGE)) - MADE))
def test_every_path_exists(path):
    """Paths are relative to the project, or to a folder that the text around them names."""
    assert any(list(ROOT.glob(prefix + path)) for prefix in PREFIXES)


def entries():
    """Parses the page's list of folders: the text about each."""
    block = re.search(r"^```text\n(cli/ .*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert block is not None
    parents, found = [], {}
    for indent, name, text in re.findall(r"^( {0,6})(\w+)/ +(.*(?:\n {9,}.*)*)", block[1], re.MULTILINE):
        parents[len(indent) // 2 :] = [name]
        found[ROOT.joinpath(*parents)] = text
    return found


@pytest.mark.parametrize(("folder", "text"), entries().items(), ids=[relative(folder) for folder in entries()])
def test_the_folders_hold_the_files_that_are_listed(folder, text):
    """Every file and folder that the list names lies in the entry's folder; every folder of a package is listed."""
    for name in re.findall(r"\w+(?:/|\.(?:py|cl|glsl|md)\b)", text):
        assert (folder / name).exists() or (ROOT / name).exists(), f"{relative(folder)}/{name}"
    for found in folder.iterdir():
        if folder.parts[len(ROOT.parts)] in PACKAGES and any(file.suffix != ".pyc" for file in found.rglob("*.*")):
            assert found in entries() or f"{found.name}/" in text, f"{relative(found)} is not listed"


def test_every_test_named_exists():
    """An entry that names a test function names the file that defines it."""
    named = re.findall(r"`(tests/[\w/]+\.py)`:? `(test_\w+)`", PAGE)
    assert named
    for file, function in named:
        assert f"def {function}(" in (ROOT / file).read_text(encoding="utf-8"), function
