"""The paper's tables in a bundle: an image for each I_p."""

import json
from collections.abc import Iterator
from typing import Any

from pydantic import TypeAdapter

from pipeline.accuracy.certificate import Certificate
from pipeline.arrays import Array
from pipeline.bundle.layout import Pixels, Prepared, TableImage
from pipeline.bundle.taylor import storage
from pipeline.bundle.taylor.layout import TaylorGridEntry, TaylorImage, TaylorLoss
from pipeline.config.models import Config
from pipeline.report import images
from pipeline.tables.taylor import grid
from pipeline.tables.taylor.table import TaylorTable

_CONVENTION = (
    "sum_p w^p I_p(u, v) = sum_lambda |P|^2 S(lambda) xyzbar(lambda) / sum_lambda S ybar, with the "
    "factors of the material that vary with wavelength inside the sum"
)
_EVALUATION = (
    "XYZ = max(0, C cos(theta_i) sum_p w^p I_p(u, v)); I_p = scale_p * (R, G, B) where A = 1; by Horner's rule from "
    "the highest p down. XYZ = 0 where wi.z <= 0 or wr.z <= 0, and where the interpolated A < 0.9999, which was not "
    "computed"
)


def prepare(config: Config, table: TaylorTable, summary: dict[str, Any], plan: dict[str, Any]) -> Prepared:
    """Prepares a Taylor table for a bundle.

    config: its [publish] is read. table: as baked. summary: of the stage "textures". plan: for the manifest.
    Returns the layout's part of the bundle.
    """
    scale = storage.scales(table, config.publish.precision)
    loss = None if summary["loss"] is None else TaylorLoss.model_validate_json(json.dumps(summary["loss"]))
    entry = TaylorGridEntry(
        layout="taylor", width=table.resolution, height=table.resolution, power=table.power, u_max=grid.U_MAX
    )
    return Prepared(
        holds="I_p",
        conventions={"I_p": _CONVENTION},
        evaluation=_EVALUATION,
        grid=entry,
        images=_images(config, table, scale, loss),
        count=len(scale),
        plan=plan,
        certificate=TypeAdapter(Certificate).validate_python(summary["certificate"]),
        loss=loss,
        rho_max=grid.U_MAX,
        constants={"POWERS": len(scale), "N": float(entry.width), "A": entry.power},
    )


def _images(
    config: Config, table: TaylorTable, scale: Array, loss: TaylorLoss | None
) -> Iterator[tuple[TableImage, Pixels]]:
    """Yields the entry and the pixels (v, u, RGBA) of tables/I_00.exr, tables/I_01.exr, ..."""
    stored = config.publish.precision
    lost = None if loss is None else storage.subnormal_shares(table, scale)
    for p, plane in enumerate(storage.planes(table, scale, stored)):
        image = TaylorImage(
            layout="taylor",
            file=f"tables/I_{p:02d}.exr",
            width=plane.shape[1],
            height=plane.shape[0],
            channels=sorted(images.RGBA),
            pixel_type=stored,
            index=p,
            scale=float(scale[p]),
            half_subnormal_share=None if lost is None else float(lost[p]),
        )
        yield image, plane
