"""The validation bench as HTML: a page for each figure, and an index of every verdict; templates/ has the texts."""

from collections.abc import Sequence

from pipeline.evaluation.figures.figure import Figure
from pipeline.evaluation.figures.pages import Made
from pipeline.report import template

_PACKAGE = "pipeline.evaluation.figures"


def page(figure: Figure) -> str:
    """Write the page of a figure."""
    return template.html(_PACKAGE, "figure.html.in", title=figure.title, subtitle=figure.source, figure=figure)


def index(made: Sequence[Made]) -> str:
    """Write the first page: what holds, what misses, and a link to each page."""
    checks = [check for one in made for check in one.figure.checks]
    judged = [check for check in checks if check.holds is not None]
    holding = sum(check.holds is True for check in judged)
    subtitle = (
        f"{holding} of {len(judged)} judged statements hold, {len(checks) - len(judged)} more are told and not judged"
        f". {sum(one.seconds for one in made):.0f} s in all."
    )
    return template.html(_PACKAGE, "index.html.in", title="Validation bench", subtitle=subtitle, pages=made)
