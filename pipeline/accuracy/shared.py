"""An exact reference that several configs ask, which differ in light or material but not in |P|^2."""

from collections.abc import Sequence
from functools import cached_property
from hashlib import sha256

import numpy as np

from pipeline.arrays import Array
from pipeline.diffraction.reference import STEP_NM, Reference
from pipeline.optics.light import Light
from pipeline.optics.material import Material
from pipeline.progress import Progress, silent

Seen = tuple[Light, Material]
# of the answers that are kept for other configs: those on a map's 71 k views take 1.7 MB for each
MOST_BYTES = 2**26


class SharedReference(Reference):
    """A `Reference` that integrates each |P|^2 at once for all lights and materials that will be asked for.

    |P|^2 of a map takes seconds, its integral over wavelengths a twentieth of one. Answers for other lights and
    materials are kept, up to MOST_BYTES, until they are asked for at the same directions.

    following: lights and materials that will be asked for.
    """

    following: Sequence[Seen] = ()

    @cached_property
    def _kept(self) -> dict[str, Array]:
        return {}

    @cached_property
    def _single(self) -> dict[str, Array]:
        # |P|^2 of a few directions, by which the reference itself is checked
        return {}

    @property
    def nbytes(self) -> int:
        """Size in bytes of the height field, of the stack in memory and of all answers that are kept."""
        return super().nbytes + self._bytes_kept

    def xyz_of(
        self, seen: Sequence[Seen], wi: Array, wr: Array, step_nm: float = STEP_NM, progress: Progress = silent
    ) -> list[Array]:
        """Computes what `Reference.xyz_of` does, or takes it from the answers that were kept."""
        place = f"{_digest(wi, wr)} {step_nm}"
        if (kept := self._take(place, seen)) is not None:
            progress("reference", 1.0)
            return kept
        asked = self._with_following(seen)
        return self._keep(place, asked, super().xyz_of(asked, wi, wr, step_nm, progress))[: len(seen)]

    def xyz_and_middle(
        self, seen: Sequence[Seen], wi: Array, wr: Array, uvw: Array, lambda_nm: Array
    ) -> tuple[list[Array], Array]:
        """Computes what `Reference.xyz_and_middle` does, or takes it from the answers that were kept."""
        place, middle = _digest(wi, wr), f"middle {_digest(uvw, lambda_nm)}"
        if middle in self._single and (kept := self._take(place, seen)) is not None:
            return kept, self._single[middle]
        asked = self._with_following(seen)
        found, self._single[middle] = super().xyz_and_middle(asked, wi, wr, uvw, lambda_nm)
        return self._keep(place, asked, found)[: len(seen)], self._single[middle]

    def direct(self, uvw: Array, lambda_nm: Array) -> Array:
        """Computes what `Reference.direct` does, once for each set of directions."""
        place = f"direct {_digest(uvw, lambda_nm)}"
        if place not in self._single:
            self._single[place] = super().direct(uvw, lambda_nm)
        return self._single[place]

    @property
    def _bytes_kept(self) -> int:
        return sum(answer.nbytes for answer in self._kept.values())

    def _with_following(self, seen: Sequence[Seen]) -> list[Seen]:
        """Adds the lights and materials that follow, of the same wavelengths, each once."""
        light = seen[0][0]
        alike = [one for one in self.following if _wavelengths(one[0]) == _wavelengths(light)]
        return list(seen) + [one for i, one in enumerate(alike) if one not in seen and one not in alike[:i]]

    def _take(self, place: str, seen: Sequence[Seen]) -> list[Array] | None:
        """Takes the answers at a place out of those that were kept; None where one of them is not there."""
        names = [f"{place} {one}" for one in seen]
        if not all(name in self._kept for name in names):
            return None
        return [
            self._kept[name] if one in self.following else self._kept.pop(name)
            for name, one in zip(names, seen, strict=True)
        ]

    def _keep(self, place: str, asked: Sequence[Seen], found: list[Array]) -> list[Array]:
        """Keeps the answers for lights and materials that follow, while there is room."""
        for one, xyz in zip(asked, found, strict=True):
            if one in self.following and self._bytes_kept + xyz.nbytes <= MOST_BYTES:
                self._kept[f"{place} {one}"] = xyz
        return found


def _wavelengths(light: Light) -> tuple[float, ...]:
    return (light.lambda_min_nm,) if light.is_line else light.range_nm


def _digest(*arrays: Array) -> str:
    """Computes a name of directions."""
    found = sha256()
    for array in arrays:
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()
