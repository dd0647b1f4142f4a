"""The exact reference as a method: the sum over samples at every nanometre, which all others are held against."""

from pipeline.arrays import Array
from pipeline.config.models import Config
from pipeline.diffraction.reference import Reference
from pipeline.surface.heightfield import HeightField


class Exact:
    """|P|^2 of the window in the patch's middle to 1e-9 of the mirror, XYZ at 1 nm (diffraction.reference)."""

    source = "this project: Chebyshev terms, windowed DFT, 1 nm"

    def __init__(self, field: HeightField, config: Config) -> None:
        """Raises AccuracyError where the samples do not resolve the window; DeviceError where no device works."""
        self._config = config
        self._reference = Reference(field, config.coherence.sigma_um, config.light.lambda_min_nm)

    @property
    def stored_bytes(self) -> int:
        """Of the DFT of every term, which each answer gathers from."""
        return self._reference.stored_bytes

    def xyz(self, wi: Array, wr: Array) -> Array:
        """Return XYZ (directions, 3) under 1 RU; `wi` and `wr` are (directions, 3) each."""
        return self._reference.xyz(self._config.light, self._config.material, wi, wr)

    def power(self, uvw: Array, lambda_nm: Array) -> Array:
        """Return |P|^2 (directions, L); NaN beyond the Nyquist limits."""
        return self._reference.power(uvw, lambda_nm)
