"""The plan of a polar table for an error budget: numbers of terms, nodes, rings and azimuths, and the quadrature.

Numbers of terms and nodes follow from the tails of the series: Bessel functions are the Chebyshev coefficients of the
exponential (Jacobi-Anger expansion). The grid depends on the surface and is searched for.
"""

from dataclasses import dataclass
from math import ceil

from pipeline.diffraction import expansion, power_spectrum
from pipeline.diffraction.polar_grid import Azimuths, PolarGrid, Rings
from pipeline.diffraction.tiles import thinned
from pipeline.optics.brdf import Radiometry
from pipeline.optics.light import LaserLine, Light
from pipeline.optics.material import Material
from pipeline.progress import Progress, silent
from pipeline.scene.model import Scene
from pipeline.scene.visited import rho_max
from pipeline.surface.heightfield import HeightField
from pipeline.surface.windows import Places
from pipeline.tables.polar.bake import PolarBake
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.polar.planning import flank
from pipeline.tables.polar.planning.grid_search import GridSearch
from pipeline.tables.polar.planning.trial import Trial

# relative error allowed in each approximation, per unit of the budget in dE
AMPLITUDE_SHARE = 1e-4  # of P, by truncation of the series and by the cut of the window
_NODES_SHARE = 0.005  # of E, by its nodes in s
_W_SHARE, _W_SHARE_OF_A_LINE = 0.3, 0.1  # of the table, by its terms in |w|, for a budget of at most 0.1
# of the spectral integral, by its wavelengths. A quarter of the share costs 5 % of a table's time and lowers its mean
# error by 5 %; below the limit other errors are larger
_QUADRATURE_SHARE, _QUADRATURE_LIMIT = 3e-3, 3e-5
# grey, so that one plan serves every material
MATERIAL = Material(normalisation="relative")


@dataclass(frozen=True)
class Budget:
    """The mean CIELAB error allowed, `delta_e`, at an exposure of `exposure_ru`, RU."""

    delta_e: float
    exposure_ru: float

    @property
    def quadrature(self) -> float:
        """Relative error allowed in the wavelength quadrature of each ring."""
        allowed = _QUADRATURE_SHARE * self.delta_e
        return max(0.25 * allowed, min(allowed, _QUADRATURE_LIMIT))


@dataclass(frozen=True)
class Plan:
    """The numbers chosen for a polar table.

    terms: Chebyshev terms of the stack. s_nodes: Chebyshev nodes of E in s. w_terms: Chebyshev terms in |w|.
    azimuths, rings: the grid.
    probed_delta_e: mean CIELAB error at the test directions; None if the layout sets both numbers of the grid.
    """

    terms: int
    s_nodes: int
    w_terms: int
    azimuths: Azimuths
    rings: Rings
    probed_delta_e: float | None

    @property
    def texels(self) -> int:
        """Number of texels of one output of the table."""
        return thinned(PolarGrid(self.rings, self.azimuths)).texels

    def bake(self, radiometry: Radiometry, budget: Budget, layout: PolarLayout) -> PolarBake:
        """Makes the settings of a bake by this plan.

        radiometry: any light of the planned wavelengths, and any material. budget, layout: those of the plan.
        """
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


def start(
    field: HeightField,
    places: Places,
    sigma_um: float,
    light: Light,
    scene: Scene | None,
    budget: Budget,
    layout: PolarLayout,
    progress: Progress = silent,
) -> Trial:
    """Chooses all numbers of terms and nodes for a budget, and transforms the heights.

    field: the whole scan. places: positions of the coherence window (pipeline.surface.windows).
    sigma_um: standard deviation of the window, um. light: the range of wavelengths, or a laser line.
    scene: lights and views, None for all. budget: the error allowed. layout: numbers that are set.
    progress: called with the share done.
    Returns the trial for `choose`. Raises AccuracyError if the samples do not resolve the window, ResourceError if
    the stack does not fit into memory, and DeviceError if no device works.
    """
    bake = numbers(field.half_range_um, sigma_um, light, scene, budget, layout)
    return Trial(bake, field, places, progress)


def numbers(
    half_range_um: float, sigma_um: float, light: Light, scene: Scene | None, budget: Budget, layout: PolarLayout
) -> PolarBake:
    """Chooses the numbers of terms and nodes for a budget; the parameters are those of `start`.

    half_range_um: half of the height range, um.
    """
    lambda_min, probing = light.lambda_min_nm, _probing_light(light, layout)
    z = expansion.largest_phase(half_range_um, lambda_min)
    amplitude = AMPLITUDE_SHARE * budget.delta_e
    z_luminous = z * lambda_min / probing.middle_nm
    return PolarBake(
        radiometry=Radiometry(probing, MATERIAL, sigma_um),
        lambda_min_nm=lambda_min,
        rho_max=rho_max(scene),
        spacing=_spacing(probing),
        terms=expansion.chebyshev_order(z, amplitude) + 1 if layout.terms == "auto" else layout.terms,
        tolerance=amplitude,
        s_nodes=expansion.chebyshev_order(power_spectrum.S_REACH * z, min(0.1, _NODES_SHARE * budget.delta_e)) + 1,
        w_terms=_w_terms(z_luminous, probing, budget) if layout.w_terms == "auto" else layout.w_terms,
        quadrature_error=budget.quadrature,
    )


def choose(trial: Trial, scene: Scene | None, budget: Budget, layout: PolarLayout) -> Plan:
    """Searches for the smallest grid that keeps the budget on the trial's window, and the flank's limit.

    trial: made by `start` with the same scene, budget and layout. It takes the terms and nodes that the flank needs.
    Returns the plan. Raises ResourceError if a grid needs more memory than is allowed.
    """
    bake, distance = flank.choose(trial, layout, scene, budget.delta_e)
    trial.adopt(bake)
    azimuths, rings, error = GridSearch(trial, layout, scene, budget.delta_e, budget.exposure_ru, distance).run()
    return Plan(bake.terms, bake.s_nodes, bake.w_terms, azimuths, rings, error)


def w_terms_within(half_width: float, half_range_um: float, light: Light, budget: Budget, layout: PolarLayout) -> int:
    """Computes the number of nodes in |w| for an interval of `half_width`, a multiple of 4.

    half_range_um: half of the height range, um. light, budget, layout: as in `start`.
    """
    probing = _probing_light(light, layout)
    return _w_terms(half_width * expansion.largest_phase(half_range_um, probing.middle_nm), probing, budget)


def _w_terms(phase: float, light: Light, budget: Budget) -> int:
    """Computes the number of terms in |w|, a multiple of 4, for a phase k |w| H at the luminous middle.

    The shorter wavelengths of white light contribute little to the colour error.
    """
    share = _W_SHARE_OF_A_LINE if light.is_line else _W_SHARE
    return 4 * ceil((expansion.chebyshev_order(phase, share * min(0.1, budget.delta_e)) + 1) / 4)


def _probing_light(light: Light, layout: PolarLayout) -> Light:
    """Chooses the light for planning: equal energy over the range, or a laser line, and the standard observer.

    E serves all illuminants and observers, so the plan depends on none of a config's.
    """
    if light.is_line:
        return Light(illuminant=light.illuminant)
    if layout.form == "spectral":
        return Light(illuminant=LaserLine(lambda_nm=light.middle_nm))
    return Light(illuminant="E", range_nm=light.range_nm)


def _spacing(light: Light) -> float:
    """Chooses the distance of the radii of E, in sigma_f; an integral over wavelengths allows a larger one."""
    return power_spectrum.SPACING_OF_A_LINE if light.is_line else power_spectrum.SPACING
