"""Values that are checked when they are made: the base class and the types that all descriptions share."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo

# lax only where TOML has no tuple: arrays become tuples, everything else keeps its type
Pair = Annotated[tuple[float, float], Field(strict=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
PositivePair = Annotated[tuple[Positive, Positive], Field(strict=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class Validated(BaseModel):
    """Base of described values: unknown keys, wrong types and later changes are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def as_pair(value: float | tuple[float, float]) -> tuple[float, float]:
    """One number stands for both axes; two are (x, y)."""
    return value if isinstance(value, tuple) else (value, value)


def is_csv(text: str) -> bool:
    return text.lower().endswith(".csv")


def existing_file(name: str, info: ValidationInfo) -> str:
    """The absolute name of a file that is there; names are relative to the config's folder.

    Outside `parse` no folder is known, and a name stays as it is.
    """
    if info.context is None:
        return name
    try:
        path = (info.context["folder"] / name).resolve()
        found = path.is_file()
    # a loop of links is a RuntimeError before Python 3.13
    except (OSError, RuntimeError) as error:
        raise ValueError(f"cannot be read: {error}") from None
    if not found:
        raise ValueError(f"no such file: {path} (paths are relative to the config)")
    return str(path)
