"""Reads config files. All faults of a file are reported at once, each with the path of its key."""

import re
import tomllib
from pathlib import Path
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from pipeline import layouts
from pipeline.config.models import Config
from pipeline.errors import ConfigError
from pipeline.scene import lights
from pipeline.scene.faults import faults as faults_of_scene
from pipeline.scene.visited import rho_max
from pipeline.surface.recipes.parameters import Recipe

_KINDS = tuple(str(get_args(kind.model_fields["kind"].annotation)[0]) for kind in get_args(get_args(Recipe)[0]))

# a place in a message of tomllib
_LINE = re.compile(r"at line (\d+)")


def load(path: Path) -> Config:
    """Reads a config from a TOML file, and resolves relative file names against its folder.

    Raises ConfigError with all faults.
    """
    source = str(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ConfigError(source, [("", "no such config file")]) from None
    except (OSError, UnicodeDecodeError) as error:
        hint = "a config is a TOML text; for a scan see `diffract-bake inspect`"
        raise ConfigError(source, [("", f"cannot be read as UTF-8 text ({error}); {hint}")]) from None
    try:
        document = tomllib.loads(text)
    # TOMLDecodeError, and Python's own limits on digits and on depth
    except (ValueError, RecursionError) as error:
        raise ConfigError(source, [("", f"not valid TOML: {error}{_hint(text, error)}")]) from None
    return parse(document, source, path.resolve().parent)


def _hint(text: str, error: Exception) -> str:
    """Suggests how to write a path with backslashes, which begin an escape between double quotes."""
    place = _LINE.search(str(error))
    lines = text.splitlines()
    if place is None or "\\" not in "".join(lines[int(place[1]) - 1 : int(place[1])]):
        return ""
    return "; in a path, write / instead of \\, or set the path between single quotes"


def parse(document: dict[str, Any], source: str, folder: Path) -> Config:
    """Makes a config from a parsed TOML document.

    document: sections by name. source: name of the document, for messages. folder: start of relative file names.
    Raises ConfigError with all faults.
    """
    try:
        config = Config.model_validate(document, context={"folder": folder})
    except ValidationError as error:
        raise ConfigError(source, _merged([_fault(e) for e in error.errors()])) from None
    faults = _scene_faults(config) + _repeated_lights(config) + _texture_faults(config)
    if faults:
        raise ConfigError(source, faults)
    return config


def _scene_faults(config: Config) -> list[tuple[str, str]]:
    """Finds faults of [scene], and lights of [render] that are not in it: the table does not cover them."""
    if config.scene is None:
        return []
    found = [(f"scene.{key}", text) for key, text in faults_of_scene(config.scene)]
    if found:
        return found
    if config.scene.cameras is not None:
        reach = rho_max(config.scene)
        widest = np.degrees(np.arcsin(min(1.0, reach)))
        text = f"expected theta below {widest:.3g}, because the cameras of [scene] see nothing beyond it, got "
        return [
            (f"render.lights.{i}", f"{text}{light.theta_deg:g}")
            for i, light in enumerate(config.render.lights)
            if np.sin(np.radians(light.theta_deg)) >= reach
        ]
    return [
        (
            f"render.lights.{i}",
            f"expected a light of [scene], got theta {light.theta_deg:g}, phi {light.phi_deg:g} deg; add it there",
        )
        for i, light in enumerate(config.render.lights)
        if not any(other.holds(light.vector) for other in config.scene.lights)
    ]


def _repeated_lights(config: Config) -> list[tuple[str, str]]:
    """Finds lights of [render] that are equal, within a millionth of a degree, and would write the same map."""
    lights = config.render.lights
    return [
        (f"render.lights.{i}", f"the same light as render.lights.{j}")
        for i in range(len(lights))
        for j in range(i)
        if lights[i].same_as(lights[j])
    ]


def _texture_faults(config: Config) -> list[tuple[str, str]]:
    """Finds a number of textures for a table that a bundle cannot hold in fewer."""
    if not config.table.compresses and config.publish.textures not in ("auto", "full"):
        those = " and ".join(name for name, layout in layouts.LAYOUTS.items() if layout.settings.compresses)
        return [
            ("publish.textures", f"{config.publish.textures} applies to {those} tables only; leave it out for others")
        ]
    return []


def _merged(faults: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Joins the faults of each key: for a value that fits no member of a union, pydantic reports one per member."""
    by_key: dict[str, list[str]] = {}
    for key, text in faults:
        by_key.setdefault(key, []).append(text)
    return [(key, "; or ".join(dict.fromkeys(texts))) for key, texts in by_key.items()]


def _fault(error: Any) -> tuple[str, str]:
    """Converts a pydantic error to (path of the key, message)."""
    # pydantic inserts tags of unions ("blazed", "float") into the path; an unknown key is always the user's
    unknown = error["type"] == "extra_forbidden"
    path, last = (error["loc"][:-1], error["loc"][-1:]) if unknown else (error["loc"], ())
    parts = [p for p in path if not (isinstance(p, str) and _is_union_tag(p, path))]
    key = ".".join(str(p) for p in (*parts, *last))
    if unknown:
        return key, "unknown key (see the config reference in docs/usage.md)"
    if error["type"] == "missing":
        return key, "required, but missing"
    if error["type"] == "model_type":
        return key, f"expected a section (a table of keys), got {_shortened(error['input'])}"
    if error["type"].startswith("union_tag"):
        called = str(error["ctx"]["discriminator"]).strip("'")
        kinds = _KINDS if called == "kind" else layouts.LAYOUTS
        return key, f"expected a {called}, one of {', '.join(kinds)}, got {_shortened(error['input'])}"
    message = str(error["msg"]).removeprefix("Value error, ")
    if error["type"] == "value_error":
        return key, message
    return key, f"{message[0].lower()}{message[1:]}, got {_shortened(error['input'])}"


def _shortened(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _is_union_tag(part: str, loc: tuple[int | str, ...]) -> bool:
    types = {"float", "str", "int", "LaserLine", *_KINDS, *lights.KINDS, *layouts.LAYOUTS}
    shapes = ("tuple[", "literal[", "constrained-", "function-")
    return loc.index(part) > 0 and (part in types or part.startswith(shapes))
