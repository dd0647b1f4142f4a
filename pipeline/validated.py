"""The base class and the field types of config sections, which are validated when they are made."""

import os
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo

# not strict, because TOML has arrays and no tuples
Pair = Annotated[tuple[float, float], Field(strict=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
# beyond these limits a unit is wrong; within them, no product of some of them overflows or vanishes
Magnitude = Annotated[float, Field(ge=1e-12, le=1e12)]
MagnitudePair = Annotated[tuple[Magnitude, Magnitude], Field(strict=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
# a length on a surface, um, from an atom's to a hand's: what lies beyond is given in a wrong unit
Length = Annotated[float, Field(ge=1e-4, le=1e5)]
LengthPair = Annotated[tuple[Length, Length], Field(strict=False)]
# an exposure, RU: 1 saturates a mirror, and the darkest surface that float32 holds is seen at the other end
Exposure = Annotated[float, Field(ge=1e-6, le=1e12)]
# an azimuth, degrees: some turns
Azimuth = Annotated[float, Field(ge=-3600, le=3600)]


class Validated(BaseModel):
    """Base class that rejects unknown keys, wrong types and assignments."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def as_pair(value: float | tuple[float, float]) -> tuple[float, float]:
    """Returns (x, y) of a pair, or of one number that applies to both axes."""
    return value if isinstance(value, tuple) else (value, value)


def is_csv(text: str) -> bool:
    """Whether a value names a CSV file."""
    return text.lower().endswith(".csv")


def existing_file(name: str, info: ValidationInfo) -> str:
    """Resolves a file name against the config's folder; without one, outside `config.read`, the name stays as it is.

    name: absolute, or relative to the config. info: its context holds the folder.
    Returns the absolute name.
    Raises ValueError where no such file exists.
    """
    if info.context is None:
        return name
    try:
        path = (info.context["folder"] / name).resolve()
        found = path.is_file()
    # before Python 3.13, a loop of symbolic links is a RuntimeError
    except (OSError, RuntimeError) as error:
        raise ValueError(f"cannot be read: {error}") from None
    if path.is_dir():
        raise ValueError(f"expected a file, got a folder: {path}")
    if not found:
        remedy = "; write / between folders" if "\\" in name and os.sep != "\\" else ""
        raise ValueError(f"no such file: {path} (paths are relative to the config{remedy})")
    return str(path)
