"""The validation bench as HTML: a page a figure, and an index of every verdict."""

from collections.abc import Sequence

from pipeline.evaluation.figures.figure import Figure
from pipeline.evaluation.figures.pages import Made
from pipeline.report.page import Page

_SOURCES = (
    "[D14] Dhillon et al., Interactive Diffraction from Biological Nanostructures, 2014. [S14] Single, An "
    "Interactive Shader for Natural Diffraction Gratings, 2014. [S99] Stam, Diffraction Shaders, 1999. [G04] Stam, "
    "Simulating Diffraction, GPU Gems ch. 8, 2004."
)
_TERMS = (
    "1 RU saturates a mirror seen in its own reflection. ΔE is CIELAB ΔE*ab of 1976 between displayed colours. a is "
    "the exponent of the paper's grid, N the order of its Taylor series; FLSS, NMM and PQ are [S14]'s shaders. "
    "Statements are judged where source or theory says what must come out, else told."
)
_CHECKS = ("what", "expected", "measured", "verdict")


def page(figure: Figure) -> str:
    """The text of one page."""
    made = Page(figure.title, figure.source)
    made.links([("all pages", "index.html")])
    made.section("Expected", figure.expected)
    made.section("Measured, and the verdict")
    made.table(_CHECKS, [(c.what, c.expected, c.measured, c.verdict) for c in figure.checks])
    for remark in figure.remarks:
        made.text(remark)
    for table in figure.tables:
        made.section(table.caption)
        made.table(table.columns, table.rows)
    for picture in figure.pictures:
        made.picture(picture.png, picture.caption)
    return made.render()


def index(made: Sequence[Made]) -> str:
    """The text of the first page: what holds, what misses, and where to read on."""
    checks = [check for one in made for check in one.figure.checks]
    judged = [check for check in checks if check.holds is not None]
    holding = sum(check.holds is True for check in judged)
    found = Page(
        "Validation bench",
        f"{holding} of {len(judged)} judged statements hold, {len(checks) - len(judged)} more are told and not judged"
        f". {sum(one.seconds for one in made):.0f} s in all.",
    )
    found.text(_SOURCES)
    found.text(_TERMS)
    for one in made:
        figure = one.figure
        found.section(figure.title, figure.source)
        found.links([(f"page, {one.seconds:.0f} s", f"{figure.name}.html")])
        found.table(_CHECKS, [(c.what, c.expected, c.measured, c.verdict) for c in figure.checks])
    return found.render()
