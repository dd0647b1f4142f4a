"""FLSS of [S14] alg. 3: all wavelengths in even steps, a Gaussian neighbourhood of the precomputed DFT terms.

P(f) = sum_k F_k exp(-|f - f_k|^2 / (2 sigma_f^2)) over the coefficients around floor(s(f)), [S14] eq. 1.7-1.10. With
F_k divided by the number of samples the weights need no factor: they are the window's transform over its own sum, to
2 exp(-2 pi^2 (sigma / pitch)^2), and over all k the sum is the exact P of [D14] eq. 8.

The neighbourhood is centred on floor(s), as published, so it reaches up to one coefficient less far above the
position than below it. 3 x 3 then leaves out a coefficient that is hardly more than one spacing away, and P jumps
where s passes a whole number: on 65 um = 4 sigma by up to 0.29 of a neighbour. Centred on the nearest coefficient
3 x 3 would err a quarter as much: on *Elaphe* 0.48 instead of 1.78 mean dE at 7500 RU, both at 5 nm.

4 sigma_f are taken on either side, [D14] sec. 5's 3e-4, by the smallest such box: on 65 um 7 x 7, 4.7 sigma_f. Should
[S14] 1.3.2 mean the whole width of the window instead, then it asks for 3 x 3, which is as wide as that.
"""

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.evaluation.methods.dft_terms import FOUR_SIGMA, Lookup, Reach
from pipeline.evaluation.methods.method import PUBLISHED_STEP_NM, integrated
from pipeline.surface.heightfield import HeightField


class Flss:
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
        self._config, self._step_nm = config, step_nm
        self._lookup = Lookup(field, config, terms, reach)

    @property
    def terms(self) -> int:
        """T + 1 of alg. 1."""
        return self._lookup.terms

    @property
    def stored_bytes(self) -> int:
        return self._lookup.stored_bytes

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Return |P|^2 (directions, L), 1 of a mirror in its own reflection; NaN beyond the Nyquist limits."""
        return self._lookup.power("gaussian", uvw, lambda_nm)

    def xyz(self, wi: Array, wr: Array) -> Array:
        """Return XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""
        return integrated(self.power, self._config, wi, wr, self._step_nm)
