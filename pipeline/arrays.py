"""The type of an array of real numbers, which all rooms share; docstrings give its shape and unit."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
