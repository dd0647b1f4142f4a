"""What a bundle's README says about a polar table."""

from pipeline.bundle.manifest import PolarGrid

_SHADER = """\
The table is polar in (u, v): {height} rings and {width} azimuths. Each texel holds coefficients of cubic
B-splines, four outputs in R, G, B, A; between texels the 4 x 4 nearest are mixed by the weights of `spline`.
Load the images as *data*: no gamma, no flip. Ring 0, the mirror direction, is the first line of the image, at
texture coordinate 0.5 / {height}.

    const int RINGS = {height}, AZIMUTHS = {width}, TEXTURES = {textures}, TERMS = {terms};
    const float R0 = {r0!r}, STEP = {step!r}, STRETCH = {stretch!r}, AXIS = {axis!r};
    vec4 spline(float t) {{
        float s = 1.0 - t;
        return vec4(s * s * s, 4.0 - 3.0 * t * t * (2.0 - t), 4.0 - 3.0 * s * s * (2.0 - s), t * t * t) / 6.0;
    }}
    ivec2 texel(int ring, int azimuth) {{                // the first ring is one point, azimuths are periodic
        if (ring < 0) {{ ring = -ring; azimuth += AZIMUTHS / 2; }}
        if (ring > RINGS - 1) ring = 2 * (RINGS - 1) - ring;
        return ivec2((azimuth + AZIMUTHS) % AZIMUTHS, ring);
    }}

    vec3 uvw = -wi - wr;
    float rho = length(uvw.xy);
    vec2 turned = mat2(cos(AXIS), -sin(AXIS), sin(AXIS), cos(AXIS)) * uvw.xy;
    float ring = min(asinh(rho / R0) / STEP, float(RINGS - 1));
    float turn = rho > 0.0 ? atan(turned.y, STRETCH * turned.x) / 6.28318531 : 0.0;
    float azimuth = fract(turn) * float(AZIMUTHS);
    vec4 across = spline(fract(ring)), along = spline(fract(azimuth)), found[TEXTURES];
    for (int q = 0; q < TEXTURES; ++q) {{
        found[q] = vec4(0.0);
        for (int a = 0; a < 4; ++a)
            for (int b = 0; b < 4; ++b) {{
                ivec2 at = texel(int(ring) - 1 + a, int(azimuth) - 1 + b);
                found[q] += across[a] * along[b] * texelFetch(tables, ivec3(at, q), 0);
            }}
    }}
    float w_max = sqrt(max(4.0 - rho * rho, 1e-6));
    float x = clamp(2.0 * abs(uvw.z) / w_max - 1.0, -1.0, 1.0), T[TERMS];
    T[0] = 1.0; T[1] = x;                                // Chebyshev polynomials in |w|
    for (int k = 2; k < TERMS; ++k) T[k] = 2.0 * x * T[k - 1] - T[k - 2];
    vec3 value = vec3(0.0);
    for (int o = 0; o < 4 * TEXTURES; ++o) {{             // scale[] and basis[] from manifest.json
{mixing}
    }}
{envelope}    vec3 xyz = C(wi, wr) * wi.z * value;                 // under 1 RU

The weights are positive, so away from ring 0 four bilinear fetches between texels make the sixteen of one texture.
"""
_BASIS = """\
        vec3 shape = vec3(0.0);
        for (int k = 0; k < TERMS; ++k)
            shape += T[k] * vec3(basis[o][0][k], basis[o][1][k], basis[o][2][k]);
        value += scale[o] * found[o / 4][o % 4] * shape;"""
_TERMS = "        value[o / TERMS] += scale[o] * found[o / 4][o % 4] * T[o % TERMS];"
_ENVELOPE = "    value *= pow(1.0 + rho * rho / {square!r}, {exponent!r});\n"


def files(grid: PolarGrid, textures: int, precision: str) -> str:
    """The line of the table of files."""
    held = "all terms" if grid.basis is None else f"low rank over X, Y, Z and {grid.w_terms} terms in w"
    last = f" ... `T_{textures - 1:02d}.exr`" if textures > 1 else ""
    return f"| `tables/T_00.exr`{last} | {grid.width} x {grid.height} texels, RGBA {precision}: {held} |"


def shader(grid: PolarGrid, textures: int) -> str:
    """How a shader reads the tables."""
    flat = grid.envelope_exponent == 0.0
    return _SHADER.format(
        height=grid.height,
        width=grid.width,
        textures=textures,
        terms=grid.w_terms,
        r0=grid.r0,
        step=grid.step,
        stretch=grid.stretch,
        axis=grid.axis_rad,
        mixing=_TERMS if grid.basis is None else _BASIS,
        envelope="" if flat else _ENVELOPE.format(square=grid.envelope_radius**2, exponent=-grid.envelope_exponent),
    )
