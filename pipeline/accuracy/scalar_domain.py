"""Domain of the scalar model: its largest errors against rigorous coupled waves, as manifests state them.

The error is that of an order's efficiency, as a share of what the flat surface reflects, in unpolarised light. It is
taken over the first orders of sinusoids and of blazes with a vertical facet, made of aluminium and of a dielectric of
n = 1.5, under light at 0 and 30 degrees. The validation bench measures these numbers again and compares them with the
tables here (evaluation/figures/validity.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

from pipeline.surface.periods import Period

# the domain ends where the efficiency of an order errs by more than this
TOLERATED = 0.05

# how far a harmonic may lie from the direction of its fundamental, and from a whole fraction of its period
_SAME_DIRECTION_DEG, _SAME_PERIOD = 10.0, 0.05

# lower limits of the period and upper limits of the depth from crest to valley, both in wavelengths
PERIODS = (1.5, 2.4, 3.8, 6.2, 12.6)
DEPTHS = (0.1, 0.2, 0.3, 0.5)
# largest error (periods, depths) of slopes without edges, and of profiles with a vertical facet
SMOOTH = (
    (0.01, 0.04, 0.16, 0.17),
    (0.01, 0.01, 0.02, 0.04),
    (0.01, 0.01, 0.02, 0.04),
    (0.01, 0.01, 0.01, 0.01),
    (0.01, 0.01, 0.01, 0.01),
)
EDGED = (
    (0.05, 0.07, 0.17, 0.52),
    (0.01, 0.04, 0.08, 0.24),
    (0.01, 0.04, 0.05, 0.13),
    (0.01, 0.01, 0.04, 0.09),
    (0.01, 0.01, 0.02, 0.04),
)


@dataclass(frozen=True)
class Place:
    """The position of a surface in the tables, and the model's largest errors there.

    period: the surface's finest significant period, in wavelengths.
    smooth: largest error for a sinusoid of the same rms height; None beyond the table.
    edged: largest error for a blaze of the same rms height; None beyond the table.
    """

    period: float
    smooth: float | None
    edged: float | None

    @property
    def within(self) -> bool:
        """Whether the error is tolerable even if the surface has edges."""
        return self.edged is not None and self.edged <= TOLERATED


def largest_error(errors: tuple[tuple[float, ...], ...], period: float, depth: float) -> float | None:
    """Looks up the largest error.

    errors: SMOOTH or EDGED, (periods, depths).
    period, depth: in wavelengths; depth from crest to valley.
    Returns None for periods below the table's and depths above it.
    """
    row = sum(period >= each for each in PERIODS) - 1
    column = sum(depth > each for each in DEPTHS)
    return errors[row][column] if row >= 0 and column < len(DEPTHS) else None


def finest_period_um(periods: Sequence[Period]) -> float:
    """Returns the finest of a surface's significant periods, um; infinity without any.

    A harmonic of a stronger period does not count: it describes the profile within that period, and the tables
    distinguish profiles by their edges.
    """
    strongest_first = sorted(periods, key=lambda period: -period.share)
    own = [
        period
        for i, period in enumerate(strongest_first)
        if not any(_is_harmonic(period, stronger) for stronger in strongest_first[:i])
    ]
    return min((period.period_um for period in own), default=inf)


def _is_harmonic(period: Period, of: Period) -> bool:
    ratio = of.period_um / period.period_um
    turn = abs(period.direction_deg - of.direction_deg)
    # directions are those of lines: -89 degrees is next to 90
    along = min(turn, 180.0 - turn) < _SAME_DIRECTION_DEG
    return along and round(ratio) >= 2 and abs(ratio - round(ratio)) < _SAME_PERIOD * ratio


def place(period_um: float, sigma_h_um: float, lambda_nm: float) -> Place:
    """Finds the position of a surface in the tables.

    period_um: finest significant period, um. sigma_h_um: rms height, um. lambda_nm: wavelength, nm.
    A sinusoid is 2 sqrt(2) sigma_h deep from crest to valley, a sawtooth sqrt(12) sigma_h.
    """
    lambda_um = 1e-3 * lambda_nm
    period, sigma_h = period_um / lambda_um, sigma_h_um / lambda_um
    return Place(
        period,
        largest_error(SMOOTH, period, 2.0 * sqrt(2.0) * sigma_h),
        largest_error(EDGED, period, sqrt(12.0) * sigma_h),
    )
