"""Mirrors and one-dimensional gratings: surfaces whose diffraction is known in closed form."""

from math import radians, tan
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.heightfield import HeightField
from pipeline.surface.recipes.parameters import Blazed, Mirror, Rectangular, Sinusoid, TiltedMirror
from pipeline.surface.recipes.patch import Axis, Patch, patch_of


def mirror(recipe: Mirror | TiltedMirror) -> HeightField:
    """h = x tan(tilt_x) + y tan(tilt_y), um: zero at the centre, rising along the axes for positive tilts."""
    patch = patch_of(recipe)
    field = HeightField(np.zeros(patch.shape), patch.pitch_um)
    if isinstance(recipe, Mirror):
        return field
    x, y = field.coordinates_um()
    plane = x * tan(radians(recipe.tilt_x_deg)) + y[:, None] * tan(radians(recipe.tilt_y_deg))
    return HeightField(plane, patch.pitch_um)


def sinusoid(recipe: Sinusoid) -> HeightField:
    """h = a cos(2 pi x / period), um, with a crest at x = 0."""
    patch, axis = _grating(recipe)
    return _extrude(recipe.amplitude_um * np.cos(2 * np.pi * axis.phase()), patch, recipe.axis)


def rectangular(recipe: Rectangular) -> HeightField:
    """`height_um` over the share `duty` of each period, else 0.

    A sample holds the mean height of its own pitch, so the mean is exactly duty * height; the raised part
    begins where the middle sample's pitch does. Where duty * period is a whole number of samples there are
    only the two heights; otherwise one sample a period lies between them, and exp(i k w h) is off the
    closed form by at most 2 / (samples per period).
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
    """A sawtooth rising along the axis from 0 to `height_um`, dropping once a period.

    Samples are heights at points, none averaged across the drop, so every sample lies on the ramp. They
    stand half a phase step off the drop: the phases that occur are (m + 1/2) / M, the midpoint rule, which
    makes the mean exactly height / 2 and leaves sums of exp(i k w h) exp(2 pi i m x / period) off the
    continuous integral by O(1 / M^2) only; M is the number of samples a period where that is whole.
    """
    patch, axis = _grating(recipe)
    return _extrude(recipe.height_um * (axis.phase() + 0.5 * axis.phase_step), patch, recipe.axis)


def _grating(recipe: Sinusoid | Rectangular | Blazed) -> tuple[Patch, Axis]:
    """The patch of a grating and its axis of variation."""
    patch = patch_of(recipe)
    return patch, patch.x if recipe.axis == "x" else patch.y


def _extrude(profile_um: NDArray[np.float64], patch: Patch, along: Literal["x", "y"]) -> HeightField:
    """The profile along one axis, constant along the other."""
    profile = profile_um if along == "x" else profile_um[:, None]
    return HeightField(np.broadcast_to(profile, patch.shape).copy(), patch.pitch_um)
