"""Every kernel's header names its arguments: in the order of the signature, with type and shape, unit and meaning."""

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

OPENCL = Path(__file__).resolve().parents[2] / "kernels/opencl"
FILES = sorted(OPENCL.glob("*.cl"))
_SIGNATURE = re.compile(r"__kernel void (\w+)\(([^)]*)\)")
_HEADING = re.compile(r" \* (\w+)")
_ROW = re.compile(
    r" \*   (?P<name>\w+) +(?P<type>\w+)(?P<shape>\[.*\])? {2,}(?P<unit>1|um|1/um) {2,}(?P<meaning>\S.*)"
)


@dataclass(frozen=True)
class Argument:
    """One argument: its name, the type of its elements, and whether it is an array."""

    name: str
    type: str
    array: bool


def signatures(text: str) -> dict[str, list[Argument]]:
    """The arguments of every kernel of a file, as the compiler reads them."""
    return {kernel: [_declared(each) for each in inside.split(",")] for kernel, inside in _SIGNATURE.findall(text)}


def _declared(text: str) -> Argument:
    *words, name = text.replace("*", " * ").split()
    (type_,) = [word for word in words if word not in ("const", "__global", "*")]
    return Argument(name, type_, "*" in words)


def documented(text: str) -> dict[str, list[Argument]]:
    """The arguments that the comment at the top lists below each kernel's name."""
    assert text.startswith("/*"), "a file begins with its header"
    found: dict[str, list[Argument]] = {}
    rows: list[Argument] = []
    for line in text[: text.index("*/")].splitlines():
        if heading := _HEADING.fullmatch(line):
            rows = found[heading[1]] = []
        elif row := _ROW.fullmatch(line):
            rows.append(Argument(row["name"], row["type"], row["shape"] is not None))
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_header_names_every_argument_of_its_kernels(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert documented(text) == signatures(text)


def test_the_kernels_are_found() -> None:
    """Nothing compared would be nothing held."""
    kernels = [kernel for path in FILES for kernel in signatures(path.read_text(encoding="utf-8"))]
    assert {"along_x", "polar_power_spectrum", "apply_operator", "exact_power", "taylor_table"} <= set(kernels)
    assert len(kernels) == len(set(kernels)) == sum(path.read_text().count("__kernel") for path in FILES)


HEADER = """/* A file.
 *
 * scale
 *   x       double[n]   um    lengths
 *   factor  double      1     of every length
 */
__kernel void scale(__global double *x, const double factor) {}
"""


@pytest.mark.parametrize(
    "change",
    [
        ("factor  double      1     of every length", ""),
        ("factor  double ", "factor  float  "),
        ("factor  double  ", "factor  double[n]"),
        ("double      1     of", "double            of"),
        ("x       double[n]", "y       double[n]"),
        ("const double factor", "const double factor, const int count"),
        ("__global double *x, const double factor", "const double factor, __global double *x"),
    ],
)
def test_a_header_that_lags_behind_is_seen(change: tuple[str, str]) -> None:
    assert documented(HEADER) == signatures(HEADER)
    changed = HEADER.replace(*change)
    assert changed != HEADER
    assert documented(changed) != signatures(changed)
