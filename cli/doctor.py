"""`doctor`: devices, versions, and the remedy where no device works."""

import click

from cli import console


@click.command("doctor")
@console.json_option
def doctor_command(as_json: bool) -> None:
    """Compile and run a kernel on every OpenCL device; report which ones work, and the remedy where none does.

    Exit code 5 where no device works. DIFFRACT_BAKE_DEVICE chooses a device by a part of its name.
    """
    from kernels import device
    from pipeline.diffraction.device import require_device
    from pipeline.stages import provenance

    probes = device.probe_devices()
    versions = provenance.versions()
    if as_json:
        fields = ("platform", "device", "driver", "compute_units", "memory_bytes", "fault")
        found = [{name: getattr(probe, name) for name in fields} for probe in probes]
        console.print_json({"devices": found, "versions": versions})
    else:
        rows = [[p.device, str(p.compute_units), p.fault or "works"] for p in probes]
        console.print_table(["device", "units", "kernel"], rows)
        console.print_table(["library", "version"], list(versions.items()))
    require_device()
    used = device.default_device()
    if not as_json:
        console.say(f"in use: {used.name}")
