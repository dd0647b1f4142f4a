"""Configs of recipes, their heights, and a patch of Elaphe four sigma wide."""

from typing import Any

from pipeline.config.models import Config
from pipeline.surface import recipes
from pipeline.surface.heightfield import HeightField

SIGMA = 6.5


def config(recipe: dict[str, object], sigma: float = SIGMA, **sections: Any) -> Config:
    material = {"normalisation": "relative", **sections.pop("material", {})}
    return Config.model_validate(
        {
            "name": "t",
            "surface": {"recipe": recipe},
            "coherence": {"sigma_um": sigma},
            "material": material,
            **sections,
        }
    )


def made(of: Config) -> HeightField:
    assert of.surface.recipe is not None
    return recipes.make(of.surface.recipe)


ELAPHE = config({"kind": "elaphe", "size_um": 4 * SIGMA, "pitch_um": 0.1})
