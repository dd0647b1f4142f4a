"""The validation bench as HTML: a page a figure, and an index of every verdict."""

from collections.abc import Sequence

from pipeline.figures.figure import Figure
from pipeline.figures.pages import Made
from pipeline.report.page import Page

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
        f"{holding} of {len(judged)} statements hold, {len(checks) - len(judged)} are told beside published values"
        f". {sum(one.seconds for one in made):.0f} s in all.",
    )
    for one in made:
        figure = one.figure
        found.section(figure.title, figure.source)
        found.links([(f"page, {one.seconds:.0f} s", f"{figure.name}.html")])
        found.table(_CHECKS, [(c.what, c.expected, c.measured, c.verdict) for c in figure.checks])
    return found.render()
