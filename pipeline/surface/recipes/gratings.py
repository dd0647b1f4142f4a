"""Mirrors and one-dimensional gratings: surfaces whose diffraction is known in closed form."""

from math import radians, tan
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed, Mirror, Rectangular, Sinusoid, TiltedMirror
from pipeline.surface.recipes.patch import Axis, Patch, patch_of


def mirror(recipe: Mirror | TiltedMirror) -> HeightField:
    """Makes h = x tan(tilt_x) + y tan(tilt_y), um, which is 0 at the middle sample."""
    patch = patch_of(recipe)
    field = HeightField(np.zeros(patch.shape), patch.pitch_um)
    if isinstance(recipe, Mirror):
        return field
    x, y = field.coordinates_um()
    plane = x * tan(radians(recipe.tilt_x_deg)) + y[:, None] * tan(radians(recipe.tilt_y_deg))
    return HeightField(plane, patch.pitch_um)


def sinusoid(recipe: Sinusoid) -> HeightField:
    """Makes h = a cos(2 pi x / period), um."""
    patch, axis = _grating(recipe)
    return _extrude(recipe.amplitude_um * np.cos(2 * np.pi * axis.phase()), patch, recipe.axis)


def rectangular(recipe: Rectangular) -> HeightField:
    """Makes a profile of `height_um` over the share `duty` of each period, and 0 elsewhere.

    Each sample is the mean height over its pitch, so that the mean is exactly duty * height. The raised part begins
    where the pitch of the middle sample begins. Where duty * period is a whole number of samples, only the two
    heights occur; otherwise one sample per period lies between them, and exp(i k w h) differs from the closed form by
    at most 2 / (samples per period).
    """
    patch, axis = _grating(recipe)
    begin = axis.phase()
    width = axis.periods / axis.samples
    # raised length below phase p is whole periods * duty + min(p mod 1, duty)
    end = begin + width
    raised = np.floor(end) * recipe.duty + np.minimum(end % 1, recipe.duty) - np.minimum(begin, recipe.duty)
    coverage = np.clip(raised / width, 0.0, 1.0)
    return _extrude(recipe.height_um * coverage, patch, recipe.axis)


def blazed(recipe: Blazed) -> HeightField:
    """Makes a sawtooth that rises along the axis from 0 to `height_um` and drops once per period.

    Samples are heights at points; an average across the drop would not lie on the ramp. The first phase is half a
    phase step after the drop, so that the phases (m + 1/2) / M are those of the midpoint rule: the mean is exactly
    height / 2, and sums of exp(i k w h) exp(2 pi i m x / period) differ from the integral by O(1 / M^2). M is the
    number of samples per period where that is an integer.
    """
    patch, axis = _grating(recipe)
    return _extrude(recipe.height_um * (axis.phase() + 0.5 * axis.phase_step), patch, recipe.axis)


def _grating(recipe: Sinusoid | Rectangular | Blazed) -> tuple[Patch, Axis]:
    """Lays out the patch of a grating; returns it and the axis along which heights vary."""
    patch = patch_of(recipe)
    return patch, patch.x if recipe.axis == "x" else patch.y


def _extrude(profile_um: NDArray[np.float64], patch: Patch, along: Literal["x", "y"]) -> HeightField:
    """Extends a profile, um, along the axis on which heights are constant."""
    profile = profile_um if along == "x" else profile_um[:, None]
    return HeightField(np.broadcast_to(profile, patch.shape).copy(), patch.pitch_um)
