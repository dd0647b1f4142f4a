"""The layout of a recipe's samples: a whole number of periods on a whole number of samples."""

from dataclasses import dataclass
from math import gcd, radians, tan
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import ConfigError
from pipeline.surface.recipes.parameters import (
    LARGEST_RANGE_UM,
    Blazed,
    CompactDisc,
    Elaphe,
    GaussianRandom,
    Mirror,
    Recipe,
    RecipeBase,
    Rectangular,
    Sinusoid,
    TiltedMirror,
    Xenopeltis,
)
from pipeline.validated import as_pair

# 8 GiB per field: beyond this, a size or a pitch was given in a wrong unit
_MOST_SAMPLES = 2**30
# run lengths of a compact disc, in channel bits
SHORTEST_RUN = 3
LONGEST_RUN = 11


@dataclass(frozen=True)
class Axis:
    """One axis of a patch.

    size_um: length, um. samples: number of samples. periods: number of whole periods.
    """

    size_um: float
    samples: int
    periods: int

    @property
    def pitch_um(self) -> float:
        """Sample distance, um: size / samples, close to the requested pitch."""
        return self.size_um / self.samples

    def phase(self) -> NDArray[np.float64]:
        """Computes the position within the period, (samples,), in [0, 1), which is 0 at the middle sample n // 2.

        The division of integers is the only operation that rounds, so that equal phases are equal numbers.
        """
        turns = (np.arange(self.samples) - self.samples // 2) * self.periods % self.samples
        return turns / self.samples

    @property
    def phase_step(self) -> float:
        """Distance between neighbouring phases: gcd(periods, samples) / samples."""
        return gcd(self.periods, self.samples) / self.samples


@dataclass(frozen=True)
class Patch:
    """Both axes of a patch, whose arrays have the shape (y.samples, x.samples)."""

    x: Axis
    y: Axis

    @property
    def shape(self) -> tuple[int, int]:
        """Samples as (ny, nx)."""
        return self.y.samples, self.x.samples

    @property
    def size_um(self) -> tuple[float, float]:
        """Extent along (x, y), um."""
        return self.x.size_um, self.y.size_um

    @property
    def pitch_um(self) -> tuple[float, float]:
        """Sample distance along (x, y), um."""
        return self.x.pitch_um, self.y.pitch_um


def patch_of(recipe: Recipe) -> Patch:
    """Lays out the patch of a recipe, without making heights.

    Raises ConfigError where the pitch is too coarse for the structure, or the patch too small.
    """
    match recipe:
        case Sinusoid() | Rectangular() | Blazed():
            along_x = recipe.axis == "x"
            return _lay_out(recipe, *((recipe.period_um, None) if along_x else (None, recipe.period_um)))
        case CompactDisc():
            return _disc_patch(recipe)
        case GaussianRandom():
            return _gaussian_patch(recipe)
        case Elaphe():
            return _lay_out(recipe, period_x_um=recipe.across_um)
        case Xenopeltis():
            return _lay_out(recipe, recipe.across_um, recipe.along_um)
        case TiltedMirror():
            return _tilted_patch(recipe)
        case Mirror():
            return _lay_out(recipe)
        case _:
            assert_never(recipe)


def _tilted_patch(recipe: TiltedMirror) -> Patch:
    """Lays out a plane that rises no higher along either axis than scans may."""
    patch = _lay_out(recipe)
    for name, size, tilt in zip("xy", patch.size_um, (recipe.tilt_x_deg, recipe.tilt_y_deg), strict=True):
        height = size * abs(tan(radians(tilt)))
        if height > LARGEST_RANGE_UM:
            text = f"expected a rise of at most {LARGEST_RANGE_UM:g} um over {size:g} um, got {height:.4g} um"
            raise refusal(recipe, f"tilt_{name}_deg", text)
    return patch


def _disc_patch(recipe: CompactDisc) -> Patch:
    """Lays out whole bits along x, for at least one pit and one land, and whole tracks along y."""
    if recipe.pit_width_um > recipe.track_um:
        text = f"expected at most track_um = {recipe.track_um:g} um, got {recipe.pit_width_um:g} um"
        raise refusal(recipe, "pit_width_um", text)
    patch = _lay_out(recipe, period_x_um=recipe.bit_um, period_y_um=recipe.track_um)
    if patch.x.periods < 2 * SHORTEST_RUN:
        need = 2 * SHORTEST_RUN * recipe.bit_um
        raise refusal(recipe, "size_um", f"expected at least {2 * SHORTEST_RUN} bits ({need:g} um) along x")
    return patch


def _gaussian_patch(recipe: GaussianRandom) -> Patch:
    """Lays out at least two samples per correlation length, and at least one correlation length per axis."""
    patch = _lay_out(recipe)
    for name, length, axis in zip("xy", as_pair(recipe.correlation_um), (patch.x, patch.y), strict=True):
        if not 2 * axis.pitch_um <= length <= axis.size_um:
            span = f"{2 * axis.pitch_um:g} to {axis.size_um:g} um (two samples to the whole patch)"
            raise refusal(recipe, "correlation_um", f"expected {span} along {name}, got {length:g} um")
    return patch


def _lay_out(recipe: RecipeBase, period_x_um: float | None = None, period_y_um: float | None = None) -> Patch:
    """Lays out the patch with whole periods, at least one per axis, that is closest to `size_um` and `pitch_um`.

    An axis without a period keeps its size. Raises ConfigError where a period has less than two samples (the Nyquist
    limit), or where the patch would not fit into memory.
    """
    sizes, pitches = as_pair(recipe.size_um), as_pair(recipe.pitch_um)
    axes = [
        _lay_out_axis(recipe, name, size, pitch, period)
        for name, size, pitch, period in zip("xy", sizes, pitches, (period_x_um, period_y_um), strict=True)
    ]
    samples = axes[0].samples * axes[1].samples
    if samples > _MOST_SAMPLES:
        found = f"{axes[0].samples} x {axes[1].samples}"
        raise refusal(recipe, "pitch_um", f"expected a patch of at most 2^30 samples, got {found}")
    return Patch(*axes)


def _lay_out_axis(recipe: RecipeBase, name: str, size: float, pitch: float, period: float | None) -> Axis:
    periods = 1 if period is None else max(1, round(size / period))
    size = size if period is None else periods * period
    samples = max(1, round(size / pitch))
    if period is not None and samples < 2 * periods:
        raise refusal(
            recipe, "pitch_um", f"expected at most half the {name} period of {period:g} um, got {pitch:g} um"
        )
    return Axis(size, samples, periods)


def refusal(recipe: RecipeBase, key: str, text: str) -> ConfigError:
    """Returns the ConfigError for one key of a recipe."""
    kind = getattr(recipe, "kind", "recipe")
    return ConfigError(f"recipe {kind}", [(f"surface.recipe.{key}", text)])


def generator(seed: int) -> np.random.Generator:
    """Returns the random numbers of a seed, which may be negative."""
    return np.random.default_rng(seed % 2**64)
