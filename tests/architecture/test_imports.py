"""The arrows of the design: cli -> pipeline -> kernels, physics apart from stages, heavy libraries on demand."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("cli", "pipeline", "kernels")
HEAVY = {"matplotlib", "zarr", "colour", "pyopencl", "OpenEXR", "PIL", "SurfaceTopography", "jinja2"}
STAGE_FREE = ("tables", "fourier", "diffraction", "accuracy", "optics", "surface")


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


def is_script(statement):
    """Whether a statement is `if __name__ == "__main__":`."""
    return isinstance(statement, ast.If) and ast.unparse(statement.test) == "__name__ == '__main__'"


def relative(path):
    return path.relative_to(ROOT).as_posix()


def offenders(places, *packages):
    """Which files import any of the packages, anywhere in them."""
    found = {relative(path): within(anywhere(path), *packages) for path in sources(*places)}
    return {path: names for path, names in found.items() if names}


def test_the_walk_sees_imports():
    """The walk itself finds what is there: a check of nothing would pass everything."""
    assert all(len(list(sources(room))) > 1 for room in ROOMS)
    assert within(anywhere(ROOT / "pipeline/stages/run.py"), "pipeline.stages", "numpy") >= {"pipeline.stages.render"}
    assert "pyopencl" in anywhere(ROOT / "kernels/device.py")


def test_kernels_stand_alone():
    """Kernel code knows neither the pipeline nor the command line."""
    assert offenders(["kernels"], "pipeline", "cli") == {}


def test_pipeline_knows_no_command_line():
    """The pipeline can be imported by anything, so it imports no front end."""
    assert offenders(["pipeline"], "cli", "click", "rich") == {}


def test_only_the_device_module_talks_to_opencl():
    """One place opens devices and holds buffers."""
    assert set(offenders(ROOMS, "pyopencl")) == {"kernels/device.py"}


def test_only_the_fourier_room_talks_to_fftw():
    """One room plans transforms and keeps wisdom; the bench measures through it."""
    found = offenders(ROOMS, "pyfftw")
    assert found
    assert {path.rpartition("/")[0] for path in found} == {"pipeline/fourier"}


def test_only_the_command_line_evaluates():
    """Nothing that users bake with depends on what measures it against the literature."""
    product = [path for path in (ROOT / "pipeline").iterdir() if path.name not in ("evaluation", "__pycache__")]
    assert offenders([relative(path) for path in product], "pipeline.evaluation") == {}


def test_physics_knows_no_stages():
    """Closed forms, tables and sums run without the store or the order of stages."""
    assert offenders([f"pipeline/{place}" for place in STAGE_FREE], "pipeline.stages") == {}
    assert offenders(["pipeline/diffraction", "pipeline/optics", "pipeline/tables"], "pipeline.store") == {}


def test_physics_knows_no_config():
    """Closed forms, transforms and tables take values; only stages and what is above them open a config."""
    rooms = ("optics", "surface", "fourier", "diffraction", "tables")
    assert offenders([f"pipeline/{room}" for room in rooms], "pipeline.config") == {}


@pytest.mark.parametrize("room", ["pipeline", "kernels"])
def test_libraries_do_not_print(room):
    """Text for people is the command line's; what a file does when it is run as a script is its own."""
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
    "module", ["pipeline.config.models", "pipeline.store.store", "pipeline.stages.run", "cli.main"]
)
def test_planning_loads_no_heavy_library(module):
    """What a plan needs is there at once: heavy libraries wait for the stage that uses them."""
    script = f"import sys, {module}; print(*sorted({HEAVY!r} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
