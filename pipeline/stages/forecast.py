"""Memory and time of every stage before it begins, and the refusal of those that exceed their limits."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline import layouts, resources
from pipeline.config.models import Config
from pipeline.errors import BakeError, ConfigError, ResourceError
from pipeline.resources import Need, largest
from pipeline.stages import bundle, render, surface, validate
from pipeline.stages.foreseen import Foreseen, LayoutSizes, WayOut, base, heap, spare
from pipeline.stages.session import kept_bytes
from pipeline.stages.stage import Summary
from pipeline.surface import recipes
from pipeline.surface.extent import Extent

# those that do not apply, to a scan for example, are left out
_WAYS_OUT = (
    WayOut("surface.recipe.amplitude_um", 1e-3),
    WayOut("surface.recipe.height_um", 1e-3),
    WayOut("surface.recipe.depth_um", 1e-3),
    WayOut("surface.recipe.sigma_h_um", 1e-3),
    WayOut("surface.recipe.size_um", 1.0),
    WayOut("surface.recipe.pitch_um", 10.0, rises=True),
    WayOut("render.size", 16, multiple=1),
    WayOut("coherence.sigma_um", 0.1),
    WayOut("accuracy.delta_e", 100.0, rises=True),
)
_HALVINGS, _PROPOSED = 12, 2
# measured on snakes: bytes of a pixel of a map, EXR and PNG; of a report without and with each map; the share of a
# table that EXR leaves
_PIXEL_BYTES, _REPORT_BYTES, _REPORTED_MAP_BYTES, _COMPRESSED = 10, 500_000, 1_500_000, 0.88


def needs(config: Config, made: Mapping[str, Summary], *, reads: bool = False) -> dict[str, Need]:
    """Computes what every stage needs, by name; nothing of a scan that no stage has read.

    made: summaries of the stages whose artifacts exist. A plan of rings and azimuths that is not made is foreseen at
    the grid where its search starts. reads: whether a scan that no stage has read is read here.
    """
    extent = _extent(config, made, reads=reads)
    if extent is None:
        return {}
    foreseen = Foreseen(config, extent, made)
    return _needs(foreseen, layouts.of(config.table).sizes(foreseen))


@dataclass(frozen=True)
class Prospect:
    """A bake before it begins.

    needs: of every stage, by name. written: bytes of every artifact. delta_e: mean CIELAB error of the table; None
    where nothing is known of it. kept_share: of the table's texels, that a bundle holds.
    """

    needs: Mapping[str, Need]
    written: Mapping[str, int]
    delta_e: float | None
    kept_share: float = 1.0


def outcome(config: Config, made: Mapping[str, Summary]) -> Prospect:
    """Predicts a bake, reading a scan that no stage has read; made: as for `needs`."""
    extent = _extent(config, made, reads=True)
    if extent is None:
        return Prospect({}, {}, None)
    foreseen = Foreseen(config, extent, made)
    sizes = layouts.of(config.table).sizes(foreseen)
    kept = sizes.kept_share()
    return Prospect(_needs(foreseen, sizes), _written(foreseen, sizes, kept), sizes.delta_e, kept)


def _extent(config: Config, made: Mapping[str, Summary], *, reads: bool) -> Extent | None:
    """Returns samples and heights of the surface; None of a scan that is not read, or cannot be."""
    if "surface" in made:
        return surface.extent_in(made["surface"])
    if config.surface.recipe is not None:
        return recipes.extent(config.surface.recipe)
    if not reads:
        return None
    try:
        return surface.field_of(config)[0].extent
    except BakeError:  # the stage that reads the scan will report it
        return None


def _written(foreseen: Foreseen, sizes: LayoutSizes, kept: float) -> dict[str, int]:
    """Estimates the bytes of every artifact; kept: share of the table's texels that a bundle holds."""
    config, layout = foreseen.config, layouts.of(foreseen.config.table)
    lights, stored = len(config.render.lights), round(kept * sizes.stored_bytes / 3)
    maps = lights * config.render.size**2 * _PIXEL_BYTES
    report = _REPORT_BYTES + lights * _REPORTED_MAP_BYTES
    return {
        "surface": foreseen.extent.bytes,
        layout.transform.name: sizes.written_bytes,
        layout.table.name: sizes.table_bytes,
        layout.textures.name: stored,
        "render": maps,
        "validate": report,
        "bundle": round(_COMPRESSED * (stored or kept * sizes.table_bytes)) + maps + report,
    }


def _needs(foreseen: Foreseen, sizes: LayoutSizes) -> dict[str, Need]:
    config, extent, layout = foreseen.config, foreseen.extent, layouts.of(foreseen.config.table)
    return {
        "surface": surface.need(config.surface, extent, config.light.lambda_min_nm),
        layout.transform.name: sizes.transform,
        layout.table.name: sizes.table,
        layout.textures.name: _textures(foreseen, sizes),
        "render": render.need(foreseen, sizes),
        "validate": validate.need(foreseen, sizes),
        "bundle": bundle.need(foreseen, sizes),
    }


