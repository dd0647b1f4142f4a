"""Words of the evaluation as files: texts/NAME.toml of a package holds statements, captions, headings and remarks."""

import tomllib
from dataclasses import fields
from importlib.resources import files
from typing import TYPE_CHECKING, Any, TypeVar

from pipeline.evaluation.check import Check

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")


class Texts:
    """The words of a page or of a list of criteria; their fields {name} are filled with values by str.format.

    package: the folder with texts/. name: of the file. values: those that all of its texts may name.
    """

    def __init__(self, package: str, name: str, **values: Any) -> None:
        content = files(package).joinpath("texts", f"{name}.toml").read_text(encoding="utf-8")
        self.words: dict[str, Any] = tomllib.loads(content)
        self._values = values

    def fill(self, text: str, /, **values: Any) -> str:
        """Fill a text with values and join its lines. Raises KeyError for a value that is not given."""
        return " ".join(text.format(**{**self._values, **values}).split())

    def check(self, key: str, value: float | None, /, **known: Any) -> Check:
        """Return the check that the file states under [checks.KEY], with its measured value.

        known: values of its texts, and fields of `Check` that are computed (bound, tolerance, remark).
        """
        return self.filled(Check, {"id": key, **self.words["checks"][key]}, known, value=value)

    def filled(self, made: type[T], words: dict[str, Any], known: dict[str, Any], **measured: Any) -> T:
        """Make a dataclass of a section's texts, fields of it that are among `known`, and what was measured."""
        texts = {name: self.fill(each, **known) if isinstance(each, str) else each for name, each in words.items()}
        computed = {field.name: known[field.name] for field in fields(made) if field.name in known}
        return made(**{**texts, **computed, **measured})
