"""Loads a scan file as a height field in micrometres, with its values and units checked."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.surface.heightfield import HeightField
from pipeline.surface.holes import Measured, Unmeasured, far_apart, measured_part
from pipeline.surface.readers import read_scan
from pipeline.surface.readers.common import MIN_SAMPLES, check_shape, fault, micrometres, one_line
from pipeline.surface.readers.header import may_state_scale
from pipeline.surface.scan import Scan
from pipeline.surface.source import SurfaceSource
from pipeline.validated import as_pair

# relative tolerance within which a config key agrees with the value in the file
_AGREES = 1e-3
_PITCH_UM = (1e-4, 100.0)
_RANGE_UM = (1e-6, 100.0)
_OVERRIDE = "remove the key, or set surface.override_file_units = true"

# where a unit or a pitch was found
Origin = Literal["file", "config"]


@dataclass(frozen=True)
class ScanRecord:
    """The source of a height field; it can be written as JSON, and names no folder of this machine.

    file: its name. format, reader: the format in words, and the library that read it. channel, channels: the channel
        read, and all that may hold heights.
    shape: samples (ny, nx), after cropping. pitch_um: sample distance along (x, y), um. um_per_unit: micrometres per
        stored unit or image code. pitch_from, unit_from: the origin of these values.
    unmeasured: what was found of samples without a measured height, and unmeasured_share: their share of the file's.
    cropped: rows or columns without any measured height, removed at the (bottom, top, left, right).
    holes: number of samples of `shape` without a height, which are filled. masked_share: share of the samples that a
        mask of the file covers.
    warnings: sentences for the user about all this.
    """

    file: str
    format: str
    reader: str
    channel: str
    channels: tuple[str, ...]
    shape: tuple[int, int]
    pitch_um: tuple[float, float]
    pitch_from: Origin
    um_per_unit: float
    unit_from: Origin
    unmeasured: tuple[Unmeasured, ...]
    unmeasured_share: float
    cropped: tuple[int, int, int, int]
    holes: int
    masked_share: float
    warnings: tuple[str, ...]


def load_scan(surface: SurfaceSource) -> tuple[HeightField, ScanRecord]:
    """Loads the scan of `surface.path`; units in the file win over keys, unless `override_file_units` is set.

    surface: a config's [surface].
    Returns the field, um, with holes as NaN, and the record of its source.
    Raises InputError where the file cannot be read, where units are missing (the message names every key to set) or
    contradict each other, and where the values cannot be a height map.
    """
    if surface.path is None:
        raise ValueError("load_scan reads files; this surface is a recipe")
    path = Path(surface.path)
    scan = read_scan(path, surface.channel)
    _check_values(path.name, scan.heights)
    measured = measured_part(scan, surface.mask, surface.no_data)
    _check_holes(path.name, measured, surface.max_hole_share)
    unit, pitch = _units(path.name, scan, surface)
    # the scan serves nothing else; what a reader took from a file's bytes cannot be changed
    heights = measured.heights
    heights = np.multiply(heights, unit[0], out=heights if heights.flags.writeable else None)
    _check_pitch(path.name, pitch[0])
    _check_range(path.name, heights, unit, scan.full_code is not None)
    field = HeightField(heights, pitch[0])
    populations = far_apart(heights)
    record = ScanRecord(
        file=path.name,
        format=scan.format,
        reader=scan.reader,
        channel=scan.channel,
        channels=scan.channels,
        shape=field.shape,
        pitch_um=pitch[0],
        pitch_from=pitch[1],
        um_per_unit=unit[0],
        unit_from=unit[1],
        unmeasured=measured.unmeasured,
        unmeasured_share=measured.share,
        cropped=measured.cropped,
        holes=measured.holes,
        masked_share=measured.masked_share,
        warnings=(*scan.warnings, *measured.warnings, *(() if populations is None else (populations,))),
    )
    return field, record


def refusals(file: str, scan: Scan, measured: Measured) -> list[str]:
    """Lists the reasons for which `load_scan` refuses a scan with the default settings, apart from missing units.

    file: its name. scan: as read. measured: its measured part.
    Returns one sentence for each; none where a bake can start.
    """
    largest_share: float = SurfaceSource.model_fields["max_hole_share"].default
    checks: list[Callable[[], None]] = [
        lambda: _check_values(file, scan.heights),
        lambda: _check_holes(file, measured, largest_share),
    ]
    if scan.pitch_um is not None:
        pitch_um = scan.pitch_um
        checks.append(lambda: _check_pitch(file, pitch_um))
    if np.isfinite(measured.heights).any():
        checks.append(lambda: _check_heights(file, measured.heights, scan.um_per_unit))
    found = []
    for check in checks:
        try:
            check()
        except InputError as error:
            found.append(str(error))
    return found


# --- values ------------------------------------------------------------------------------------------


def _check_values(file: str, heights: NDArray[np.float64]) -> None:
    """Raises InputError for a shape or for values that no height map has."""
    check_shape(file, heights.shape)
    infinite = int(np.count_nonzero(np.isinf(heights)))
    if infinite:
        raise fault(file, "finite heights", f"{infinite} infinite values", "write holes as NaN, correct the others")
    if np.isnan(heights).all():
        raise fault(file, "heights", "NaN everywhere", "export it again, or set surface.channel")


def _check_holes(file: str, measured: Measured, largest_share: float) -> None:
    """Raises InputError where too little of a scan was measured."""
    what = "; ".join(str(entry) for entry in measured.unmeasured)
    ny, nx = measured.heights.shape
    if measured.share == 1.0 or min(ny, nx) < MIN_SAMPLES:
        found = "none" if measured.share == 1.0 else f"{ny} x {nx} (rows x columns)"
        raise fault(
            file,
            f"at least {MIN_SAMPLES} measured samples along each axis",
            f"{found}, for {100 * measured.share:.3g} % was not measured ({what})",
            "take a whole scan, or name the numbers that mean no data in surface.no_data",
        )
    if measured.holes > largest_share * ny * nx:
        raise fault(
            file,
            f"holes in no more than {100 * largest_share:g} % of the scan",
            f"{measured.holes} holes in {ny * nx} samples ({what})",
            "crop to the measured part, or raise surface.max_hole_share: what is filled scatters no light",
        )


def _check_pitch(file: str, pitch_um: tuple[float, float]) -> None:
    low, high = _PITCH_UM
    if not all(low <= p <= high for p in pitch_um):
        raise fault(
            file,
            f"a pitch within {low:g}..{high:g} um",
            f"{pitch_um[0]:.6g} x {pitch_um[1]:.6g} um",
            "mislabelled units? set surface.pitch_um (and override_file_units = true where the file states a pitch)",
        )


def _check_heights(file: str, heights: NDArray[np.float64], um_per_unit: float | None) -> None:
    """Raises InputError for heights that do not vary, and where their unit is known, for a range of no surface."""
    if um_per_unit is None:
        _check_varies(file, heights)
    else:
        _check_range(file, heights * um_per_unit, (um_per_unit, "file"), is_image=False)


def _check_varies(file: str, heights: NDArray[np.float64]) -> None:
    if np.nanmax(heights) == np.nanmin(heights):
        raise fault(
            file,
            "heights that vary",
            "the same height everywhere",
            "for a mirror use surface.recipe = { kind = 'mirror' }",
        )


def _check_range(file: str, heights_um: NDArray[np.float64], unit: tuple[float, Origin], is_image: bool) -> None:
    _check_varies(file, heights_um)
    found = float(np.nanmax(heights_um) - np.nanmin(heights_um))
    low, high = _RANGE_UM
    if not low <= found <= high:
        key = "surface.height_range_um" if is_image else "surface.height_unit"
        override = " and surface.override_file_units = true" if unit[1] == "file" else ""
        raise fault(
            file,
            f"a height range within {low:g}..{high:g} um",
            f"{found:.6g} um, with {unit[0]:.6g} um per stored unit (from the {unit[1]})",
            f"mislabelled units? set {key}{override}",
        )


# --- units -------------------------------------------------------------------------------------------


def _units(
    file: str, scan: Scan, surface: SurfaceSource
) -> tuple[tuple[float, Origin], tuple[tuple[float, float], Origin]]:
    """Determines (um per stored unit, its origin) and (pitch in um, its origin).

    Raises InputError, which names every missing key at once.
    """
    unit = _unit(file, scan, surface)
    pitch = _pitch(file, scan, surface)
    if unit is not None and pitch is not None:
        _check_unread(file, scan, surface, (unit[1], pitch[1]))
        return unit, pitch
    missing = []
    if pitch is None:
        missing.append("surface.pitch_um (sample distance in um)")
    if unit is None and scan.full_code is None:
        missing.append("surface.height_unit ('nm', 'um', ...)")
    if unit is None and scan.full_code is not None:
        missing.append(f"surface.height_range_um (height in um of code {scan.full_code:g} above 0)")
    raise fault(file, "units", f"a file ({scan.format}) that does not state them", f"set {' and '.join(missing)}")


def _unit(file: str, scan: Scan, surface: SurfaceSource) -> tuple[float, Origin] | None:
    if scan.full_code is not None:
        return _unit_of_image(file, scan.full_code, scan.um_per_unit, surface)
    if surface.height_range_um is not None:
        found = "surface.height_range_um, which is for 8- and 16-bit images"
        raise fault(file, "heights with a unit", found, "use surface.height_unit instead")
    configured = None if surface.height_unit is None else micrometres(surface.height_unit)
    if scan.um_per_unit is None:
        return None if configured is None else (configured, "config")
    if configured is None or _agree(configured, scan.um_per_unit):
        return scan.um_per_unit, "file"
    if surface.override_file_units:
        return configured, "config"
    found = f"heights stored in {scan.um_per_unit:g} um, but surface.height_unit = '{surface.height_unit}'"
    raise fault(file, "units that agree", f"{found} ({configured:g} um)", _OVERRIDE)


def _unit_of_image(
    file: str, full_code: float, stated: float | None, surface: SurfaceSource
) -> tuple[float, Origin] | None:
    if surface.height_unit is not None:
        found = f"surface.height_unit = '{surface.height_unit}', but an image holds codes 0..{full_code:g}"
        raise fault(file, "a height range", found, "set surface.height_range_um instead")
    if surface.height_range_um is None:
        return None if stated is None else (stated, "file")
    configured = surface.height_range_um / full_code
    if stated is None or surface.override_file_units:
        return configured, "config"
    if _agree(configured, stated):
        return stated, "file"
    found = f"{stated * full_code:.6g} um in the file, but surface.height_range_um = {surface.height_range_um:g}"
    raise fault(file, "height ranges that agree", found, _OVERRIDE)


def _pitch(file: str, scan: Scan, surface: SurfaceSource) -> tuple[tuple[float, float], Origin] | None:
    configured = None if surface.pitch_um is None else as_pair(surface.pitch_um)
    if scan.pitch_um is None:
        if configured is not None and not surface.override_file_units:
            _check_ratio(file, scan.steps, configured)
        return None if configured is None else (configured, "config")
    if configured is None or all(_agree(a, b) for a, b in zip(configured, scan.pitch_um, strict=True)):
        return scan.pitch_um, "file"
    if surface.override_file_units:
        return configured, "config"
    found = f"{_pair(scan.pitch_um)} um in the file, but surface.pitch_um = {_pair(configured)}"
    raise fault(file, "pitches that agree", found, _OVERRIDE)


def _check_ratio(file: str, steps: tuple[float, float] | None, configured: tuple[float, float]) -> None:
    """Holds a configured pitch against the ratio of x to y, which a file states even without a unit."""
    if steps is None or min(steps) <= 0 or _agree(configured[0] * steps[1], configured[1] * steps[0]):
        return
    found = f"steps of {_pair(steps)} (of no stated unit) in the file, but surface.pitch_um = {_pair(configured)}"
    on_y = configured[0] * steps[1] / steps[0]
    way_out = f"set surface.pitch_um = [{configured[0]:.6g}, {on_y:.6g}], or surface.override_file_units = true"
    raise fault(file, "a pitch with the file's ratio of x to y", found, way_out)


def _check_unread(file: str, scan: Scan, surface: SurfaceSource, origins: tuple[Origin, Origin]) -> None:
    """Refuses a unit or a pitch of the config where the file's header may state another in words not understood."""
    doubtful = [line for line in scan.unread if may_state_scale(line)]
    if not doubtful or surface.override_file_units or "config" not in origins:
        return
    listed = one_line("; ".join(repr(line) for line in doubtful), 160)
    raise fault(
        file,
        "a header whose units and factors are understood",
        f"lines that may state them: {listed}",
        "write 'Width: 10 um', 'Height: 10 um' and 'Value units: nm' in their place, "
        "or set surface.override_file_units = true if your keys are right",
    )


def _agree(a: float, b: float) -> bool:
    return abs(a - b) <= _AGREES * abs(b)


def _pair(value: tuple[float, float]) -> str:
    return f"{value[0]:.6g} x {value[1]:.6g}"
