"""Memory and time of the polar layout's stages, from the sizes of their arrays."""

from dataclasses import replace
from functools import partial
from math import sqrt

from pipeline import resources
from pipeline.accuracy.checks import certified_directions, random_directions
from pipeline.bundle.polar import storage
from pipeline.diffraction import dft_stack
from pipeline.diffraction import power_spectrum as spectrum
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.resources import Arrays, Need, largest
from pipeline.stages.foreseen import Foreseen, LayoutSizes, base, process, spare
from pipeline.stages.polar import power_spectrum, table
from pipeline.store.arrays import loading_bytes, saving_bytes
from pipeline.tables.polar import spectral
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.planning import plan, trial
from pipeline.tables.polar.planning.grid_search import GRID_SHARE
from pipeline.tables.polar.planning.grids import Grids
from pipeline.tables.polar.spectral_integral import IntegralSize

# tables that the search for a grid measures, and tables of the curves that `validate` shows
_SEARCHED, _STUDIED = 6, 15
# terms in |w| of the largest of these curves
_STUDIED_W_TERMS = 12
# of the process in the stage "power_spectrum", measured as those of the stages that all layouts have
_TRANSFORM_BYTES = 325 * resources.MIB


def sizes(foreseen: Foreseen) -> LayoutSizes:
    """Computes what the stages need: from the plan where it is made, else from the grid at which its search starts.

    The search may go on to a larger grid; it then asks for its memory again.
    """
    config, reference = foreseen.config, foreseen.reference
    layout = power_spectrum.layout_of(config)
    bake, rings, azimuths = _grid(foreseen)
    integral = bake.integral_size(rings, azimuths)
    e_bytes, metal = bake.power_spectrum_bytes(azimuths), config.material.fresnel == "conductor"
    whole = trial.serves_all(bake, foreseen.extent, foreseen.places)
    reach_per_um = float(bake.radius_per_um[-1])
    chosen = dft_stack.size(foreseen.extent, bake.sigma_um, reach_per_um, bake.tolerance, whole=whole)
    searched = _SEARCHED if "auto" in (layout.rings, layout.azimuths) else 0
    # the planner's spectral integral is that of a grey surface; a grid that the config sets is not tried
    tried = integral.arrays() if searched else {}
    stack = chosen.chebyshev_bytes(spectrum.filled_terms(bake.terms), 4)
    freed_bytes = stack["stack"] + stack["terms between two transforms"] + (e_bytes if searched else 0)
    freed_bytes += sum(tried.values()) + integral.weights_bytes
    is_whole = storage.is_whole(config)
    choosing = {"textures": storage.choosing_bytes(integral.table_bytes, bake.w_terms, config.publish)}
    random = random_directions(foreseen.places.count)
    choosing |= reference.answering(random, foreseen.wavelengths, config.material)
    return LayoutSizes(
        transform=_transform(foreseen, bake, azimuths, chosen, integral, searched),
        table=_table(foreseen, integral, e_bytes, freed_bytes),
        transform_bytes=e_bytes,
        table_bytes=integral.table_bytes,
        freed_bytes=freed_bytes + reference.part_bytes,
        study=_study(bake, rings, azimuths, metal=metal),
        textures=Need(
            {} if is_whole else choosing,
            reference.seconds(random + certified_directions(foreseen.places.count), foreseen.wavelengths),
        ),
        # as stored in half floats, and as read back
        stored_bytes=0 if is_whole else 3 * integral.table_bytes // 2,
        # an image has four channels, here and in OpenEXR
        prepared=Need(
            {"image": 2 * 4 * 4 * rings.count * azimuths, **({"tiles": integral.table_bytes} if is_whole else {})}
        ),
        written_bytes=e_bytes,
        delta_e=_expected_delta_e(foreseen),
        kept_share=partial(_kept_share, foreseen, rings, azimuths),
    )


def _kept_share(foreseen: Foreseen, rings: Rings, azimuths: int) -> float:
    """Computes the share of the texels that lie in tiles of the scene, less the thinned ones; without a stretch."""
    grid = PolarGrid(rings, Azimuths(azimuths))
    return table.reached(foreseen.config, grid).texels / grid.texels


def _expected_delta_e(foreseen: Foreseen) -> float | None:
    """Returns the error that the search for a grid measured or will aim at; None for a grid that the config sets."""
    if "power_spectrum" in foreseen.made:
        return power_spectrum.plan_in(foreseen.made["power_spectrum"]).probed_delta_e
    layout = power_spectrum.layout_of(foreseen.config)
    return GRID_SHARE * foreseen.config.budget_delta_e if "auto" in (layout.rings, layout.azimuths) else None


def _transform(
    foreseen: Foreseen,
    bake: PolarBake,
    azimuths: int,
    chosen: dft_stack.StackSize,
    integral: IntegralSize,
    searched: int,
) -> Need:
    """Returns the need of the stage "power_spectrum"; searched: tables that the search for a grid measures."""
    filled, e_bytes = spectrum.filled_terms(bake.terms), bake.power_spectrum_bytes(azimuths)
    e_seconds, windows = _gather_seconds(bake, azimuths, chosen.reach), foreseen.places.count
    stacks = 1 if trial.serves_all(bake, foreseen.extent, foreseen.places) else windows
    return Need(
        {
            **process(_TRANSFORM_BYTES),
            **_transforming(foreseen, bake, azimuths, chosen, integral.arrays() if searched else {}),
        },
        resources.seconds(chebyshev_work(chosen, filled) * stacks)
        + e_seconds * (windows + searched / 2)
        + integral.seconds * searched,
        max(
            chosen.stack_bytes(filled, 4),
            e_bytes,
            *([integral.table_bytes, integral.weights_bytes] if searched else []),
        ),
    )


