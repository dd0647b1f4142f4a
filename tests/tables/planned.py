"""Tables that are planned for the budget of a config and made, which tests of several folders share."""

from pathlib import Path

from pipeline.accuracy.exact import reference_of
from pipeline.config.models import Config
from pipeline.config.read import parse
from pipeline.diffraction.reference import Reference
from pipeline.surface import recipes, windows
from pipeline.surface.heightfield import HeightField
from pipeline.tables.polar import table as polar
from pipeline.tables.polar.planning import plan

SIGMA = 2.0


def config(**sections) -> Config:
    """A config of a small artificial snake skin; sections replace those of the same name."""
    recipe = {"kind": "elaphe", "size_um": 12, "pitch_um": 0.1, "height_um": 0.3}
    document = {"name": "a", "surface": {"recipe": recipe}, "coherence": {"sigma_um": SIGMA}, **sections}
    return parse(document, "a.toml", Path())


def field_of(found: Config) -> HeightField:
    """The height field of a config's recipe."""
    return recipes.make(found.surface.recipe)


def exact_of(found: Config) -> Reference:
    """The reference of a config."""
    return reference_of(field_of(found), found)


def planned(found: Config) -> tuple[polar.PolarTable, plan.Plan]:
    """The table of a config and its plan."""
    budget = plan.Budget(found.budget_delta_e, found.accuracy.exposure_ru)
    sigma = found.coherence.sigma_um
    field = field_of(found)
    places = windows.places(field.extent, found.coherence)
    trial = plan.start(field, places, sigma, found.light, found.scene, budget, found.table)
    chosen = plan.choose(trial, found.scene, budget, found.table)
    power = trial.mean_power_spectrum(chosen.azimuths)
    bake = chosen.bake(found.radiometry, budget, found.table)
    return bake.table(power, chosen.rings, bake.rules(chosen.rings.rho())), chosen
