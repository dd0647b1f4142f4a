"""Templates: what is escaped, and that no gap stays empty."""

from typing import Any

import pytest
from jinja2 import UndefinedError

from pipeline.accuracy.checks import Clamped
from pipeline.optics.colour import ColourError
from pipeline.report import template

VALUES: dict[str, Any] = {
    "title": "<b> & \"c\" 'd'",
    "subtitle": "1 < 2",
    "warnings": ["<script>alert(1)</script>"],
    "exposure_ru": 7500.0,
    "maps": [(b"\x89PNG", {"theta_deg": 30.0, "phi_deg": 0.0, "clipped_share": 0.25, "negative_share": 0.0})],
    "colours": [],
    "clamped": Clamped(0.1, ColourError(7500.0, 0.01, 0.1, 1.0)),
    "surface": [["<i>", "2 µm"]],
    "settings": [],
    "error_columns": ["where"],
    "errors": [],
    "relative_errors": [],
    "pictures": {"surface": b"", "convergence": b""},
    "certifies": "",
    "studied": "",
}


def test_pages_escape_what_they_show() -> None:
    page = template.html("pipeline.report", "validation.html.in", **VALUES)
    for text in ("<b>", "<i>", "<script>", "1 < 2"):
        assert text not in page
    for text in (
        "<title>&lt;b&gt; &amp; &#34;c&#34; &#39;d&#39;</title>",
        "<p>1 &lt; 2</p>",
        "<td>&lt;i&gt;</td><td>2 µm</td>",
        "&lt;script&gt;",
        "base64,iVBORw==",
        "<figcaption>Light at θ = 30°, φ = 0°. Clipped to sRGB: 25 % of the views; negative, set to 0: 0 %.",
    ):
        assert text in page


@pytest.mark.parametrize("missing", VALUES)
def test_no_gap_stays_empty(missing: str) -> None:
    given = {name: value for name, value in VALUES.items() if name != missing}
    with pytest.raises(UndefinedError, match=f"'{missing}' is undefined"):
        template.html("pipeline.report", "validation.html.in", **given)


def test_markdown_takes_values_as_they_are() -> None:
    text = template.markdown(("pipeline.report",), "page.html.in", title="A < B & 'C'", subtitle="")
    assert "<h1>A < B & 'C'</h1>" in text