def _textures(foreseen: Foreseen, sizes: LayoutSizes) -> Need:
    """Computes memory and time of the stage "textures": the table, the exact reference, and the textures."""
    held = foreseen.held(transform=sizes.transform_bytes)
    kept = {**spare(sizes.freed_bytes), **heap(sizes.transform_bytes, sizes.table_bytes)}
    table = {"table": sizes.table_bytes}
    if not sizes.textures.arrays:
        return Need({**base("textures"), **held, **kept, "table": kept_bytes(sizes.table_bytes)})
    arrays = largest(
        foreseen.reading(**table),
        {**table, **foreseen.reference.making()},
        {**table, "reference": foreseen.reference.nbytes, **sizes.textures.arrays},
    )
    return Need({**base("textures"), **held, **kept, **arrays}, sizes.textures.seconds)


def require_memory(
    config: Config, made: Mapping[str, Summary], to_do: Iterable[str], largest_buffer: int | None
) -> None:
    """Raises ResourceError where a stage to do needs more memory or time than is allowed, with keys that mend it.

    to_do: names of the stages. largest_buffer: bytes that the device holds in one array; None for any number.
    """
    found, limit, names = needs(config, made), resources.limit(), list(to_do)
    seconds = sum(found[name].seconds for name in names if name in found)
    if seconds > resources.LONGEST_S:
        raise ResourceError(
            f"{config.name}: this would take about {seconds / 3600:.3g} h, more than "
            f"{resources.LONGEST_S / 3600:g} h" + _remedy(config, made, _ends)
        )
    for stage in names:
        if stage not in found:
            continue
        need = found[stage]
        if need.bytes > limit.bytes:
            biggest = max(need.arrays, key=lambda name: need.arrays[name])
            raise ResourceError(
                f"{config.name}: stage {stage} needs {resources.in_words(need.bytes)} at its peak "
                f"({resources.in_words(need.arrays[biggest])} of it for: {biggest}), more than the "
                f"{resources.in_words(limit.bytes)} of {limit.source}"
                + _remedy(config, made, lambda all_: all(all_[name].bytes <= limit.bytes for name in names))
            )
        if largest_buffer is not None and need.buffer > largest_buffer:
            raise ResourceError(
                f"{config.name}: stage {stage} needs an array of {resources.in_words(need.buffer)}, and the device "
                f"holds no more than {resources.in_words(largest_buffer)} in one"
                + _remedy(config, made, lambda all_: all(all_[name].buffer <= largest_buffer for name in names))
            )


def require_an_end(config: Config, source: str) -> None:
    """Raises ConfigError where the whole bake of a recipe would take longer than an hour on this machine.

    source: name of the config, for the message.
    """
    found = needs(config, {})
    if _ends(found):
        return
    seconds = sum(need.seconds for need in found.values())
    ways = list(_ways_out(config, {}, _ends))
    key = ways[0][0] if ways else "surface"
    text = (
        f"expected work of at most {resources.LONGEST_S / 3600:g} h, this would take about {seconds / 3600:.3g} h; "
        + " or ".join(f"{key} = {value:g}" for key, value in ways)
        + (" would end" if ways else "make the patch, the window or the heights smaller")
    )
    raise ConfigError(source, [(key, text)])


def _ends(found: Mapping[str, Need]) -> bool:
    """Says whether the work of all stages takes no longer than what is allowed."""
    return sum(need.seconds for need in found.values()) <= resources.LONGEST_S


def _remedy(config: Config, made: Mapping[str, Summary], fits: Callable[[Mapping[str, Need]], bool]) -> str:
    ways = [f"{key} = {value:g}" for key, value in _ways_out(config, made, fits)]
    if not ways:
        return "; use a machine with more, or a smaller scan"
    return f"; {' or '.join(ways)} would fit"


def _ways_out(
    config: Config, made: Mapping[str, Summary], fits: Callable[[Mapping[str, Need]], bool]
) -> Iterator[tuple[str, float]]:
    """Yields keys with the value closest to the config's with which its needs fit, by halving in proportion."""
    proposed = 0
    for way in (*layouts.of(config.table).ways_out, *_WAYS_OUT):
        key, value = way.key, _value(config, way.key)
        if value is None or (value >= way.end if way.rises else value <= way.end):
            continue

        def tried(number: float, key: str = key) -> bool:
            # a plan that is made does not hold for other settings; the surface of a scan does
            known = {name: made[name] for name in made if name == "surface" and config.surface.recipe is None}
            try:
                return fits(needs(_with(config, key, number), known))
            except BakeError:
                return False

        good, bad = way.rounded(way.end, value), value
        if not tried(good):
            continue
        for _ in range(_HALVINGS):
            middle = way.rounded((good * bad) ** 0.5, good)
            if middle in (good, bad):
                break
            good, bad = (middle, bad) if tried(middle) else (good, middle)
        yield key, good
        proposed += 1
        if proposed == _PROPOSED:
            return


def _value(config: Config, key: str) -> float | None:
    """Returns the number of a key, of a pair the larger; None where the config has none."""
    found: Any = config
    for part in key.split("."):
        found = getattr(found, part, None)
    if key == "accuracy.delta_e" and found is None:
        return config.budget_delta_e
    if isinstance(found, tuple):
        return float(max(found))
    return float(found) if isinstance(found, int | float) else None


def _with(config: Config, key: str, number: float) -> Config:
    """Returns a config with another number for one key."""
    *sections, last = key.split(".")
    parents: list[Any] = [config]
    for section in sections:
        parents.append(getattr(parents[-1], section))
    whole = isinstance(getattr(parents[-1], last), int)
    changed: Any = int(number) if whole else number
    for parent, name in zip(reversed(parents), reversed([*sections, last]), strict=True):
        changed = parent.model_copy(update={name: changed})
    renewed: Config = changed
    return renewed
