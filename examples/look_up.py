"""Prints the colours that a bundle reflects into some directions, for a light 30 degrees from the normal.

python examples/look_up.py BUNDLE
"""

import sys
from pathlib import Path

import numpy as np

from pipeline import Bundle
from pipeline.errors import BakeError
from pipeline.optics.geometry import direction

LIGHT_DEG = 30.0
# the light comes from +x; its mirror direction is -30 degrees
VIEWS_DEG = np.array([-60.0, -45.0, -30.0, -15.0, 0.0, 15.0])


def main(folder: Path) -> None:
    bundle = Bundle(folder)
    print(f"# {bundle.manifest['name']} {bundle.manifest['version']}: linear XYZ, {bundle.manifest['units']['XYZ']}")
    light = direction(np.radians(LIGHT_DEG), 0.0)
    views = direction(np.radians(np.abs(VIEWS_DEG)), np.where(VIEWS_DEG < 0, np.pi, 0.0))
    print("theta_r,X,Y,Z")
    for theta, xyz in zip(VIEWS_DEG, bundle.xyz(light, views), strict=True):
        print(f"{theta:g}," + ",".join(f"{value:.6g}" for value in xyz))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python look_up.py BUNDLE")
    try:
        main(Path(sys.argv[1]))
    except BakeError as error:
        sys.exit(str(error))
