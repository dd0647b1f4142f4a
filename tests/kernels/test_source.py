"""Sources of kernels: what they include is there once, digests cover it, and errors name the file and line."""

import re
from unittest import mock

import pyopencl
import pytest

from kernels import device, source
from pipeline.stages.stage import kernel_digest

FILES = {
    "shared.cl": "#define SHARED 1\n",
    "first.cl": '/* header */\n#include "shared.cl"\n__kernel void first() {}\n',
    "second.cl": '#include "shared.cl"\n#include "first.cl"\n__kernel void second() {}\n',
    "wrong.cl": '#include "shared.cl"\n\n__kernel void wrong() { undeclared = SHARED; }\n',
}


@pytest.fixture(autouse=True)
def files() -> object:
    with mock.patch.object(source, "read", FILES.__getitem__):
        yield


def test_what_is_included_is_there_once() -> None:
    text = source.text("second.cl", "first.cl")
    lines = [line for line in text.splitlines() if not line.startswith("#line")]
    assert lines == ["#define SHARED 1", "/* header */", "__kernel void first() {}", "__kernel void second() {}"]


def test_no_include_is_left_in_the_kernels() -> None:
    assert not re.search("#include", source.text("first.cl", "second.cl", "wrong.cl"))


def test_a_digest_covers_what_is_included() -> None:
    before = kernel_digest("first.cl"), kernel_digest("second.cl")
    with mock.patch.dict(FILES, {"shared.cl": "#define SHARED 2\n"}):
        after = kernel_digest("first.cl"), kernel_digest("second.cl")
    assert before[0] != after[0]
    assert before[1] != after[1]


def test_the_compiler_names_the_file_and_the_line() -> None:
    with pytest.raises(pyopencl.Error, match=r"wrong\.cl:3"):
        device.Program(("first.cl", "wrong.cl"), {})
