"""The text of OpenCL sources, with what they include."""

import re
from collections.abc import Iterator
from importlib.resources import files

_INCLUDE = re.compile(r'#include "(\w+\.cl)"')


def text(*names: str) -> str:
    """Return the text of some files of opencl/, by their names, one after the other.

    `#include "common.cl"` is replaced by that file where it is met first. `#line` directives make the compiler name
    files and lines as they are here.
    """
    seen: set[str] = set()
    return "".join(f"{line}\n" for name in names for line in _lines(name, seen))


def _lines(name: str, seen: set[str]) -> Iterator[str]:
    if name in seen:
        return
    seen.add(name)
    yield f'#line 1 "{name}"'
    for number, line in enumerate(read(name).splitlines(), 1):
        included = _INCLUDE.fullmatch(line)
        if included is None:
            yield line
        else:
            yield from _lines(included[1], seen)
            yield f'#line {number + 1} "{name}"'


def read(name: str) -> str:
    """Return the text of one file of opencl/ as it is."""
    return files("kernels").joinpath("opencl", name).read_text(encoding="utf-8")
