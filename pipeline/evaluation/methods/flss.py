"""FLSS and PQ of [S14] 1.3.2 and 1.5.3: all wavelengths in even steps, a neighbourhood of the precomputed DFT terms.

FLSS (alg. 3) is P(f) = sum_k F_k exp(-|f - f_k|^2 / (2 sigma_f^2)) over the coefficients around floor(s(f)), eq.
1.7-1.10. With F_k divided by the number of samples the weights need no factor: they are the window's transform over
its own sum, to 2 exp(-2 pi^2 (sigma / pitch)^2), and over all k the sum is the exact P of [D14] eq. 8.

The neighbourhood is centred on floor(s), as published, so it reaches up to one coefficient less far above the
position than below it. 3 x 3 then leaves out a coefficient that is hardly more than one spacing away, and P jumps
where s passes a whole number: on 65 um = 4 sigma by up to 0.29 of a neighbour. Centred on the nearest coefficient
3 x 3 would err a quarter as much: on *Elaphe* 0.48 instead of 1.78 mean dE at 7500 RU, both at 5 nm.

4 sigma_f are taken on either side, [D14] sec. 5's 3e-4, by the smallest such box: on 65 um 7 x 7, 4.7 sigma_f. Should
[S14] 1.3.2 mean the whole width of the window instead, then it asks for 3 x 3, which is as wide as that.

PQ is a patch repeated a finite number of times: the neighbourhood is weighed by a sinc, and P multiplied by
pq = (p^2 + q^2)^(1/2), eq. 1.15. [S14] points to its theory's chapter for the sinc and for p and q; the chapter is
not among the sources here. The choices made, and their reasons:

- A patch of width X, repeated n times side by side, has the transform of one patch times the geometric series
  sum_(m < n) exp(2 pi i m f X). That complex number is p + i q, so pq is its modulus, here divided by n:
  |sin(pi n f X) / (n sin(pi f X))|. Along two axes the series multiply, and so do their moduli.
- One patch is a box X wide, so its transform between the coefficients f_k = k / X is sum_k F_k sinc((f - f_k) X)
  along each axis: the sampling theorem, domains exchanged. sinc(d) = sin(pi d) / (pi d), as footnote 31 multiplies
  the distance by pi. A sinc of the distance in the plane would not interpolate, so it is one factor an axis.

Together they are the transform of n x n patches under a box instead of a Gaussian. Next to every order are the side
lobes of the box, two patches are dark at every half coefficient, and along wavelengths these are colour fringes,
which steps of 5 nm no longer follow: on *Elaphe* they cost 1.7 mean dE at 7500 RU where FLSS's cost 0.26. At a
coefficient's own frequency sinc = pq = 1 and |P|^2 = |F_k|^2; a mirror gives 1.
"""

from math import ceil, pi

from scipy.special import diric

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.evaluation.methods.dft_terms import FOUR_SIGMA, Lookup, Reach
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, Monochromatic
from pipeline.surface.heightfield import HeightField

# [D14] 4.2: coherent light spans 4 sigma
_COHERENT_SIGMAS = 4.0
# with one patch there is no series, and pq = 1 everywhere
_FEWEST_PATCHES = 2


class Flss(Monochromatic):
    """The full spectrum, evenly sampled ([S14] 1.3.2): its reference shader."""

    source = "[S14] alg. 1 and 3, eq. 1.1 and 1.5-1.10"

    def __init__(
        self,
        field: HeightField,
        config: Config,
        *,
        terms: int | None = None,
        reach: Reach = FOUR_SIGMA,
        step_nm: float = PUBLISHED_STEP_NM,
    ) -> None:
        """`terms`: T + 1 of alg. 1; None takes enough for 1e-6 of exp(i k w h).

        Raises DeviceError where no device works.
        """
        super().__init__(config, step_nm)
        self._lookup = Lookup(field, config, terms, reach)
        self.terms, self.stored_bytes = self._lookup.terms, self._lookup.stored_bytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        return self._lookup.power("gaussian", uvw, lambda_nm)


class Pq(Monochromatic):
    """A finite crystal of patches ([S14] 1.5.3)."""

    source = "[S14] 1.5.3, eq. 1.15"

    def __init__(
        self,
        field: HeightField,
        config: Config,
        *,
        patches: tuple[int, int] | None = None,
        reach: Reach = FOUR_SIGMA,
    ) -> None:
        """`patches`: repetitions of the patch along (x, y); None takes as many as 4 sigma hold, at least two.

        Raises DeviceError where no device works.
        """
        super().__init__(config)
        self._size_um = field.size_um
        self._patches = patches or _patches(field.size_um, config.coherence.sigma_um)
        self._lookup = Lookup(field, config, None, reach)
        self.stored_bytes = self._lookup.stored_bytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        power = self._lookup.power("sinc", uvw, lambda_nm)
        for axis, (count, size) in enumerate(zip(self._patches, self._size_um, strict=True)):
            f = uvw[:, axis, None] / (1e-3 * lambda_nm)
            power *= diric(2.0 * pi * f * size, count) ** 2
        return power


def _patches(size_um: tuple[float, float], sigma_um: float) -> tuple[int, int]:
    """The fewest patches along (x, y) that span 4 sigma, to rounding."""
    x, y = (max(_FEWEST_PATCHES, ceil(_COHERENT_SIGMAS * sigma_um / size - 1e-9)) for size in size_um)
    return x, y
