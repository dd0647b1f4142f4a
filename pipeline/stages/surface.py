"""Surface: a scan file or a recipe -> a levelled, centred height field and its statistics."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from pipeline.accuracy import exact
from pipeline.config.models import Config
from pipeline.diffraction.reference import MeanReference
from pipeline.errors import InputError
from pipeline.progress import Progress
from pipeline.stages.stage import Inputs, Stage, Summary
from pipeline.store import arrays, digest
from pipeline.store.store import Artifact
from pipeline.surface import recipes
from pipeline.surface.conditioning import condition
from pipeline.surface.heightfield import HeightField
from pipeline.surface.statistics import SurfaceStatistics, measure

_FILE = "surface.zarr"
# less than this share of the frequencies a view can reach, and the bake would show next to nothing
_LEAST_KNOWN = 0.05
# pitches that differ by more are no rounding of square pixels
_SQUARE = 0.01


def _parameters(config: Config) -> dict[str, Any]:
    section = {**config.surface.model_dump(mode="json"), "level": config.surface.levelling}
    if config.surface.path is not None:
        section["path"] = {"sha256": digest.of_file(Path(config.surface.path))}
    # the statistics compare the surface with the window and the wavelengths
    return {
        "surface": section,
        "sigma_um": config.coherence.sigma_um,
        "lambda_min_nm": config.light.lambda_min_nm,
    }


def _produce(config: Config, _inputs: Inputs, folder: Path, progress: Progress) -> Summary:
    progress("surface", 0.0)
    scan = None
    if config.surface.recipe is not None:
        field = recipes.make(config.surface.recipe)
    else:
        from pipeline.surface.load import load_scan

        field, record = load_scan(config.surface)
        scan = asdict(record)
    field, cleaning = condition(field, config.surface.levelling, config.surface.clip_percentile)
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
    progress("surface", 1.0)
    return {
        "scan": scan,
        "conditioning": asdict(cleaning),
        "statistics": asdict(statistics),
        "warnings": _warnings(statistics, config.coherence.sigma_um, lambda_min, is_scan=scan is not None),
    }


def _warnings(statistics: SurfaceStatistics, sigma_um: float, lambda_min_nm: float, *, is_scan: bool) -> list[str]:
    """What a user should know before trusting the bake. Raises InputError for a hopelessly coarse pitch."""
    found = []
    known = statistics.reach_covered
    pitch = max(statistics.pitch_um)
    finest = 0.25e-3 * lambda_min_nm
    if known < _LEAST_KNOWN:
        raise InputError(
            f"surface: a pitch of {pitch:g} um tells nothing of {100 * (1 - known):.1f} % of the frequencies that a "
            f"view can reach at {lambda_min_nm:g} nm; scan with {finest:.3f} um or finer, or use longer wavelengths"
        )
    if known < 0.9995:
        found.append(
            f"the pitch of {pitch:g} um is too coarse for {lambda_min_nm:g} nm: {100 * (1 - known):.1f} % of the "
            f"frequencies that a view can reach are unknown and taken as dark ({finest:.3f} um would know all)"
        )
    x, y = statistics.pitch_um
    if is_scan and abs(x / y - 1.0) > _SQUARE:
        found.append(
            f"the pitch differs along x and y ({x:.4g} x {y:.4g} um): right for a scan of fewer lines, wrong for one "
            "that was cut without its size"
        )
    if min(statistics.windows) < 3.99:
        found.append(
            f"the patch ({statistics.size_um[0]:.4g} x {statistics.size_um[1]:.4g} um) is smaller than the coherence "
            f"window (4 sigma = {4 * sigma_um:g} um) and repeats under it: repeats are seen as orders of their own, "
            f"and the seams between them hold {100 * statistics.seam_energy:.2g} % of the heights' energy"
        )
    return found


def of(inputs: Inputs) -> HeightField:
    """The height field that a stage is given."""
    return inputs.session.get("height field", lambda: load(inputs["surface"]))


def reference_of(config: Config, inputs: Inputs, progress: Progress) -> MeanReference:
    """The exact reference of the height field that a stage is given: table, validation and bundle share it."""
    return inputs.session.get("reference", lambda: exact.reference_of(of(inputs), config, progress))


def load(artifact: Artifact) -> HeightField:
    """The height field of a surface artifact."""
    zarr = artifact.folder / _FILE
    pitch = arrays.attributes(zarr)["pitch_um"]
    return HeightField(arrays.load(zarr, "height"), (pitch[0], pitch[1]))


SURFACE = Stage("surface", 3, (), _parameters, _produce)
