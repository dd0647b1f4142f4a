"""The laser and the screen of [D14] sec. 6.2: directions of the pixels, the light, and the bands of an image.

The beam meets the sample at 45 deg. The screen is 100 mm from it, parallel to the incoming beam and thus square to
the mirror direction, whose spot is its middle. [D14] does not state its size: 200 mm a side fills the plane of
incidence from the normal to the horizon.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from pipeline.arrays import Array
from pipeline.config.models import Accuracy, Config
from pipeline.evaluation.figures.maps import Bands, bands_of
from pipeline.optics import geometry
from pipeline.optics.coherence import Coherence
from pipeline.optics.light import Light
from pipeline.optics.material import Material
from pipeline.optics.scene import Direction, Scene
from pipeline.tables.polar.layout import PolarLayout

LIGHT = Direction(theta_deg=45.0, phi_deg=180.0)
APERTURE_UM = 65.0
# the screen shows little else but the light near the mirror direction, which random directions seldom meet
DELTA_E = 0.04
# columns this near the middle hold the spot and a vertical band; rows this near it hold the primary band
_SPOT_MM, _PRIMARY_MM = 15.0, 8.0

# XYZ (directions, 3) under 1 RU for wi, wr (directions, 3)
Colour = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Screen:
    """A square screen, square to the mirror direction of `light` and centred on it.

    samples: directions a side of every pixel, whose XYZ are averaged: 1 takes its middle alone ([D14] 6.2 averages
    over the solid angle of a pixel).
    """

    light: Direction
    pixels: int
    side_mm: float = 200.0
    distance_mm: float = 100.0
    samples: int = 1

    def axis_mm(self) -> Array:
        """Return the middles of the pixels along x, and along y upwards, from the spot."""
        return _middles(self.pixels, self.side_mm)

    def directions(self) -> tuple[Array, Array]:
        """Return wi and wr (directions, 3), row by row from the top.

        +x leans away from the normal, in the plane of incidence; +y lies in the sample's plane, a quarter turn on
        from the mirror direction's azimuth.
        """
        wi = geometry.direction(np.radians(self.light.theta_deg), np.radians(self.light.phi_deg))
        mirror = np.array([-wi[0], -wi[1], wi[2]])
        along_y = np.cross([0.0, 0.0, 1.0], mirror)
        along_y /= np.linalg.norm(along_y)
        along_x = np.cross(along_y, mirror)
        along = _middles(self.pixels * self.samples, self.side_mm)
        x, y = np.meshgrid(along, -along)
        place = self.distance_mm * mirror + x[..., None] * along_x + y[..., None] * along_y
        wr = (place / np.linalg.norm(place, axis=-1, keepdims=True)).reshape(-1, 3)
        return np.broadcast_to(wi, wr.shape), wr

    def image(self, values: Array) -> Array:
        """Return pixels (pixels, pixels, channels): the mean of each one's directions (directions, channels)."""
        n, k = self.pixels, self.samples
        return np.asarray(values.reshape(n, k, n, k, -1).mean(axis=(1, 3)))

    def show(self, colour: Colour) -> Array:
        """Return XYZ (pixels, pixels, 3) of a method."""
        return self.image(colour(*self.directions()))


def _middles(count: int, side_mm: float) -> Array:
    return ((np.arange(count) + 0.5) / count - 0.5) * side_mm


def experiment(config: Config) -> Config:
    """Return the config of a surface under [D14]'s laser, aperture and gold."""
    laser = str(files("pipeline.optics").joinpath("data", "supercontinuum.csv"))
    return config.model_copy(
        update={
            "coherence": Coherence(sigma_um=APERTURE_UM / 4.0),
            "light": Light(illuminant=laser),
            "material": Material(fresnel="conductor", metal="Au", normalisation="relative"),
            "table": PolarLayout(),
            "accuracy": Accuracy(delta_e=DELTA_E),
            "scene": Scene(lights=[LIGHT]),
        }
    )


def screen_bands(luminance: Array, axis_mm: Array) -> Bands:
    """Find the bands of an image of Y (pixels, pixels) without the spot's columns; `axis_mm` (pixels,) is from it."""
    return bands_of(luminance[:, np.abs(axis_mm) > _SPOT_MM].mean(axis=1), axis_mm, _PRIMARY_MM)
