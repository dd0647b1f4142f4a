"""Polar tables in a bundle: images of spline coefficients with four outputs each."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from pipeline.accuracy.certificate import Certificate
from pipeline.bundle.layout import Pixels, Prepared, TableImage
from pipeline.bundle.polar.atlas import Atlas
from pipeline.bundle.polar.layout import PolarGridEntry, PolarImage, PolarLoss
from pipeline.bundle.polar.storage import Stored
from pipeline.config.models import Config
from pipeline.diffraction import tiles
from pipeline.report import images
from pipeline.tables.polar.compression import CHANNELS, Textures

_CONVENTION = (
    "value(u, v, |w|) = sum_lambda |P|^2 S(lambda) xyzbar(lambda) / sum_lambda S ybar, with the factors of the "
    "material that vary with wavelength inside the sum; 'grid' says how it is stored"
)
_EVALUATION = (
    "XYZ = max(0, C cos(theta_i) value(u, v, |w|)); value = g(rho) sum_k T_k(x) sum_o output_o(u, v) "
    "basis[o][channel][k], output_o looked up by cubic B-splines; see 'grid'. XYZ = 0 where wi.z <= 0 or wr.z <= 0. "
    "Nothing is known where rho > rho_max (1 + 1e-6), and where one of the 4 x 4 texels is in an absent tile"
)
_WINDOW = (
    "g = exp(-r^2 / (2 sigma^2)), centred on the middle of the patch; where plan.windows > 1, |P|^2 is its mean over "
    "that number of windows at different positions of the scan"
)


def prepare(
    config: Config,
    stored: Stored,
    summary: dict[str, Any],
    plan: dict[str, Any],
) -> Prepared:
    """Prepares a polar table for a bundle.

    config: its [publish] is read. stored: the textures. summary: of the stage "textures". plan: for the manifest.
    Returns the layout's part of the bundle.
    """
    loss = None if summary["loss"] is None else PolarLoss.model_validate_json(json.dumps(summary["loss"]))
    entry = grid_entry(stored.textures, stored.atlas)
    return Prepared(
        holds="value",
        conventions={"value": _CONVENTION, "window": _WINDOW},
        evaluation=_EVALUATION,
        grid=entry,
        images=_images(config, stored),
        count=stored.textures.count,
        plan=plan,
        certificate=TypeAdapter(Certificate).validate_python(summary["certificate"]),
        loss=loss,
        rho_max=entry.rho_max,
        constants={
            "RINGS": entry.rings,
            "AZIMUTHS": entry.azimuths,
            "BAND": tiles.RINGS,
            "SECTOR": tiles.AZIMUTHS,
            "WIDTH": entry.width,
            "EVERY": entry.every,
            "STARTS": [start for band in entry.starts for start in band],
            "TEXTURES": stored.textures.count,
            "TERMS": entry.w_terms,
            "LOW_RANK": entry.basis is not None,
            "RHO_MAX": entry.rho_max,
            "R0": entry.r0,
            "STEP": entry.step,
            "AXIS": entry.axis_rad,
            "STRETCH": entry.stretch,
            "ENVELOPE_RADIUS": entry.envelope_radius,
            "ENVELOPE_EXPONENT": entry.envelope_exponent,
        },
    )


def grid_entry(textures: Textures, atlas: Atlas) -> PolarGridEntry:
    """Returns the manifest's entry on the positions and the meaning of the texels; atlas: places of the tiles."""
    rings, azimuths = textures.grid.rings, textures.grid.azimuths
    outputs, _, terms = textures.basis.shape
    return PolarGridEntry(
        layout="polar",
        width=atlas.width,
        height=atlas.height,
        rings=rings.count,
        azimuths=azimuths.count,
        every=list(textures.tiles.every),
        starts=atlas.starts.tolist(),
        covered_share=textures.tiles.covered_share(),
        r0=rings.r0,
        step=rings.step,
        rho_max=rings.rho_max,
        stretch=azimuths.stretch,
        axis_rad=azimuths.axis_rad,
        w_terms=terms,
        envelope_radius=textures.envelope.radius,
        envelope_exponent=textures.envelope.exponent,
        basis=None if outputs == 3 * terms else textures.basis.tolist(),
    )


def _images(config: Config, stored: Stored) -> Iterator[tuple[TableImage, Pixels]]:
    """Yields the entry and the pixels (rows, columns, RGBA) of tables/T_00.exr, tables/T_01.exr, ..."""
    in_half = config.publish.precision == "half"
    for q in range(stored.textures.count):
        outputs = slice(CHANNELS * q, CHANNELS * (q + 1))
        pixels = np.moveaxis(stored.values[outputs], 0, -1)
        image = PolarImage(
            layout="polar",
            file=f"tables/T_{q:02d}.exr",
            width=pixels.shape[1],
            height=pixels.shape[0],
            channels=sorted(images.RGBA),
            pixel_type=config.publish.precision,
            index=q,
            scale=stored.scale[outputs].tolist(),
            half_subnormal_share=float(np.mean(stored.subnormal[outputs])) if in_half else None,
        )
        yield image, pixels
