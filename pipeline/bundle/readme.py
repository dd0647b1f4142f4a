"""README.md of a bundle: what a person who writes a shader needs, with this bundle's numbers."""

from pipeline.bundle.manifest import CertificateEntry, Domain, Manifest, PolarLoss, StorageLoss
from pipeline.bundle.material import MaterialEntry

_TEXT = """\
# {name} {version}

Diffraction of light by a nanostructured surface, baked by diffract-bake {tool} ({layout} layout).
Licence of the scan: {licence}.

| file | what it holds |
|---|---|
| `manifest.json` | every convention, number, error and setting; read this first |
{files}
| `evaluate.py` | the look-up in one page of Python (numpy, OpenEXR): what a shader must reproduce |
{optional}| `maps/` | BRDF maps: EXR (`brdf.X`, `brdf.Y`, `brdf.Z` at 1 RU) and PNG previews |
| `SHA256SUMS` | digests of all files; its own digest begins with the 12 digits that end the folder's name |

{errors}{domain}

## In a shader

Directions `wi` (light) and `wr` (view) are unit vectors away from the surface in its tangent frame: z the
normal, x and y the scan's axes, y up. {space}.

{shader}
{formula}
{reflectance}
{shadowing}

divisor = {divisor!r}, exponent = {exponent}{f0}.

## To check it

    sha256sum -c SHA256SUMS
    python evaluate.py directions.csv        # rows theta_i,phi_i,theta_r,phi_r in degrees -> X,Y,Z

`nan` stands where the table was not computed. Or `diffract-bake verify` on this folder.
"""
_CERTIFICATE = (
    "The table was planned for a mean CIELAB error of {planned:g} at {exposure:g} RU. On {directions} random\n"
    "directions that its planning never saw it keeps {mean:.3g} (99th percentile {tail:.3g}, maximum {worst:.3g})\n"
    "against the exact sum."
)
_STORED = (
    "These files hold it in {textures} of {most} textures, in {precision}. Against the exact sum, on {directions}\n"
    "other directions: mean {mean:.3g}, 99th percentile {tail:.3g}, maximum {worst:.3g}. Against the table before:\n"
    "mean {added:.3g}, and {mirror}."
)


def text(manifest: Manifest, files: str, shader: str) -> str:
    """README.md; `files` and `shader` are what the table's layout has to say."""
    material = manifest.material
    return _TEXT.format(
        name=manifest.name,
        version=manifest.version,
        tool=manifest.made_by.diffract_bake,
        layout=manifest.grid.layout,
        licence=manifest.licence,
        files=files,
        optional=_optional(manifest.report, material),
        errors=_errors(manifest),
        domain=_domain(manifest.domain),
        space=f"Colours are {manifest.colour.space}",
        shader=shader,
        formula=material.formula,
        reflectance=material.reflectance,
        shadowing=material.shadowing_formula,
        divisor=material.divisor,
        exponent=material.exponent,
        f0="" if material.schlick_f0 is None else f", F0 = {material.schlick_f0!r}",
    )


def _domain(domain: Domain) -> str:
    """Where the scalar model holds, and where this surface lies."""
    text = (
        "The model is scalar: it was held against rigorous coupled waves, and errs by more than "
        f"{100 * domain.tolerated:.0f} % of the\nreflected light where periods are fine or edges deep (`domain` in "
        "the manifest). "
    )
    if domain.period_over_lambda is None:
        return text + "This surface has no period to compare by."
    told = [
        f"as one with {kind} {'beyond what was compared' if error is None else f'to {100 * error:.0f} %'}"
        for kind, error in (("smooth slopes", domain.error_of_smooth), ("edges", domain.error_of_edged))
    ]
    return text + (
        f"This surface's finest period is\n{domain.period_over_lambda:.1f} wavelengths of {domain.lambda_nm:g} nm: "
        + ", ".join(told)
        + "."
    )


def _optional(report: str | None, material: MaterialEntry) -> str:
    """Lines of files that not every bundle has."""
    lines = "| `report.html` | measured errors, with pictures |\n" if report else ""
    if material.reflectance_table is not None:
        table = material.reflectance_table
        lines += (
            f"| `{table.file}` | R on {table.nodes} nodes of cos_half, for linear interpolation (error "
            f"{table.largest_error:.1g}) |\n"
        )
    return lines


def _errors(manifest: Manifest) -> str:
    """The section on errors, where there is something to be said."""
    found = []
    if manifest.certificate is not None:
        found.append(_certified(manifest.certificate))
    if manifest.storage_loss is not None:
        found.append(_stored(manifest.storage_loss, manifest.precision))
    return "## How exact it is\n\n" + "\n\n".join(found) + "\n\n" if found else ""


def _certified(certificate: CertificateEntry) -> str:
    exposure = certificate.exposure_ru
    colour = next(error for error in certificate.random.colour if error.exposure_ru == exposure)
    return _CERTIFICATE.format(
        planned=certificate.delta_e,
        exposure=exposure,
        directions=certificate.random.directions,
        mean=colour.mean,
        tail=colour.percentile_99,
        worst=colour.maximum,
    )


def _stored(loss: StorageLoss, precision: str) -> str:
    if not isinstance(loss, PolarLoss):
        return (
            f"Half floats change colours by up to dE {loss.largest_delta_e:.3g} at {loss.exposure_ru:g} RU, on\n"
            f"{loss.directions} random directions and the mirror directions of their lights."
        )
    mirror = loss.added_in_mirror
    return _STORED.format(
        textures=loss.textures,
        most=loss.most_textures,
        precision=precision,
        mean=loss.error.mean,
        tail=loss.error.percentile_99,
        worst=loss.error.maximum,
        directions=loss.directions,
        added=loss.added.mean,
        mirror=f"{mirror.mean:.3g} in the lights' mirror directions at {mirror.exposure_ru:g} RU",
    )
