"""Memory and time of the stages of the paper's layout, from the sizes of their arrays."""

from math import ceil

from pipeline import resources
from pipeline.accuracy.checks import certified_directions
from pipeline.bundle.taylor import storage
from pipeline.diffraction import dft_stack, expansion
from pipeline.resources import Need, largest
from pipeline.stages.foreseen import Foreseen, LayoutSizes, base, process, spare
from pipeline.stages.taylor import stack
from pipeline.store.arrays import saving_bytes
from pipeline.tables.evaluate import look_up_bytes
from pipeline.tables.taylor import table as taylor

# of the window in the middle
_CERTIFIED = certified_directions(1)
# nodes of the tables and directions of the maps that `validate` computes for its curves
_STUDIED_NODES = 5 * 201**2 // 2 + 12 * 2900
# of the process in the stage "stack", measured as those of the stages that all layouts have
_TRANSFORM_BYTES = 300 * resources.MIB


def sizes(foreseen: Foreseen) -> LayoutSizes:
    """Computes what the stages need."""
    config, extent = foreseen.config, foreseen.extent
    layout, light = stack.layout_of(config), config.light
    terms = _terms(foreseen)
    reachable = expansion.W_MAX / (1e-3 * light.lambda_min_nm)
    tolerance = dft_stack.window_tolerance(layout.tolerance)
    chosen = dft_stack.size(extent, config.coherence.sigma_um, reachable, tolerance)
    stack_bytes = chosen.stack_bytes(terms, 8)
    made = {"stack": stack_bytes, "writing": saving_bytes(stack_bytes)}
    transform = Need(
        {**process(_TRANSFORM_BYTES), "height field": extent.bytes, **largest(chosen.taylor_bytes(terms), made)},
        resources.seconds(20.0 * terms * chosen.samples[0] * chosen.samples[1] * 10.0),
    )
    table_bytes = taylor.values_bytes(layout.resolution, terms)
    wavelengths = 1 if light.is_line else ceil((light.range_nm[1] - light.range_nm[0]) / layout.step_nm) + 1
    reference = foreseen.reference
    holding = {
        **base("table"),
        **foreseen.held(),
        "stack": stack_bytes,
        "tables I_p": table_bytes,
        "factor of directions": look_up_bytes(wavelengths, config.material),
    }
    building = taylor.building_arrays(layout.resolution, terms, chosen)
    freed_bytes = stack_bytes + building["stack on the device"]
    freed = spare(freed_bytes)
    needed = largest(
        {**holding, **building},
        {**holding, "writing": saving_bytes(table_bytes), **freed},
        {**holding, **reference.making(), **freed},
        {**holding, **reference.answering(_CERTIFIED, foreseen.wavelengths, config.material), **freed},
    )
    seconds = taylor.seconds(layout.resolution**2 // 2, wavelengths, terms, chosen)
    table = Need(
        needed,
        seconds + reference.seconds(_CERTIFIED, foreseen.wavelengths),
        max(building["stack on the device"], reference.part_bytes),
    )
    other = min(301, layout.resolution)
    study = {"stack": stack_bytes, **taylor.building_arrays(other, terms, chosen)}
    in_half = config.publish.precision == "half"
    answering = reference.answering(_CERTIFIED, foreseen.wavelengths, config.material)
    storing = largest({"tables in half floats": storage.measuring_bytes(table_bytes)}, answering)
    return LayoutSizes(
        transform=transform,
        table=table,
        transform_bytes=0,
        table_bytes=table_bytes,
        freed_bytes=freed_bytes + reference.part_bytes,
        study=Need(study, taylor.seconds(_STUDIED_NODES, wavelengths, terms, chosen)),
        textures=Need(storing if in_half else {}, reference.seconds(_CERTIFIED, foreseen.wavelengths)),
        stored_bytes=table_bytes if in_half else 0,
        written_bytes=stack_bytes,
        prepared=Need({"images": storage.planes_bytes(layout.resolution)}),
    )


def _terms(foreseen: Foreseen) -> int:
    """Computes the number of terms, N + 1."""
    layout = stack.layout_of(foreseen.config)
    if "stack" in foreseen.made:
        return int(foreseen.made["stack"]["order"]) + 1
    if layout.terms != "auto":
        return layout.terms + 1
    z = expansion.largest_phase(foreseen.extent.half_range_um, foreseen.config.light.lambda_min_nm)
    return expansion.planned_order(z, layout.tolerance) + 1
