"""The entries of a manifest that do not depend on the table's layout, from a config and its artifacts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.accuracy import scalar_domain
from pipeline.bundle.manifest import Colour, Coverage, Domain, MadeBy, Provenance
from pipeline.config.models import Config
from pipeline.optics.light import LaserLine
from pipeline.store.digest import of_source
from pipeline.store.store import Artifact
from pipeline.surface.periods import Period

_NOT_RECORDED = "not recorded"
_LUMINOUS_NM = 550.0
_LIBRARIES = ("numpy", "pyFFTW", "pyopencl", "zarr", "OpenEXR")

CONVENTIONS = {
    "directions": "unit vectors pointing away from the surface; z is its normal, x grows with the column",
    "y": "up: y grows with the height field's row index",
    "azimuth": "from +x towards +y",
    "uvw": "(u, v, w) = -wi - wr, wi towards the light, wr towards the viewer; so -2 <= w < 0",
    "P": "P(f) = sum g exp(i k w h) exp(+2 pi i f.x) / sum g at f = (u, v) / lambda, k = 2 pi / lambda; by "
    "this sign a plane rising towards +x reflects towards -x",
    "window": "g = exp(-r^2 / (2 sigma^2)), centred on the middle of the patch",
    "boundary": "the patch repeats periodically under the window",
}
_RU = "1 RU is the radiance of a flat sample of this material (|P(0)|^2 = 1) along its normal, in its reflection: "
RU = {
    "relative": f"{_RU}Y = 1, which saturates a screen at an exposure of 1 RU",
    "absolute": f"{_RU}Y = colour.mirror_y, in 1/sr, which saturates a screen at an exposure of 1 RU",
}
XYZ_UNIT = {
    "relative": "RU (normalisation relative, eq. 4 of Dhillon et al. 2014)",
    "absolute": "1/sr (normalisation absolute), a BRDF times cos(theta_i)",
}
_WHITE = {
    "relative": "a flat sample of this material along its normal, in its reflection, has Y = 1; X and Z are those of "
    "the light that it reflects",
    "absolute": "a flat sample of this material along its normal, in its own reflection, has Y = mirror_y, 1/sr",
}


def units(config: Config, table: str) -> dict[str, str]:
    """Returns the unit of each kind of number in the bundle; table: name of the quantity in the tables."""
    absolute = config.material.normalisation == "absolute"
    return {
        table: "1/sr" if absolute else "1",
        "XYZ": XYZ_UNIT[config.material.normalisation],
        "u, v, w": "1",
        "lengths": "um",
        "wavelengths": "nm",
        "angles": "degrees in files, radians in formulas",
    }


def colour(config: Config, inputs: Mapping[str, Artifact]) -> Colour:
    """Returns the entry on light and observer; inputs: the artifacts of all stages before, by stage."""
    return Colour(
        observer=config.light.observer,
        illuminant=_illuminant(config),
        range_nm=list(config.light.range_nm),
        step_nm=config.table.integral_step_nm,
        wavelengths=inputs["table"].summary["wavelengths"],
        normalisation=config.material.normalisation,
        white=_WHITE[config.material.normalisation],
        mirror_y=config.radiometry.unit,
    )


def coverage(config: Config, inputs: Mapping[str, Artifact], rho_max: float) -> Coverage:
    """Returns the entry on directions that the scan's Nyquist limits and the scene exclude.

    rho_max: sqrt(u^2 + v^2) up to which the table was computed.
    """
    table, band = inputs["table"].summary, inputs["surface"].summary["statistics"]["band_limit_per_um"]
    known = 1e-3 * config.light.lambda_min_nm * min(band)
    return Coverage(
        unknown_share=table["unknown_share"],
        skipped_share=table["skipped_share"],
        known_radius=min(rho_max, known),
        band_limit_per_um=list(band),
    )


def domain(config: Config, inputs: Mapping[str, Artifact]) -> Domain:
    """Returns the errors of the scalar model for the surface, at the laser line or at 550 nm."""
    illuminant = config.light.illuminant
    lambda_nm = illuminant.lambda_nm if isinstance(illuminant, LaserLine) else _LUMINOUS_NM
    statistics = inputs["surface"].summary["statistics"]
    periods = [Period(**period) for period in statistics["periods"]]
    finest = scalar_domain.finest_period_um(periods)
    found = scalar_domain.place(finest, statistics["sigma_h_um"], lambda_nm) if periods else None
    return Domain(
        lambda_nm=lambda_nm,
        period_over_lambda=None if found is None else found.period,
        error_of_smooth=None if found is None else found.smooth,
        error_of_edged=None if found is None else found.edged,
        tolerated=scalar_domain.TOLERATED,
        within=None if found is None else found.within,
    )


def made_by(inputs: Mapping[str, Artifact]) -> MadeBy:
    """Returns the tool, libraries and device in the record of the table, which another machine may have made."""
    recorded = inputs["table"].record.get("provenance", {})
    return MadeBy(
        diffract_bake=str(recorded.get("diffract-bake", _NOT_RECORDED)),
        stages={name: int(artifact.record.get("version", 0)) for name, artifact in inputs.items()},
        libraries={name: str(recorded.get(name, _NOT_RECORDED)) for name in _LIBRARIES},
        device=str(recorded.get("device", _NOT_RECORDED)),
        driver=str(recorded.get("driver", _NOT_RECORDED)),
    )


def provenance(config: Config, keys: Mapping[str, str]) -> Provenance:
    """Returns the origin of the bundle; keys: the artifacts' addresses by stage."""
    return Provenance(config=resolved(config), artifacts=dict(keys))


def resolved(config: Config) -> dict[str, Any]:
    """Returns the whole config as JSON, each file by name and SHA-256, without folders of this machine.

    "scene" remains a [scene], whose files are named there and listed with their SHA-256 in "scene_files".
    """
    resolved = config.model_dump(mode="json")
    resolved["surface"]["path"] = None if config.surface.path is None else _named_file(config.surface.path)
    resolved["spectrum"]["illuminant"] = _illuminant(config)
    resolved["material"]["metal"] = _file_or_name(config.material.metal)
    if config.scene is not None:
        resolved["scene_files"] = _named_scene_files(resolved["scene"])
    return resolved


def _named_scene_files(section: dict[str, Any]) -> list[dict[str, Any]]:
    """Names the files of a [scene] without their folders, in its place. Returns names and SHA-256."""
    if section["cameras"] is not None:
        # both are no [scene]
        del section["views"]
    found = []
    for entry in (*section["lights"], section["mesh"] or {}):
        if "path" in entry:
            found.append(_named_file(entry["path"]))
            entry["path"] = found[-1]["file"]
    return found


def _illuminant(config: Config) -> dict[str, Any]:
    illuminant = config.light.illuminant
    return _file_or_name(illuminant) if isinstance(illuminant, str) else illuminant.model_dump()


def _file_or_name(name: str) -> dict[str, Any]:
    return _named_file(name) if name.lower().endswith(".csv") else {"name": name}


def _named_file(path: str) -> dict[str, Any]:
    return {"file": Path(path).name, "sha256": of_source(Path(path))}
