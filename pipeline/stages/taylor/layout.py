"""The layout of the paper: I_p(u, v) on a grid that is fine near the origin."""

from typing import TYPE_CHECKING, Any

from pipeline.accuracy.convergence import CoarseMap, Study
from pipeline.config.models import Config
from pipeline.stages.foreseen import WayOut
from pipeline.stages.layout import Layout
from pipeline.stages.stage import Inputs, Summary
from pipeline.stages.taylor import sizes, stack, table, textures
from pipeline.stages.taylor.study import TaylorStudy
from pipeline.tables.evaluate import Evaluator

if TYPE_CHECKING:
    from pipeline.bundle.layout import Prepared

_PREDICTED = ("order", "predicted_error", "truncation", "float32_rounding")


def _study(config: Config, inputs: Inputs, evaluate: Evaluator, coarse: CoarseMap) -> Study:
    """Returns the curves of error against terms, wavelength step, resolution and exponent of the grid."""
    return TaylorStudy(stack.of(inputs), stack.layout_of(config), evaluate, coarse).curves()


def _settings(stack: Summary, table: Summary) -> list[list[str]]:
    n = table["resolution"]
    return [
        ["Taylor order N", str(stack["order"])],
        ["tables I_p (p = 0..2N)", f"{table['powers_of_w']} of {n} × {n}, exponent a = {table['power']:g}"],
        ["wavelengths", str(table["wavelengths"])],
        ["window reach (coefficients)", "±{} × ±{}".format(*stack["window_reach"])],
        ["predicted error of |P|²", f"{stack['predicted_error']:.1e}"],
        ["beyond the Nyquist limits", f"{100 * table['unknown_share']:.2f} %"],
        ["outside the scene", f"{100 * table['skipped_share']:.1f} %"],
        [
            f"certificate: mean ΔE at {table['certificate']['exposure_ru']:g} RU",
            f"{table['certificate']['measured']:.3f}",
        ],
    ]


def _stored(_config: Config, loss: dict[str, Any]) -> list[list[str]]:
    return [["stored in", f"half floats, which change colours by at most ΔE {loss['largest_delta_e']:.2g}"]]


def _prepare(config: Config, inputs: Inputs) -> "Prepared":
    from pipeline.bundle.taylor import prepare

    return prepare.prepare(
        config,
        table.of(inputs),
        inputs.summary("textures"),
        {key: inputs.summary("stack").get(key) for key in _PREDICTED},
    )


LAYOUT = Layout(
    transform=stack.STACK,
    table=table.TABLE,
    textures=textures.TEXTURES,
    load=table.load,
    table_of=table.of,
    stored_of=textures.table_of,
    study=_study,
    studied=None,
    study_remark="Terms and step are varied at the directions of the map itself, without a grid.",
    sizes=sizes.sizes,
    ways_out=(
        WayOut("table.resolution", 3, multiple=2, odd=True),
        WayOut("table.step_nm", 50.0, rises=True),
        WayOut("table.terms", 2, multiple=1),
    ),
    settings=_settings,
    stored=_stored,
    prepare=_prepare,
)
