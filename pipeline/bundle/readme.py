"""README.md of a bundle: a page for writers of shaders, with the numbers of the bundle.

templates/ has the text, and the folder of each layout its part of it; kernels/shaders/ has the look-up in GLSL.
"""

import re
import textwrap
from collections.abc import Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable

from pipeline import layouts
from pipeline.bundle.layout import Constant, Prepared
from pipeline.bundle.manifest import Manifest
from pipeline.bundle.material import MaterialEntry
from pipeline.report import template

# the factor C, which follows the look-up of any layout
BRDF = files("kernels").joinpath("shaders", "brdf.glsl")
_CONSTANT = re.compile(r"^(const (?:bool|int|float) (\w+)(?:\[[^]]*\])? = )[^;]*;", re.MULTILINE)
_LINE = 110


def text(manifest: Manifest, table: Prepared) -> str:
    """Writes README.md of a bundle.

    manifest: of the bundle. table: the layout's part.
    Returns Markdown.
    """
    layout, certificate = manifest.grid.layout, manifest.certificate
    look_up = shader(layouts.bundled(layout).shader, table.constants)
    return template.markdown(
        (layouts.LAYOUTS[layout].bundle, "pipeline.bundle"),
        "layout.md.in",
        manifest=manifest,
        grid=manifest.grid,
        rho_max=table.rho_max,
        tables=len(manifest.tables),
        material=manifest.material,
        reflectance=manifest.material.reflectance_table,
        certificate=certificate,
        certified=next(error for error in certificate.random.colour if error.exposure_ru == certificate.exposure_ru),
        loss=manifest.storage_loss,
        domain=manifest.domain,
        shader="\n".join((look_up, shader(BRDF, _brdf(manifest.material)))).rstrip(),
    )


def _brdf(material: MaterialEntry) -> dict[str, Constant]:
    """Returns the constants of brdf.glsl."""
    return {"DIVISOR": material.divisor, "EXPONENT": material.exponent, "SHADOWING": material.shadowing}


def shader(file: Traversable, constants: Mapping[str, Constant]) -> str:
    """Reads a file in GLSL with the constants of a table in place of the file's.

    constants: a value for every global constant of the file, by name.
    Returns GLSL.
    Raises ValueError where the names are not those of the file.
    """
    source = file.read_text(encoding="utf-8")
    declared = {name for _, name in _CONSTANT.findall(source)}
    if declared != constants.keys():
        raise ValueError(f"{file.name} declares {sorted(declared)}, but got values for {sorted(constants)}")
    return _CONSTANT.sub(lambda found: f"{found[1]}{_literal(constants[found[2]])};", source)


def _literal(value: Constant) -> str:
    if isinstance(value, list):
        numbers = textwrap.fill(", ".join(map(str, value)), _LINE, initial_indent="    ", subsequent_indent="    ")
        return f"int[](\n{numbers})"
    return str(value).lower() if isinstance(value, bool) else repr(value)
