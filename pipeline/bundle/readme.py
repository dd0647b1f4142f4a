"""README.md of a bundle: a page for writers of shaders, with the numbers of the bundle.

templates/ has the text, one page for each layout; kernels/shaders/ has the look-up in GLSL.
"""

import re
from collections.abc import Mapping
from importlib.resources import files

from pipeline.bundle.manifest import Manifest
from pipeline.bundle.material import MaterialEntry
from pipeline.report import template

Constant = bool | int | float
_CONSTANT = re.compile(r"^(const \w+ (\w+) = )[^;]*;", re.MULTILINE)


def text(manifest: Manifest, constants: Mapping[str, Constant]) -> str:
    """Writes README.md of a bundle.

    manifest: of the bundle. constants: values of the constants of the layout's shader, by name.
    Returns Markdown.
    """
    layout, certificate = manifest.grid.layout, manifest.certificate
    return template.markdown(
        "pipeline.bundle",
        f"{layout}.md.in",
        manifest=manifest,
        grid=manifest.grid,
        rho_max=getattr(manifest.grid, "rho_max", 2.0),
        tables=len(manifest.tables),
        material=manifest.material,
        reflectance=manifest.material.reflectance_table,
        certificate=certificate,
        certified=next(error for error in certificate.random.colour if error.exposure_ru == certificate.exposure_ru),
        loss=manifest.storage_loss,
        domain=manifest.domain,
        shader="\n".join((shader(layout, constants), shader("brdf", _brdf(manifest.material)))).rstrip(),
    )


def _brdf(material: MaterialEntry) -> dict[str, Constant]:
    """Returns the constants of brdf.glsl."""
    return {"DIVISOR": material.divisor, "EXPONENT": material.exponent, "SHADOWING": material.shadowing}


def shader(name: str, constants: Mapping[str, Constant]) -> str:
    """Reads a file of kernels/shaders/ with the constants of a table in place of the file's.

    name: of the file without its suffix. constants: a value for every global constant of the file, by name.
    Returns GLSL.
    Raises ValueError where the names are not those of the file.
    """
    source = files("kernels").joinpath("shaders", f"{name}.glsl").read_text(encoding="utf-8")
    declared = {name for _, name in _CONSTANT.findall(source)}
    if declared != constants.keys():
        raise ValueError(f"{name}.glsl declares {sorted(declared)}, but got values for {sorted(constants)}")
    return _CONSTANT.sub(lambda found: f"{found[1]}{_literal(constants[found[2]])};", source)


def _literal(value: Constant) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)
