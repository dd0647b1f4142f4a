"""What a polar table is made of, chosen for an error budget: terms, nodes, rings, azimuths, quadrature.

What a series needs follows from its tail: Bessel's functions bound Chebyshev's coefficients of every exponential
(Jacobi-Anger). What the grid needs depends on the surface, so it is searched for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from pipeline.diffraction import expansion, power_spectrum
from pipeline.diffraction.polar_grid import RHO_MAX, Azimuths, Rings
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import LaserLine, Light
from pipeline.optics.material import Material
from pipeline.optics.scene import Scene
from pipeline.progress import Progress, silent
from pipeline.surface.heightfield import HeightField
from pipeline.tables.planning.grid_search import GridSearch
from pipeline.tables.planning.trial import Trial
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout

# shares of a budget of dE: what each approximation may leave, as relative amplitude or intensity
AMPLITUDE_SHARE = 1e-4  # of P, by terms left out and by the window's cut
_NODES_SHARE = 0.005  # of E, by its nodes in s
_W_SHARE, _W_SHARE_OF_A_LINE = 0.3, 0.1  # of the table, by its terms in |w|; of at most 0.1
_QUADRATURE_SHARE = 3e-3  # of each integral, by its wavelengths
_LUMINOUS_NM = 545.0  # the middle of D65 under the eye's Y


@dataclass(frozen=True)
class Budget:
    """The mean CIELAB error allowed at an exposure."""

    delta_e: float
    exposure_ru: float

    @property
    def quadrature(self) -> float:
        """Relative error that each ring's wavelengths may leave."""
        return _QUADRATURE_SHARE * self.delta_e


@dataclass(frozen=True)
class Plan:
    """What was chosen, and the mean error at the probes; None where no grid was searched for."""

    terms: int
    s_nodes: int
    w_terms: int
    azimuths: Azimuths
    rings: Rings
    probed_delta_e: float | None

    @property
    def texels(self) -> int:
        """Texels of one output of the table."""
        return self.rings.count * self.azimuths.count

    def bake(self, radiometry: Radiometry, budget: Budget, layout: PolarLayout) -> PolarBake:
        """The settings of the bake that this plan is of, under any light of its wavelengths and any material."""
        light = radiometry.light
        return PolarBake(
            radiometry=radiometry,
            lambda_min_nm=light.lambda_min_nm,
            rho_max=self.rings.rho_max,
            spacing=_spacing(_probing_light(light, layout)),
            terms=self.terms,
            tolerance=AMPLITUDE_SHARE * budget.delta_e,
            s_nodes=self.s_nodes,
            w_terms=self.w_terms,
            quadrature_error=budget.quadrature,
        )


def rho_max(scene: Scene | None) -> float:
    """How far out in (u, v) a table must reach: |wi| + |wr| along the surface, 2 without a scene."""
    if scene is None:
        return RHO_MAX
    view = np.sin(np.radians(scene.views.theta_max_deg))
    return float(min(RHO_MAX, max(np.sin(np.radians(light.theta_deg)) for light in scene.lights) + view))


def start(
    fields: Sequence[HeightField],
    sigma_um: float,
    light: Light,
    scene: Scene | None,
    budget: Budget,
    layout: PolarLayout,
    progress: Progress = silent,
) -> Trial:
    """Fixes all terms and nodes for a budget, and transforms the first window.

    fields: height fields of the coherence windows (pipeline.surface.windows), the middle's first.
    sigma_um: standard deviation of the window, um. light: only its wavelengths count, a range or a line.
    """
    lambda_min, probing = light.lambda_min_nm, _probing_light(light, layout)
    z = expansion.largest_phase(max(field.half_range_um for field in fields), lambda_min)
    amplitude = AMPLITUDE_SHARE * budget.delta_e
    z_luminous = z * lambda_min / _middle_nm(probing)
    bake = PolarBake(
        radiometry=Radiometry(probing, Material(), sigma_um),
        lambda_min_nm=lambda_min,
        rho_max=rho_max(scene),
        spacing=_spacing(probing),
        terms=expansion.chebyshev_order(z, amplitude) + 1 if layout.terms == "auto" else layout.terms,
        tolerance=amplitude,
        s_nodes=expansion.chebyshev_order(power_spectrum.S_REACH * z, min(0.1, _NODES_SHARE * budget.delta_e)) + 1,
        w_terms=_w_terms(z_luminous, probing, budget) if layout.w_terms == "auto" else layout.w_terms,
        quadrature_error=budget.quadrature,
    )
    return Trial(bake, fields[0], progress)


def choose(trial: Trial, scene: Scene | None, budget: Budget, layout: PolarLayout) -> Plan:
    """Searches the smallest grid that keeps a budget on the trial's window.

    Raises AccuracyError where the power spectrum would not fit into memory.
    """
    azimuths, rings, error = GridSearch(trial, layout, scene, budget.delta_e, budget.exposure_ru).run()
    bake = trial.bake
    return Plan(bake.terms, bake.s_nodes, bake.w_terms, azimuths, rings, error)


def _w_terms(phase: float, light: Light, budget: Budget) -> int:
    """Terms in |w|, in fours, for k |w| H at the luminous middle: white light's blue end hardly counts."""
    share = _W_SHARE_OF_A_LINE if light.is_line else _W_SHARE
    return 4 * ceil((expansion.chebyshev_order(phase, share * min(0.1, budget.delta_e)) + 1) / 4)


def _probing_light(light: Light, layout: PolarLayout) -> Light:
    """What the grid is planned under: E serves every illuminant of a range, so equal energy, or else one line."""
    if light.is_line:
        return light
    if layout.form == "spectral":
        return Light(illuminant=LaserLine(lambda_nm=_middle_nm(light)))
    return Light(illuminant="E", range_nm=light.range_nm)


def _middle_nm(light: Light) -> float:
    """The wavelength of a light that the eye weighs most."""
    if light.is_line:
        return light.lambda_min_nm
    return float(np.clip(_LUMINOUS_NM, *light.range_nm))


def _spacing(light: Light) -> float:
    """Distance of E's radii, in sigma_f: an integral over wavelengths averages out what a line shows."""
    return power_spectrum.SPACING_OF_A_LINE if light.is_line else power_spectrum.SPACING
