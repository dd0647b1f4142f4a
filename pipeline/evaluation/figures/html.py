"""The validation bench as HTML: a page for each figure, and an index of every verdict; templates/ has the texts."""

from collections import Counter
from collections.abc import Sequence

from pipeline.evaluation.figures.page import Page
from pipeline.evaluation.figures.pages import Made
from pipeline.evaluation.sources import SOURCES
from pipeline.report import template

_PACKAGE = "pipeline.evaluation.figures"


def page(of: Page) -> str:
    """Write the page of a figure."""
    return template.html(_PACKAGE, "figure.html.in", title=of.title, subtitle=of.source, page=of)


def index(made: Sequence[Made]) -> str:
    """Write the first page: every verdict, and a link to each page."""
    verdicts = Counter(check.verdict for one in made for check in one.page.checks)
    judged = verdicts["holds"] + verdicts["misses"]
    subtitle = (
        f"{verdicts['holds']} of {judged} judged statements hold, {verdicts['reported']} more are reported and not "
        f"judged. {sum(one.seconds for one in made):.0f} s in all."
    )
    return template.html(
        _PACKAGE, "index.html.in", title="Validation bench", subtitle=subtitle, pages=made, sources=SOURCES
    )
