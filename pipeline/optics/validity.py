"""Where the scalar model ends: its largest errors against coupled waves, as manifests and docs/accuracy.md have them.

The error is that of an order's efficiency, a share of what the flat surface reflects, in unpolarised light: the first
order of sinusoids and of blazes with a vertical facet, of aluminium and of a dielectric of n = 1.5, under 0 and 30
degrees. The validation bench measures it again and holds this table against it (evaluation/figures/validity.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.surface.statistics import Period

# an order whose efficiency errs by more than this is outside the domain
TOLERATED = 0.05

# of a harmonic and its fundamental
_SAME_DIRECTION_DEG, _SAME_PERIOD = 10.0, 0.05

# periods from here on, and depths from crest to valley up to here, in wavelengths
PERIODS = (1.5, 2.4, 3.8, 6.2, 12.6)
DEPTHS = (0.1, 0.2, 0.3, 0.5)
# largest error (periods, depths): of slopes without edges, and where a facet drops
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
    """Where a surface lies: its period over the wavelength, and the largest errors there.

    smooth: as of a sinusoid of the same rms height; edged: as of a blaze. None beyond the table.
    """

    period: float
    smooth: float | None
    edged: float | None

    @property
    def within(self) -> bool:
        """Whether the model holds for such a surface even with edges."""
        return self.edged is not None and self.edged <= TOLERATED


def largest_error(errors: tuple[tuple[float, ...], ...], period: float, depth: float) -> float | None:
    """The table's entry for a period and a depth in wavelengths; None of finer periods and of deeper reliefs."""
    row = sum(period >= each for each in PERIODS) - 1
    column = sum(depth > each for each in DEPTHS)
    return errors[row][column] if row >= 0 and column < len(DEPTHS) else None


def finest_period_um(periods: "Sequence[Period]") -> float:
    """The finest of a surface's significant periods; infinite of none.

    A harmonic of a stronger period is that one's shape: it belongs to the edge and not to the orders' directions.
    """
    strongest_first = sorted(periods, key=lambda period: -period.share)
    own = [
        period
        for i, period in enumerate(strongest_first)
        if not any(_is_harmonic(period, stronger) for stronger in strongest_first[:i])
    ]
    return min((period.period_um for period in own), default=inf)


def _is_harmonic(period: "Period", of: "Period") -> bool:
    ratio = of.period_um / period.period_um
    turn = abs(period.direction_deg - of.direction_deg)
    # directions are of lines, and -89 degrees is next to 90
    along = min(turn, 180.0 - turn) < _SAME_DIRECTION_DEG
    return along and round(ratio) >= 2 and abs(ratio - round(ratio)) < _SAME_PERIOD * ratio


def place(period_um: float, sigma_h_um: float, lambda_nm: float) -> Place:
    """Where a surface lies whose finest significant period and rms height are these.

    From crest to valley a sinusoid is 2 sqrt(2) of its rms height deep and a sawtooth sqrt(12).
    """
    lambda_um = 1e-3 * lambda_nm
    period, sigma_h = period_um / lambda_um, sigma_h_um / lambda_um
    return Place(
        period,
        largest_error(SMOOTH, period, 2.0 * sqrt(2.0) * sigma_h),
        largest_error(EDGED, period, sqrt(12.0) * sigma_h),
    )
