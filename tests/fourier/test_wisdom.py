"""FFTW's wisdom: kept from process to process, and nothing depends on what became of its file."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import platformdirs
import pyfftw
import pytest

from kernels.dft_stack import Kept
from pipeline.fourier import term_transforms, wisdom
from pipeline.store import digest

ROOT = Path(__file__).resolve().parents[2]
KEPT = Kept(psi_max=5, phi_max=6, reach=2)
SHAPE = (26, 22)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache, and nothing learned from another."""
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda _name: str(tmp_path / "cache"))
    learned = wisdom._learned.copy()
    wisdom._learned.clear()
    yield tmp_path / "cache"
    wisdom._learned[:] = learned


def transformed(shape: tuple[int, int] = SHAPE) -> np.ndarray:
    out = np.empty((*KEPT.shape, 2, 1))
    term_transforms.transform([np.random.default_rng(2).uniform(-1.0, 1.0, shape)], KEPT, out)
    return out


def is_known(shape: tuple[int, int] = SHAPE) -> bool:
    """Whether the transform along x is planned from wisdom alone."""
    samples = pyfftw.empty_aligned(shape, float)
    half = pyfftw.empty_aligned((shape[0], shape[1] // 2 + 1), complex)
    with wisdom.planning():
        try:
            pyfftw.FFTW(samples, half, axes=(1,), flags=("FFTW_MEASURE", "FFTW_WISDOM_ONLY"))
        except RuntimeError:
            return False
    return True


def test_measured_plans_are_stored(folder: Path) -> None:
    assert not is_known()
    expected = transformed()
    assert [path for path in folder.rglob("*") if path.is_file()] == [wisdom.file()]
    assert is_known()
    wisdom._learned.clear()
    assert is_known(), "from the file"
    written = wisdom.file().stat().st_mtime_ns
    np.testing.assert_array_equal(transformed(), expected)
    assert wisdom.file().stat().st_mtime_ns == written, "nothing new, nothing written"


@pytest.mark.usefixtures("folder")
def test_a_second_size_is_added_to_the_first() -> None:
    transformed()
    wisdom._learned.clear()
    transformed((30, 18))
    wisdom._learned.clear()
    assert is_known()
    assert is_known((30, 18))


@pytest.mark.usefixtures("folder")
def test_wisdom_is_in_force_only_while_plans_are_made() -> None:
    pyfftw.forget_wisdom()
    none = pyfftw.export_wisdom()
    transformed()
    assert pyfftw.export_wisdom() == none


def test_processes_learn_from_each_other(tmp_path: Path) -> None:
    """Two processes at once leave a valid file, and the next one measures no plan again."""
    script = (
        "import sys; from tests.fourier import test_wisdom as t; shape = int(sys.argv[1]), 22;"
        "known = t.is_known(shape); t.transformed(shape); print(known)"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}

    def start(rows: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", script, str(rows)]
        return subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)

    # whichever is first, the other may read its file already
    assert "False" in [each.communicate()[0].strip() for each in (start(26), start(26))]
    assert start(26).communicate()[0].strip() == "True"
    assert [path.suffixes for path in tmp_path.rglob("*") if path.is_file()] == [[".json"]]


def cut_short(text: str) -> str:
    return text[: len(text) // 2]


def changed_inside(text: str) -> str:
    return text.replace("fftw_codelet", "fftw_codelex", 1)


def of_another_build(text: str) -> str:
    """Sound, but FFTW's signature in it is another's."""
    texts = [each.replace("fftw-3", "fftw-9") for each in json.loads(text)["wisdom"]]
    return json.dumps({"sha256": digest.of_json(texts), "wisdom": texts})


def of_another_shape(text: str) -> str:
    return json.dumps([text])


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("damage", [cut_short, changed_inside, of_another_build, of_another_shape])
def test_damaged_wisdom_is_ignored_and_replaced(damage: Callable[[str], str]) -> None:
    expected = transformed()
    sound = wisdom.file().read_text(encoding="ascii")
    damaged = damage(sound)
    assert damaged != sound
    wisdom.file().write_text(damaged, encoding="ascii")
    wisdom._learned.clear()
    np.testing.assert_allclose(transformed(), expected, atol=1e-15)
    wisdom._learned.clear()
    assert is_known()


@pytest.mark.usefixtures("folder")
def test_bytes_that_are_no_text_are_ignored() -> None:
    wisdom.file().parent.mkdir(parents=True)
    wisdom.file().write_bytes(bytes(range(256)))
    transformed()
    wisdom._learned.clear()
    assert is_known()


def test_a_cache_that_cannot_be_written_is_done_without(folder: Path) -> None:
    folder.write_text("a file where the folder would be", encoding="utf-8")
    transformed()
    assert is_known(), "this process still knows"


def test_without_the_kernels_word_a_processor_still_has_a_name(monkeypatch: pytest.MonkeyPatch) -> None:
    here = wisdom._processor()
    monkeypatch.setattr(Path, "read_text", refuse)
    elsewhere = wisdom._processor.__wrapped__()
    assert set(elsewhere) == {"machine", "processor"}
    assert {**here, **elsewhere} == here


def refuse(*_: object, **__: object) -> str:
    raise FileNotFoundError
