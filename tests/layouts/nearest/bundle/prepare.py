"""The table of a bundle: one image."""

import numpy as np
from pydantic import TypeAdapter

from pipeline.accuracy.certificate import Certificate
from pipeline.bundle.layout import Prepared
from tests.layouts.nearest.bundle.layout import NearestGridEntry, NearestImage


def prepare(config, table, summary):
    rows, columns, _ = table.values.shape
    entry = NearestImage(
        layout="nearest",
        file="tables/nearest.exr",
        width=columns,
        height=rows,
        channels=list("ABGR"),
        pixel_type=config.publish.precision,
        index=0,
        scale=1,
    )
    return Prepared(
        holds="value",
        conventions={"value": "at the nearest node"},
        evaluation="XYZ = C cos(theta_i) value",
        grid=NearestGridEntry(layout="nearest", width=columns, height=rows),
        images=[(entry, np.concatenate([table.values, np.ones((rows, columns, 1), np.float32)], axis=-1))],
        count=1,
        plan={},
        certificate=TypeAdapter(Certificate).validate_python(summary["certificate"]),
        loss=None,
        rho_max=2.0,
        constants={"N": float(columns)},
    )
