"""One statement of the evaluation as numbers: a measured value, its bound, and the verdict that follows."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

Relation = Literal["<=", "<", ">=", ">", "="]
Verdict = Literal["holds", "misses", "reported", "not measured"]

_DIGITS, _MOST_DIGITS = 4, 10
_SIGNS: dict[Relation, str] = {"<=": "≤ ", "<": "< ", ">=": "≥ ", ">": "> ", "=": ""}


@dataclass(frozen=True)
class Check:
    """A measured value and what source or theory says of it.

    id: dotted name that tests and programs look for, unique on its page. what: a phrase for people. value: as
    measured; None where this run did not look. bound: what the value is compared with; None where there is nothing to
    compare. relation: value `relation` bound; "=" is |value - bound| <= tolerance. tolerance: of "="; None where the
    bound is only shown beside the value and not judged. unit: of value, bound and tolerance. source: where the bound
    comes from (paper and number, closed form, criterion). remark: how the number was obtained.
    """

    id: str
    what: str
    value: float | None
    relation: Relation = "<="
    bound: float | None = None
    tolerance: float | None = None
    unit: str = ""
    source: str = ""
    remark: str = ""

    def __post_init__(self) -> None:
        # numpy's numbers are no numbers of JSON
        for name in ("value", "bound", "tolerance"):
            number = getattr(self, name)
            object.__setattr__(self, name, None if number is None else float(number))

    @property
    def verdict(self) -> Verdict:
        """The verdict in a word: "reported" where nothing is judged."""
        if self.value is None:
            return "not measured"
        if self.bound is None or (self.relation == "=" and self.tolerance is None):
            return "reported"
        held = {
            "<=": self.value <= self.bound,
            "<": self.value < self.bound,
            ">=": self.value >= self.bound,
            ">": self.value > self.bound,
            "=": abs(self.value - self.bound) <= (self.tolerance or 0.0),
        }[self.relation]
        return "holds" if held else "misses"

    @property
    def expected(self) -> str:
        """The bound as text."""
        if self.bound is None:
            return ""
        spread = "" if self.tolerance is None else f" ± {self.tolerance:.3g}"
        return f"{_SIGNS[self.relation]}{self.bound:.{self._digits}g}{spread} {self.unit}".rstrip()

    @property
    def measured(self) -> str:
        """The value as text."""
        return "" if self.value is None else f"{self.value:.{self._digits}g} {self.unit}".rstrip()

    @property
    def _digits(self) -> int:
        """Significant digits of both texts: four, or as many as tell the value from its bound."""
        if self.value is None or self.bound is None:
            return _DIGITS
        apart = (n for n in range(_DIGITS, _MOST_DIGITS) if f"{self.value:.{n}g}" != f"{self.bound:.{n}g}")
        return next(apart, _DIGITS)

    def document(self) -> dict[str, Any]:
        """All of it, with the verdict, for JSON."""
        return {**asdict(self), "verdict": self.verdict}
