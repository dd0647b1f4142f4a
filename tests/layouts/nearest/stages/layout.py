"""The stages "powers", "table" and "textures", and their registration."""

from dataclasses import asdict

import numpy as np

from pipeline.accuracy import certificate
from pipeline.accuracy.convergence import Curve
from pipeline.resources import MIB, Need
from pipeline.stages import surface
from pipeline.stages.foreseen import LayoutSizes, WayOut, base, process
from pipeline.stages.layout import Layout
from pipeline.stages.stage import Stage, colour_parameters, light_parameters
from pipeline.tables.evaluate import interpolator, table_evaluator
from tests.layouts.nearest.table import STEP_NM, NearestTable, positions


def _powers(config, inputs, folder, progress):
    reference, rule = surface.reference_of(config, inputs, progress), config.radiometry.integrand(STEP_NM)
    found = np.nan_to_num(reference.power(positions(config.table.nodes), rule.lambda_nm))
    np.save(folder / "powers.npy", found)
    return {"wavelengths": len(rule.lambda_nm)}


def _table(config, inputs, folder, progress):
    weights = config.radiometry.integrand(STEP_NM).weights
    values = (np.load(inputs["powers"].folder / "powers.npy") @ weights).astype(np.float32)
    np.save(folder / "table.npy", values.reshape(config.table.nodes, -1, 3))
    interpolate = interpolator(NearestTable(np.load(folder / "table.npy")), config.radiometry)
    reference = surface.reference_of(config, inputs, progress)
    return {
        "nodes": config.table.nodes,
        "wavelengths": len(weights),
        "unknown_share": 0.0,
        "skipped_share": 0.0,
        "certificate": asdict(certificate.measure(interpolate, reference, config, progress)),
    }


def load(artifact):
    return NearestTable(np.load(artifact.folder / "table.npy"))


def table_of(inputs):
    return load(inputs["table"])


def _study(config, inputs, evaluate, coarse):
    """Returns the curve of the error against the number of nodes along an axis: every second node, and all."""

    def nodes():
        half = table_evaluator(NearestTable(table_of(inputs).values[::2, ::2]), config.radiometry)
        counts = [float(config.table.nodes // 2 + 1), float(config.table.nodes)]
        return Curve("nodes", "", counts, [coarse.error(half), coarse.error(evaluate)], counts[-1])

    return [nodes]


def _sizes(foreseen):
    table_bytes = 4 * 3 * foreseen.config.table.nodes**2
    return LayoutSizes(
        transform=Need(process(300 * MIB)),
        table=Need({**base("table"), "table": table_bytes}),
        transform_bytes=0,
        table_bytes=table_bytes,
        freed_bytes=0,
        textures=Need({}),
        stored_bytes=0,
        study=Need({}),
        prepared=Need({}),
    )


def _prepare(config, inputs):
    from tests.layouts.nearest.bundle.prepare import prepare

    return prepare(config, table_of(inputs), inputs.summary("textures"))


LAYOUT = Layout(
    transform=Stage(
        "powers",
        1,
        ("surface",),
        lambda config: {
            "table": config.table.model_dump(),
            "sigma_um": config.coherence.sigma_um,
            "spectrum": light_parameters(config),
        },
        _powers,
        uses_device=True,
        work=lambda config: f"{config.table.nodes}² nodes",
    ),
    table=Stage("table", 1, ("surface", "powers"), colour_parameters, _table, uses_device=True),
    textures=Stage(
        "textures",
        1,
        ("table",),
        lambda _config: {},
        lambda _config, inputs, _folder, _progress: {
            "loss": None,
            "certificate": inputs.summary("table")["certificate"],
        },
    ),
    load=load,
    table_of=table_of,
    stored_of=table_of,
    study=_study,
    studied=None,
    study_remark="Every second node is left out.",
    sizes=_sizes,
    ways_out=(WayOut("table.nodes", 3, multiple=1),),
    settings=lambda _powers, table: [["nodes along an axis", str(table["nodes"])]],
    stored=lambda _config, _loss: [],
    prepare=_prepare,
)
