"""No device: told before any work, with the remedy. A device is found once a process, so each has its own."""

import pytest

from tests.cli.tool import Tool

NO_DEVICE = {"DIFFRACT_BAKE_DEVICE": "nonsense"}


@pytest.mark.parametrize("command", ["run", "validate", "publish"])
def test_without_a_device_nothing_is_begun(tool: Tool, command: str) -> None:
    result = tool.process(command, tool.config(), environment=NO_DEVICE)
    assert result.code == 5
    (line,) = result.errors
    assert "no working OpenCL device named like 'nonsense' (from DIFFRACT_BAKE_DEVICE)" in line
    assert "apt-get install pocl-opencl-icd" in line
    assert "Traceback" not in result.stderr
    assert tool.artifacts() == {}
    assert not tool.out.exists()


def test_what_is_cached_needs_no_device(baked: Tool) -> None:
    assert baked.process("run", "small.toml", environment=NO_DEVICE).code == 0


def test_doctor_without_a_device(tool: Tool) -> None:
    result = tool.process("doctor", environment=NO_DEVICE)
    assert result.code == 5
    assert "works" in result.stdout
    assert len(result.errors) == 1
    assert "pocl-opencl-icd" in result.errors[0]


def test_without_any_driver(tool: Tool) -> None:
    # the loader looks for drivers there; an empty folder holds none
    drivers = tool.folder / "vendors"
    drivers.mkdir()
    result = tool.process("doctor", environment={"OCL_ICD_VENDORS": str(drivers), "OPENCL_VENDOR_PATH": str(drivers)})
    assert result.code == 5
    assert "none is listed" in result.errors[0]


def test_doctor(tool: Tool) -> None:
    result = tool("doctor")
    assert result.code == 0
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["device", "units", "kernel"]
    assert any(line.endswith("works") for line in lines[1:])
    assert lines[-1].startswith("in use: ")
    assert any(line.split()[:1] == ["numpy"] for line in lines)


def test_doctor_for_machines(tool: Tool) -> None:
    told = tool("doctor", "--json").json
    used = tool("doctor").stdout.splitlines()[-1]
    assert any(not d["fault"] and d["device"] in used for d in told["devices"])
    assert told["versions"]["diffract-bake"]
