"""Texts as files: jinja2 templates, in the folder templates/ of a package."""

import base64
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


def markdown(packages: tuple[str, ...], name: str, **values: Any) -> str:
    """Fill a template of the first package that has it with values, as they are; it may extend one of the others.

    Raises jinja2.UndefinedError for a value that the template asks for and does not get.
    """
    return _fill(packages, name, values, autoescape=False)


def html(package: str, name: str, **values: Any) -> str:
    """Fill a template of a package with values, escaped for HTML; it may extend the pages of pipeline.report.

    Raises jinja2.UndefinedError for a value that the template asks for and does not get.
    """
    return _fill((package, "pipeline.report"), name, values, autoescape=True)


def _fill(packages: tuple[str, ...], name: str, values: dict[str, Any], *, autoescape: bool) -> str:
    return _environment(packages, autoescape=autoescape).get_template(name).render(values)


@cache
def _environment(packages: tuple[str, ...], *, autoescape: bool) -> "Environment":
    """Makes the environment of some packages' templates, which keeps them compiled."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package) for package in packages]),
        undefined=StrictUndefined,
        autoescape=autoescape,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode("ascii")
    return environment
