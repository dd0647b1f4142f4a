"""Directions for the laws that must hold for all of them."""

import numpy as np
from hypothesis import strategies as st

from pipeline.arrays import Array
from pipeline.optics import geometry


def directions(theta_max_deg: float = 89.0) -> st.SearchStrategy[Array]:
    """Unit vectors above the surface, up to a polar angle."""
    angles = st.tuples(st.floats(0.0, np.radians(theta_max_deg)), st.floats(-np.pi, np.pi))
    return angles.map(lambda a: geometry.direction(*a))


def tilted(theta_deg: float, phi_deg: float = 0.0) -> Array:
    """One direction, by its angles in degrees."""
    return geometry.direction(np.radians(theta_deg), np.radians(phi_deg))
