"""The curves of a validation, which configs of one power spectrum share."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from pipeline import layouts
from pipeline.config import read
from pipeline.stages import validate


def _curves_name(table: str, **sections: Any) -> str:
    document = {"name": table, "surface": {"recipe": {"kind": "elaphe", "height_um": 0.3}}, **sections}
    config = read.parse(document, table, Path.cwd())
    inputs: Any = {"power_spectrum": SimpleNamespace(key="shared"), "table": SimpleNamespace(key=table)}
    return validate._name_of_curves(layouts.of(config.table), config, inputs)


def test_a_config_of_the_planners_light_and_material_shares_the_curves_of_others() -> None:
    planners = {"spectrum": {"illuminant": "E"}, "material": {"normalisation": "relative"}}
    assert _curves_name("one", **planners) == _curves_name("other", material={"fresnel": "none"})
    assert _curves_name("one", **planners) != _curves_name("finer", accuracy={"delta_e": 0.2})
