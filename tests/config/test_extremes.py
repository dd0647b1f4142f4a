"""Extreme numbers under every key: a config is accepted or refused with the key, and nothing overflows."""

import random
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import TypeAdapter

from pipeline.config import read
from pipeline.config.models import Accuracy, Render
from pipeline.errors import ConfigError
from pipeline.optics.coherence import Coherence
from pipeline.optics.material import Material
from pipeline.stages import config_check, forecast
from pipeline.surface.recipes.parameters import Recipe
from pipeline.tables.polar.layout import PolarLayout
from pipeline.tables.taylor.layout import TaylorLayout
from pipeline.validated import Validated
from tests.support import shared_file

TINY = (0.0, -1.0, 1e-308, 5e-324, 1e-30, 1e-9)
NUMBERS = (*TINY, 1e-3, 0.1, 1.0, 2.5, 45.0, 90.0, 550.0, 4096.0, 1e5, 1e9, 1e30, 1e308)
COUNTS = (0, -1, 1, 2, 3, 4, 16, 31, 32, 101, 128, 1000, 4001, 4096, 32768, 10**9, 10**30)
INFINITE = (float("inf"), float("-inf"), float("nan"))
RECIPES = {get_args(kind.model_fields["kind"].annotation)[0]: kind for kind in get_args(get_args(Recipe)[0])}
SECTIONS = {"coherence": Coherence, "material": Material, "accuracy": Accuracy, "render": Render}
LAYOUTS = (("polar", PolarLayout), ("taylor", TaylorLayout))


def numeric_keys(kind: type[Validated]) -> list[str]:
    """Returns the keys of a section that take a number."""
    schema = TypeAdapter(kind).json_schema()["properties"]
    return [key for key, entry in schema.items() if "number" in str(entry) or "integer" in str(entry)]


def number(rng: random.Random) -> Any:
    """Draws a number, rarely one that is none, now and then a pair."""
    pool: tuple[Any, ...] = NUMBERS if rng.random() < 0.6 else COUNTS if rng.random() < 0.8 else INFINITE
    drawn = rng.choice(pool)
    return [drawn, rng.choice(pool)] if rng.random() < 0.1 else drawn


def filled(rng: random.Random, kind: type[Validated], share: float) -> dict[str, Any]:
    """Draws a share of a section's numeric keys."""
    return {key: number(rng) for key in numeric_keys(kind) if key != "lights" and rng.random() < share}


def document(rng: random.Random) -> dict[str, Any]:
    """Draws a config with extreme numbers under some of its keys."""
    share = rng.choice((0.05, 0.15, 0.4))
    recipe, (layout, settings) = rng.choice(list(RECIPES)), rng.choice(LAYOUTS)
    found: dict[str, Any] = {
        "name": "x",
        "surface": {"recipe": {"kind": recipe, **filled(rng, RECIPES[recipe], 1.5 * share)}},
        "table": {"layout": layout, **filled(rng, settings, share)},
        **{name: filled(rng, kind, share) for name, kind in SECTIONS.items()},
    }
    if rng.random() < share:
        found["spectrum"] = {"illuminant": {"lambda_nm": number(rng)}}
    elif rng.random() < share:
        found["spectrum"] = {"range_nm": [number(rng), number(rng)]}
    if rng.random() < 2 * share:
        light = {"theta_deg": number(rng), "phi_deg": number(rng)} if rng.random() < share else {"theta_deg": 0.0}
        found["scene"] = {"lights": [light], "views": {"theta_max_deg": number(rng)}}
    return found


def outcome(found: dict[str, Any]) -> str:
    """Reads and checks a config as commands do; returns "accepted" or "refused"."""
    try:
        config = read.parse(found, "x", Path())
        config_check.check(config, "x")
    except ConfigError as error:
        return "refused" if all(key and text and "\n" not in text for key, text in error.faults) else str(error)
    # a number of bytes and of seconds that a person can read, and no infinity
    needs = forecast.needs(config, {}).values()
    return "accepted" if all(0 < need.bytes < 2**60 and 0 <= need.seconds <= 3600 for need in needs) else str(needs)


def sweep(seed: int, count: int) -> dict[str, int]:
    rng = random.Random(seed)
    found = [outcome(document(rng)) for _ in range(count)]
    return {name: found.count(name) for name in set(found)}


def test_extreme_numbers_are_accepted_or_refused_with_their_key() -> None:
    assert set(sweep(20261128, 400)) == {"accepted", "refused"}


@pytest.mark.parametrize(
    ("name", "key", "expected"),
    [
        ("exposure1e-308", "accuracy.exposure_ru", "greater than or equal to"),
        ("height100um", "surface.recipe.amplitude_um", "less than or equal to 50"),
        ("height1e300", "surface.recipe.amplitude_um", "less than or equal to 50"),
        ("scene_view_tiny", "scene.views.theta_max_deg", "greater than or equal to 0.1"),
        ("size_inf_period", "surface.recipe.period_um", "greater than or equal to"),
    ],
)
def test_absurd_numbers_of_attacks(name: str, key: str, expected: str) -> None:
    with pytest.raises(ConfigError) as refused:
        read.load(shared_file(f"attack/{name}.toml"))
    assert [fault for fault, _ in refused.value.faults] == [key]
    assert expected in refused.value.faults[0][1]


def test_work_without_an_end_is_a_fault_of_its_key() -> None:
    found = {
        "name": "x",
        "surface": {"recipe": {"kind": "gaussian", "sigma_h_um": 10.0, "size_um": 20}},
        "coherence": {"sigma_um": 5.0},
    }
    with pytest.raises(ConfigError, match=r"recipe\.sigma_h_um: expected work of at most 1 h, .* would end$"):
        config_check.check(read.parse(found, "x", Path()), "x")


def test_a_tilt_beyond_all_scans_is_a_fault_of_its_key() -> None:
    found = {"name": "x", "surface": {"recipe": {"kind": "tilted_mirror", "tilt_y_deg": 79.0}}}
    with pytest.raises(ConfigError, match=r"tilt_y_deg: expected a rise of at most 100 um"):
        config_check.check(read.parse(found, "x", Path()), "x")
