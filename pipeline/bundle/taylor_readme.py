"""What a bundle's README says about the paper's tables."""

from pipeline.bundle.manifest import TaylorGrid

_SHADER = """\
The tables are those of Dhillon et al. 2014, *Interactive Diffraction from Biological Nanostructures*.
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
"""


def files(grid: TaylorGrid, planes: int, precision: str) -> str:
    """The line of the table of files."""
    size = f"{grid.width} x {grid.height} texels, RGBA {precision}"
    return f"| `tables/I_00.exr` ... `I_{planes - 1:02d}.exr` | I_p(u, v), p = 0 ... {planes - 1}: {size} |"


def shader(grid: TaylorGrid, planes: int) -> str:
    """How a shader reads the tables."""
    return _SHADER.format(width=grid.width, power=grid.power, top=planes - 1)
