"""No device: reported before any work, with the remedy. Each test has a process, which finds its device once."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np
import pyopencl
import pytest

from kernels import device, source
from tests.cli.tool import REPOSITORY, Tool

NO_DEVICE = {"DIFFRACT_BAKE_DEVICE": "nonsense"}


@pytest.mark.parametrize("command", ["run", "validate", "publish"])
def test_without_a_device_nothing_is_begun(tool: Tool, command: str) -> None:
    result = tool.process(command, tool.config(), environment=NO_DEVICE)
    assert result.code == 5
    (line,) = result.errors
    assert "DIFFRACT_BAKE_DEVICE asks for 'nonsense', and none is named like 'nonsense'" in line
    assert "unset it" in line
    assert "install" not in line
    assert "Traceback" not in result.stderr
    assert tool.artifacts() == {}
    assert not tool.out.exists()


def test_cached_stages_need_no_device(baked: Tool) -> None:
    assert baked.process("run", "small.toml", environment=NO_DEVICE).code == 0


def test_doctor_without_a_device(tool: Tool) -> None:
    result = tool.process("doctor", environment=NO_DEVICE)
    assert result.code == 5
    assert "works" in result.stdout
    assert len(result.errors) == 1
    assert "DIFFRACT_BAKE_DEVICE" in result.errors[0]


def test_without_any_driver(tool: Tool) -> None:
    # the loader looks for drivers there; an empty folder holds none
    drivers = tool.folder / "vendors"
    drivers.mkdir()
    result = tool.process("doctor", environment={"OCL_ICD_VENDORS": str(drivers), "OPENCL_VENDOR_PATH": str(drivers)})
    assert result.code == 5
    assert "none is listed" in result.errors[0]
    assert "apt-get install pocl-opencl-icd" in result.errors[0]


def test_doctor(tool: Tool) -> None:
    result = tool("doctor")
    assert result.code == 0
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["device", "units", "kernel"]
    assert any(line.endswith("works") for line in lines[1:])
    assert lines[-1].startswith("in use: ")
    assert any(line.split()[:1] == ["numpy"] for line in lines)


def test_doctor_for_machines(tool: Tool) -> None:
    printed = tool("doctor", "--json").json
    used = tool("doctor").stdout.splitlines()[-1]
    assert any(not d["fault"] and d["device"] in used for d in printed["devices"])
    assert printed["versions"]["diffract-bake"]


def test_a_device_without_a_context_is_a_fault_and_no_traceback() -> None:
    """A driver that lists a device and cannot open it is reported by doctor, next to those that work."""
    refused = mock.patch.object(pyopencl, "Context", side_effect=pyopencl.Error("no such context"))
    platform, listed = device._listed()[0]
    with refused:
        probe = device._probe(platform, listed)
    assert "no such context" in probe.fault
    assert probe.context is None


def test_errors_of_the_compiler_come_through() -> None:
    broken = mock.patch.object(source, "text", return_value="__kernel void broken() { undeclared = 1; }")
    with broken, pytest.raises(pyopencl.Error, match="undeclared"):
        device.Program(("broken.cl",), {})


def test_a_kernel_runs_on_narrow_and_wide_grids() -> None:
    """PoCL compiles it for each of them, and pyopencl would warn if its kernel were looked up twice by name."""
    text = "__kernel void count(__global int *x) { x[get_global_id(0)] = get_global_id(0); }"
    with mock.patch.object(source, "text", return_value=text):
        program = device.Program(("count.cl",), {})
    for items in (10, 2**16, 20):
        found = np.zeros(items, np.int32)
        buffer = device.result_buffer(found.nbytes)
        program.launch("count", (items, 1), buffer)
        assert np.array_equal(device.download(buffer, found), np.arange(items))


@dataclass(frozen=True)
class Listed:
    """The attributes of a platform or a device that the choice reads."""

    name: str
    type: int = 0


POCL, OTHER = Listed("Portable Computing Language"), Listed("Another maker's")


@pytest.mark.parametrize(
    ("platform", "kind", "wanted", "taken"),
    [
        (POCL, "CPU", "", True),
        (POCL, "GPU", "", False),
        (OTHER, "GPU", "", False),
        (OTHER, "CPU", "", False),
        (OTHER, "GPU", "fast", True),
        (OTHER, "GPU", "maker", True),
        (POCL, "CPU", "fast", True),
        (POCL, "CPU", "slow", False),
    ],
)
def test_pocls_cpu_is_the_default_and_others_must_be_named(
    platform: Listed, kind: str, wanted: str, taken: bool
) -> None:
    listed = Listed("Fast Processor", getattr(pyopencl.device_type, kind))
    assert device._is_asked_for(platform, listed, wanted) is taken


def test_kernels_can_be_built_for_a_processor_without_avx512(tmp_path: Path) -> None:
    """As `make test-avx2` asks for: blocks follow what the compiler builds for, not what the processor has."""
    processor = Path("/proc/cpuinfo")
    if not processor.exists() or "avx2" not in processor.read_text():
        pytest.skip("this processor has no AVX2")
    script = "from kernels import device; print(device.default_device().vector_width)"
    avx2 = {"POCL_KERNELLIB_NAME": "avx2", "POCL_LLVM_CPU_NAME": "haswell", "XDG_CACHE_HOME": str(tmp_path)}
    printed = subprocess.run(
        [sys.executable, "-c", script], env={**os.environ, **avx2}, cwd=REPOSITORY, capture_output=True, text=True
    )
    assert printed.stdout == "8\n", printed.stderr
