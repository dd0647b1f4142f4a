"""README.md of a bundle: what a person who writes a shader needs, with this bundle's numbers."""

from pipeline.bundle.manifest import Manifest

_TEXT = """\
# {name} {version}

Diffraction of light by a nanostructured surface, baked by diffract-bake {tool} ({layout} layout, [D14]).
Licence of the scan: {licence}.

| file | what it holds |
|---|---|
| `manifest.json` | every convention, number, error and setting; read this first |
| `tables/I_00.exr` ... `{last}` | I_p(u, v), p = 0 ... {top}: {width} x {height} texels, RGBA {precision} |
| `evaluate.py` | the look-up in one page of Python (numpy, OpenEXR): what a shader must reproduce |
{optional}| `maps/` | BRDF maps: EXR (`brdf.X`, `brdf.Y`, `brdf.Z` at 1 RU) and PNG previews |
| `SHA256SUMS` | digests of all files; its own digest begins with the 12 digits that end the folder's name |

## In a shader

Directions `wi` (light) and `wr` (view) are unit vectors away from the surface in its tangent frame: z the
normal, x and y the scan's axes, y up. {space}.

R, G, B are X, Y, Z of `I_p / scale_p`; A is 1 where the texel was computed, else 0: treat A < 1 as "unknown".
RGBA because GPUs lack three-channel half floats. Load the images as *data*: no gamma, no flip. The first line
of the image is v = -2 and lies at texture coordinate 0.

    const float N = {width}.0, A = {power};              // texels along u and v; the grid's exponent
    float coordinate(float u) {{                     // from [-2, 2] to texture coordinates, texel centres
        float t = sign(u) * pow(0.5 * abs(u), 1.0 / A);
        return (0.5 * (t + 1.0) * (N - 1.0) + 0.5) / N;
    }}
    vec3 uvw = -wi - wr;
    vec2 at = vec2(coordinate(uvw.x), coordinate(uvw.y));
    vec3 sum = vec3(0.0);
    for (int p = {top}; p >= 0; --p)                  // Horner; scale[] from manifest.json
        sum = sum * uvw.z + scale[p] * texture(I, vec3(at, p)).rgb;
    vec3 xyz = C(wi, wr) * wi.z * sum;               // under 1 RU

Filter bilinearly, without mipmaps, clamped to the edge. Texture units round filter weights to about 1/256:
where that shows, fetch four texels and mix them yourself. The sum cancels: keep it in float32, never in half.

{formula}
{reflectance}
{shadowing}

divisor = {divisor!r}, exponent = {exponent}{f0}.

## To check it

    sha256sum -c SHA256SUMS
    python evaluate.py directions.csv        # rows theta_i,phi_i,theta_r,phi_r in degrees -> X,Y,Z

`nan` stands where the table was not computed. Or `diffract-bake verify` on this folder.

[D14] Dhillon et al. 2014, Interactive Diffraction from Biological Nanostructures.
"""


def text(manifest: Manifest) -> str:
    """README.md."""
    material = manifest.material
    optional = "| `report.html` | measured errors, with pictures |\n" if manifest.report else ""
    if material.reflectance_table is not None:
        table = material.reflectance_table
        optional += (
            f"| `{table.file}` | R on {table.nodes} nodes of cos_half, for linear interpolation (error "
            f"{table.largest_error:.1g}) |\n"
        )
    return _TEXT.format(
        name=manifest.name,
        version=manifest.version,
        tool=manifest.made_by.diffract_bake,
        layout=manifest.grid.layout,
        licence=manifest.licence,
        last=manifest.tables[-1].file,
        top=manifest.tables[-1].p,
        width=manifest.grid.width,
        height=manifest.grid.height,
        precision=manifest.precision,
        optional=optional,
        space=f"Colours are {manifest.colour.space}",
        power=manifest.grid.power,
        formula=material.formula,
        reflectance=material.reflectance,
        shadowing=material.shadowing_formula,
        divisor=material.divisor,
        exponent=material.exponent,
        f0="" if material.schlick_f0 is None else f", F0 = {material.schlick_f0!r}",
    )
