"""Exact XYZ at test directions of the planner, from the power spectrum at their own radii and azimuths."""

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction import power_spectrum
from pipeline.diffraction.dft_stack import Stack
from pipeline.tables.polar import spectral_integral
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.bake import PolarBake


def exact(bake: PolarBake, stack: Stack, half_turn: Array, rho: Array, w: Array) -> Array:
    """Computes XYZ / (C cos ti) from E itself.

    bake: numbers of nodes in s and terms in |w|, and the reach of E. stack: the window's.
    half_turn: azimuths (a,), radians; their opposites follow. rho: radii (n_rho,).
    w: (n_rho, 2 a). Returns (n_rho, 2 a, 3).
    """
    found = power_spectrum.gather(stack, half_turn, bake.radius_per_um, bake.lambda_min_nm, bake.s_nodes)
    s_max = power_spectrum.s_max(bake.lambda_min_nm)
    terms = spectral_integral.integrate(found, bake.radius_per_um, s_max, rho, bake.rules(rho), bake.w_terms)
    cosines = np.cos(np.arange(bake.w_terms) * np.arccos(polar.w_position(rho[:, None], w))[..., None])
    return np.asarray(np.einsum("rcka,rak->rac", terms, cosines))
