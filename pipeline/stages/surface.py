"""The stage "surface": a scan file or a recipe -> a levelled, centred height field and its statistics."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from pipeline import resources
from pipeline.accuracy import exact
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.errors import InputError
from pipeline.progress import Progress
from pipeline.resources import Need, largest
from pipeline.stages.foreseen import base
from pipeline.stages.stage import Inputs, Stage, Summary
from pipeline.store import arrays, digest
from pipeline.store.arrays import saving_bytes
from pipeline.store.store import Artifact
from pipeline.surface import recipes
from pipeline.surface.conditioning import ConditioningRecord, condition
from pipeline.surface.extent import Extent
from pipeline.surface.heightfield import HeightField
from pipeline.surface.readers import require_file
from pipeline.surface.source import SurfaceSource
from pipeline.surface.statistics import SurfaceStatistics, measure, measuring_bytes

_FILE = "surface.zarr"
# the smallest share of the visible frequencies within the Nyquist limits with which a bake makes sense
_LEAST_KNOWN = 0.05
# a scan is mounted flatter than this; cliffs between heights and other numbers are levelled as slopes
_STEEP_DEG = 10.0
# a larger relative difference of the pitches is not due to the rounding of square pixels
_SQUARE = 0.01


def _parameters(config: Config) -> dict[str, Any]:
    section = {**config.surface.model_dump(mode="json"), "level": config.surface.levelling}
    if config.surface.path is not None:
        require_file(Path(config.surface.path))
        section["path"] = {"sha256": digest.of_source(Path(config.surface.path))}
    # the statistics depend on the window and the shortest wavelength
    return {
        "surface": section,
        "sigma_um": config.coherence.sigma_um,
        "lambda_min_nm": config.light.lambda_min_nm,
    }


def _produce(config: Config, inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    progress("surface", 0.0)
    field, cleaning, scan = field_of(config)
    _require_unchanged(config, inputs)
    lambda_min = config.light.lambda_min_nm
    statistics = measure(field, config.coherence.sigma_um, lambda_min)
    x, y = field.coordinates_um()
    arrays.save(
        folder / _FILE,
        {
            "height": arrays.Named(field.heights_um, ("y", "x"), "um"),
            "x": arrays.Named(x, ("x",), "um"),
            "y": arrays.Named(y, ("y",), "um"),
        },
        {"pitch_um": list(field.pitch_um), "convention": "y up with the row index"},
    )
    inputs.keep(field)
    progress("surface", 1.0)
    return {
        "scan": scan,
        "conditioning": asdict(cleaning),
        "statistics": asdict(statistics),
        "warnings": [
            *([] if scan is None else scan["warnings"]),
            *_slope_warnings(cleaning),
            *_warnings(statistics, config.coherence.sigma_um, lambda_min, is_scan=scan is not None),
        ],
    }


def _require_unchanged(config: Config, inputs: Inputs) -> None:
    """Raises InputError where the scan is no longer the one that was planned for, whose digest is in the address."""
    if SURFACE.key(config, {}) != inputs.address:
        raise InputError(f"{config.surface.path}: the scan has changed since the bake began; bake it again")


def field_of(config: Config) -> tuple[HeightField, ConditioningRecord, dict[str, Any] | None]:
    """Makes or reads the height field of a config and conditions it.

    Returns the field, the changes that were made to it, and the record of a scan, None for a recipe.
    Raises InputError for a scan that cannot be read or trusted, ResourceError for one that is too large to measure.
    """
    scan = None
    if config.surface.recipe is not None:
        field = recipes.make(config.surface.recipe)
    else:
        from pipeline.surface.load import load_scan

        field, record = load_scan(config.surface)
        scan = asdict(record)
        ny, nx = field.shape
        measuring = measuring_bytes(field.extent, config.light.lambda_min_nm)
        resources.require(f"the statistics of {nx} x {ny} samples", measuring, "crop the scan")
    return *condition(field, config.surface.levelling, config.surface.clip_percentile), scan


def need(source: SurfaceSource, extent: Extent, lambda_min_nm: float) -> Need:
    """Computes memory and time of this stage from its samples.

    A recipe is made, or a scan conditioned in five arrays, fewer where nothing is filled or clipped; then the
    conditioned field is measured.
    """
    making = 5 * extent.bytes if source.recipe is None else recipes.making_bytes(source.recipe, extent.samples)
    measuring = measuring_bytes(extent, lambda_min_nm)
    arrays = largest(
        {"making of the heights": making + extent.bytes},
        {"height field": extent.bytes, "statistics of the heights": measuring},
        {"height field": extent.bytes, "writing": saving_bytes(extent.bytes)},
    )
    return Need({**base("surface"), **arrays}, 1e-6 * extent.samples)


def extent_in(summary: Summary) -> Extent:
    """Reads the extent of the height field in the summary of this stage."""
    statistics = summary["statistics"]
    shape, pitch = statistics["shape"], statistics["pitch_um"]
    return Extent((shape[0], shape[1]), (pitch[0], pitch[1]), 0.5 * statistics["range_um"])


def _slope_warnings(cleaning: ConditioningRecord) -> list[str]:
    """Tells of a steep slope, which levelling removed."""
    x, y = cleaning.slope_deg
    if max(abs(x), abs(y)) <= _STEEP_DEG:
        return []
    remedy = "check units and pitch, and that all numbers are heights"
    return [f"a slope of {x:.3g} x {y:.3g} degrees was levelled, steeper than any sample is mounted: {remedy}"]


def _warnings(statistics: SurfaceStatistics, sigma_um: float, lambda_min_nm: float, *, is_scan: bool) -> list[str]:
    """Lists warnings about the surface for the user, one sentence each.

    Raises InputError where nearly all visible frequencies lie beyond the scan's Nyquist limits.
    """
    found = []
    known = statistics.reach_covered
    pitch = max(statistics.pitch_um)
    finest = 0.25e-3 * lambda_min_nm
    if known < _LEAST_KNOWN:
        raise InputError(
            f"surface: the pitch of {pitch:g} um is too coarse: {100 * (1 - known):.1f} % of the frequencies visible "
            f"at {lambda_min_nm:g} nm lie beyond its Nyquist limit; rescan with {finest:.3f} um or finer, or use "
            "longer wavelengths"
        )
    if known < 0.9995:
        found.append(
            f"the pitch of {pitch:g} um is too coarse for {lambda_min_nm:g} nm: {100 * (1 - known):.1f} % of the "
            f"visible frequencies lie beyond its Nyquist limit and count as dark ({finest:.3f} um would cover all)"
        )
    x, y = statistics.pitch_um
    if is_scan and abs(x / y - 1.0) > _SQUARE:
        found.append(
            f"the pitch differs along x and y ({x:.4g} x {y:.4g} um): this is right for a scan with fewer lines, and "
            "wrong for a cropped scan whose file still states the original size; if it is wrong, "
            "set surface.pitch_um and override_file_units = true"
        )
    if min(statistics.windows) < 3.99:
        found.append(
            f"the patch ({statistics.size_um[0]:.4g} x {statistics.size_um[1]:.4g} um) is smaller than the coherence "
            f"window (4 sigma = {4 * sigma_um:g} um) and repeats under it: the repetition adds diffraction orders, "
            f"and the seams between the copies hold {100 * statistics.seam_energy:.2g} % of the heights' energy"
        )
    return found


def of(inputs: Inputs) -> HeightField:
    """Returns the height field of a stage's inputs."""
    return inputs.shared("surface", load)


def reference_of(config: Config, inputs: Inputs, progress: Progress) -> Reference:
    """Returns the exact reference of the height field, which stages share, and configs that differ in light only."""
    session = inputs.session
    name = f"reference of {inputs['surface'].key}"
    reference = session.derived(name, lambda: exact.reference_of(of(inputs), config, progress))
    reference.following = [(one.light, one.material) for one in session.following]
    return reference


def load(artifact: Artifact) -> HeightField:
    """Reads the height field of an artifact of this stage."""
    zarr = artifact.folder / _FILE
    pitch = arrays.attributes(zarr)["pitch_um"]
    return HeightField(arrays.load(zarr, "height"), (pitch[0], pitch[1]))


SURFACE = Stage("surface", 10, (), _parameters, _produce)
