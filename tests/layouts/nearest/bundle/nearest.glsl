const float N = 21.0;  // texels along u and v

uniform sampler2D table;  // nearest filtering

vec3 table_value(vec3 uvw) {
    return texture(table, ((uvw.xy + 2.0) / 4.0 * (N - 1.0) + 0.5) / N).rgb;
}
