"""Rules of imports: cli -> pipeline -> kernels, physics apart from stages, heavy libraries on demand."""

import ast
import subprocess
import sys

import pytest

from .source import HEAVY, PACKAGES, ROOT, anywhere, imported, relative, sources, tree, within

STAGE_FREE = ("tables", "scene", "fourier", "diffraction", "accuracy", "optics", "surface")


def is_script(statement):
    """Whether a statement is `if __name__ == "__main__":`."""
    return isinstance(statement, ast.If) and ast.unparse(statement.test) == "__name__ == '__main__'"


def offenders(places, *packages):
    """Which files import any of the packages, anywhere in them."""
    found = {relative(path): within(anywhere(path), *packages) for path in sources(*places)}
    return {path: names for path, names in found.items() if names}


def test_imports_are_found():
    """The search finds imports that exist: a check of nothing would pass everything."""
    assert all(len(list(sources(package))) > 1 for package in PACKAGES)
    assert within(anywhere(ROOT / "pipeline/stages/run.py"), "pipeline.stages", "numpy") >= {"pipeline.stages.render"}
    assert "pyopencl" in anywhere(ROOT / "kernels/device.py")


def test_kernels_import_nothing_above_them():
    """Kernel code knows neither the pipeline nor the command line."""
    assert offenders(["kernels"], "pipeline", "cli") == {}


def test_pipeline_knows_no_command_line():
    """The pipeline can be imported by anything, so it imports no front end."""
    assert offenders(["pipeline"], "cli", "click", "rich") == {}


def test_only_the_device_module_talks_to_opencl():
    """One module opens devices and holds buffers."""
    assert set(offenders(PACKAGES, "pyopencl")) == {"kernels/device.py"}


def test_only_the_fourier_room_talks_to_fftw():
    """One room plans transforms and keeps wisdom; the speed measurements use it."""
    found = offenders(PACKAGES, "pyfftw")
    assert found
    assert {path.rpartition("/")[0] for path in found} == {"pipeline/fourier"}


def test_only_the_command_line_evaluates():
    """The code that users bake with does not depend on its comparison with the literature."""
    product = [path for path in (ROOT / "pipeline").iterdir() if path.name not in ("evaluation", "__pycache__")]
    assert offenders([relative(path) for path in product], "pipeline.evaluation") == {}


def test_physics_knows_no_stages():
    """Closed forms, tables and sums run without the order of stages."""
    assert offenders([f"pipeline/{place}" for place in STAGE_FREE], "pipeline.stages") == {}


def test_physics_and_kernels_know_no_store():
    """Closed forms, sums, tables and kernels neither read nor address artifacts."""
    places = ["pipeline/optics", "pipeline/scene", "pipeline/diffraction", "pipeline/tables", "kernels"]
    assert offenders(places, "pipeline.store") == {}


def test_physics_knows_no_config():
    """Closed forms, transforms and tables take values; only stages and what is above them open a config."""
    rooms = ("optics", "scene", "surface", "fourier", "diffraction", "tables")
    assert offenders([f"pipeline/{room}" for room in rooms], "pipeline.config") == {}


@pytest.mark.parametrize("room", ["pipeline", "kernels"])
def test_libraries_do_not_print(room):
    """Only the command line writes text for people; a file that is run as a script may print, too."""
    printing = [
        f"{relative(path)}:{node.lineno}"
        for path in sources(room)
        for statement in tree(path).body
        if not is_script(statement)
        for node in ast.walk(statement)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    ]
    assert printing == []


def test_commands_start_without_heavy_libraries():
    """No module of the command line imports a heavy library when it is itself imported."""
    found = {relative(path): within(imported(tree(path).body), *HEAVY) for path in sources("cli")}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("pipeline.config.models", HEAVY),
        ("pipeline.store.store", HEAVY),
        ("pipeline.stages.run", HEAVY),
        ("cli.main", HEAVY),
        # what `inspect` imports to read a scan
        ("pipeline.surface.load", HEAVY | {"scipy", "pyfftw"}),
    ],
)
def test_planning_loads_no_heavy_library(module, heavy):
    """Planning imports no heavy library: each is imported by the stage that uses it."""
    script = f"import sys, {module}; print(*sorted({heavy!r} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