def _table(foreseen: Foreseen, integral: IntegralSize, e_bytes: int, freed_bytes: int) -> Need:
    """Returns the need of the stage "table"; freed_bytes: of arrays that the device's pool may keep."""
    config, reference, freed = foreseen.config, foreseen.reference, spare(freed_bytes)
    reading = {"reading of the power spectrum": loading_bytes(e_bytes)}
    holding = {**base("table"), **foreseen.held(), "power spectrum": e_bytes, "table": integral.table_bytes}
    certified = {"reference": reference.nbytes}
    spectral_form = power_spectrum.layout_of(config).form == "spectral"
    needed = largest(
        {**base("table"), **foreseen.held(), **reading, **freed},
        {**holding, **integral.arrays(metal=config.material.fresnel == "conductor"), **freed},
        {**holding, **reference.making(), **freed},
        {
            **holding,
            **reference.answering(certified_directions(foreseen.places.count), foreseen.wavelengths, config.material),
            **freed,
        },
        {**holding, **certified, "writing": saving_bytes(integral.table_bytes), **freed},
        {
            **holding,
            **certified,
            "spectral form": spectral.building_bytes(e_bytes) if spectral_form else 0,
            **freed,
        },
    )
    return Need(
        needed,
        integral.seconds + reference.seconds(certified_directions(foreseen.places.count), foreseen.wavelengths),
        max(integral.table_bytes, integral.weights_bytes, reference.part_bytes),
    )


def _grid(foreseen: Foreseen) -> tuple[PolarBake, Rings, int]:
    """Returns numbers of terms and nodes, the rings, and the number of azimuths: planned, or foreseen."""
    config = foreseen.config
    layout, budget = power_spectrum.layout_of(config), power_spectrum.budget(config)
    if "power_spectrum" in foreseen.made:
        planned = power_spectrum.plan_in(foreseen.made["power_spectrum"])
        return planned.bake(config.radiometry, budget, layout), planned.rings, planned.azimuths.count
    bake = plan.numbers(
        foreseen.extent.half_range_um, config.coherence.sigma_um, config.light, config.scene, budget, layout
    )
    grids = Grids(bake, layout, config.budget_delta_e)
    rings, azimuths = grids.first()
    return bake, grids.rings(rings), azimuths


def _transforming(
    foreseen: Foreseen, bake: PolarBake, azimuths: int, chosen: dft_stack.StackSize, table: Arrays
) -> Arrays:
    """Lists the arrays of the stage "power_spectrum" at its peak."""
    filled, e_bytes = spectrum.filled_terms(bake.terms), bake.power_spectrum_bytes(azimuths)
    stack = chosen.chebyshev_bytes(filled, 4)
    between = stack["terms between two transforms"]
    always = {
        **foreseen.held(),
        "height field of the windows": foreseen.extent.bytes,
        "stack": stack["stack"],
    }
    # positions, radii, azimuths and light of all coefficients
    scattering = 7 * 8 * chosen.kept.shape[0] * chosen.kept.shape[1]
    freed = spare(between, sum(table.values()))
    several = {"power spectrum of another window": e_bytes, **stack}
    has_several = foreseen.places.count > 1 and not trial.serves_all(bake, foreseen.extent, foreseen.places)
    return largest(
        {**always, **stack},
        {**always, "scattered light": scattering, **spare(between)},
        {**always, "power spectrum": e_bytes, **table, **spare(between)},
        {**always, "power spectrum": e_bytes, **(several if has_several else {}), **freed},
        {
            **always,
            "power spectrum": e_bytes,
            "contrast": spectrum.contrast_bytes(azimuths, len(bake.radius_per_um)),
            **freed,
        },
        {**always, "power spectrum": e_bytes, "writing": saving_bytes(e_bytes), **freed},
    )


def chebyshev_work(chosen: dft_stack.StackSize, terms: int) -> float:
    """Counts the multiply-adds of a stack: two steps along either axis, each of about the root of its samples."""
    ny, nx = chosen.samples
    rows, columns = chosen.kept.shape
    return terms * (ny * (nx + columns) * sqrt(nx) + 2.0 * columns * (ny + rows) * sqrt(ny))


def _gather_seconds(bake: PolarBake, azimuths: int, reach: tuple[int, int]) -> float:
    """Estimates the time of E on half of the azimuths: the coefficients under the window, then the nodes in s."""
    taps = (2 * reach[0] + 1) * (2 * reach[1] + 1)
    each = 2.0 * bake.terms * (taps + bake.s_nodes)
    return resources.seconds(0.5 * azimuths * len(bake.radius_per_um) * each)


def _study(bake: PolarBake, rings: Rings, azimuths: int, *, metal: bool) -> Need:
    """Returns the need of the curves: E thinned to half of its azimuths, or tables with other numbers."""
    e_bytes = bake.power_spectrum_bytes(azimuths)
    other = replace(bake, w_terms=max(bake.w_terms, _STUDIED_W_TERMS)).integral_size(rings, azimuths)
    arrays = {name.replace("table", "another table"): size for name, size in other.arrays(metal=metal).items()}
    thinned = {"power spectrum, thinned": e_bytes + e_bytes // 2}
    return Need(largest(arrays, thinned), _STUDIED * other.seconds, max(other.table_bytes, other.weights_bytes))
