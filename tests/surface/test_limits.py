"""Reading a scan ends, and stays small: limits of time and memory, and checks before anything is allocated."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import tracemalloc
from dataclasses import asdict
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZIP_LZMA, ZipFile
from zlib import compressobj

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from cli.main import cli
from pipeline import resources
from pipeline.errors import ConfigError, InputError, ResourceError
from pipeline.surface.readers import limited, read_scan, reading, require_file
from pipeline.surface.readers.formats import BY_LIBRARY
from tests.support import shared_file

HEIGHTS = np.arange(108.0).reshape(9, 12)
# readers of test files, in the child: they replace the true one
_READERS = {
    "endless": "while True: pass",
    "waiting": "import time; time.sleep(1000)",
    "large": "bytearray(3 << 30)",
    "crashing": "os.kill(os.getpid(), 11)",
    "leaving": "raise SystemExit(0)",
    "loud": "os.write(1, b'noise'); os.write(2, b'noise'); raise ValueError('a line\\nand another')",
}


def message_of(path: Path, channel: str | None = None) -> str:
    with pytest.raises(InputError) as error:
        read_scan(path, channel)
    message = str(error.value)
    assert "\n" not in message
    assert path.name in message
    return message


@pytest.fixture
def text(tmp_path: Path) -> Path:
    path = tmp_path / "scan.txt"
    np.savetxt(path, HEIGHTS)
    return path


def with_reader(monkeypatch: pytest.MonkeyPatch, name: str, processor_s: float = 0.5, clock_s: float = 20.0) -> None:
    """Lets the child run code instead of a reader, under limits that a test can wait for."""
    code = (
        "import os, sys; sys.path.append({root!r})\n"
        "from pipeline.surface.readers import limited, reading\n"
        f"def read(path, channel):\n    {_READERS[name]}\n"
        "reading.read = read\n"
        "limited.main()"
    )
    monkeypatch.setattr(limited, "_CODE", code)
    monkeypatch.setattr(limited, "limits", lambda _: limited.Limits(processor_s, clock_s, 1 << 30, 2 << 30))


def test_a_child_hands_back_what_the_reader_returns(tmp_path: Path, text: Path) -> None:
    image = tmp_path / "scan.png"
    Image.fromarray(HEIGHTS.astype(np.uint8)).save(image)
    for path in (text, image, shared_file("field/g_mask_void.gwy")):
        here, there = reading.read(path, None), read_scan(path, None)
        np.testing.assert_array_equal(there.heights, here.heights)
        assert (there.mask is None) == (here.mask is None)
        assert here.mask is None or (there.mask == here.mask).all()
        names = [name for name in vars(here) if name not in ("heights", "mask")]
        assert [getattr(there, name) for name in names] == [getattr(here, name) for name in names]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("endless", "takes longer"),
        ("large", "asks for more"),
        ("crashing", "SIGSEGV"),
        ("leaving", "SystemExit"),
        ("loud", "ValueError: a line and another"),
    ],
)
def test_a_reader_that_misbehaves_is_refused_in_one_line(
    text: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], name: str, said: str
) -> None:
    with_reader(monkeypatch, name)
    assert said in message_of(text)
    assert capfd.readouterr() == ("", "")


def test_a_reader_that_waits_is_ended_by_the_clock(text: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_reader(monkeypatch, "waiting", clock_s=0.3)
    assert "takes longer" in message_of(text)


def test_an_interrupt_ends_the_child(text: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_reader(monkeypatch, "waiting")
    children = []
    start = subprocess.Popen

    def recorded(*arguments: object, **keywords: object) -> object:
        children.append(start(*arguments, **keywords))  # type: ignore[call-overload]
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        return children[-1]

    monkeypatch.setattr(limited.subprocess, "Popen", recorded)
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            read_scan(text, None)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert children[0].returncode == -signal.SIGKILL


def test_the_current_folder_is_not_searched_for_modules(
    text: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit(5)")
    monkeypatch.chdir(tmp_path)
    np.testing.assert_array_equal(read_scan(text, None).heights, HEIGHTS[::-1])


def test_limits_let_the_largest_scans_through() -> None:
    """8192 x 8192 samples: 8 bytes each in an array, 10 in text, which is read at 10 MB/s in ten times its size."""
    small, large = limited.limits(59), limited.limits(10 * 8192**2)
    assert small.processor_s < 5
    assert small.memory_bytes < 1 << 30
    assert large.processor_s > 10 * 8192**2 / 10e6
    assert large.memory_bytes > 10 * 10 * 8192**2


def test_every_reader_of_the_library_is_found_without_the_rest_of_it() -> None:
    pytest.importorskip("SurfaceTopography.IO", exc_type=ImportError)
    code = (
        "import sys; from pipeline.surface.readers import spm; spm.import_readers_alone()\n"
        f"assert all(map(spm._reader, {tuple(BY_LIBRARY)!r}))\n"
        "assert not {'matplotlib', 'scipy.optimize', 'asyncio'} & sys.modules.keys()"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(limited.__file__).parents[3])


# --- named inputs ------------------------------------------------------------------------------------


def test_a_gwy_file_that_lacks_a_nul() -> None:
    assert "damaged" in message_of(shared_file("attack/gwy_truncated_hangs.gwy"))


def test_sizes_that_are_no_numbers(tmp_path: Path) -> None:
    assert "1.2.3" in message_of(shared_file("attack/header_number.txt"))
    path = tmp_path / "scan.txt"
    np.savetxt(path, HEIGHTS, header="Real Width : . um\nReal Height : 10 um\nZ Unit : nm", comments="")
    scan = read_scan(path, None)
    assert scan.pitch_um is None
    assert "Real Width : . um" in scan.unread


def test_a_count_of_5000_digits(tmp_path: Path) -> None:
    assert "single column" in message_of(shared_file("attack/header_digits.txt"))
    path = tmp_path / "scan.txt"
    np.savetxt(path, HEIGHTS, header=f"Image Width : {'1' * 5000}\nImage Height : 9", comments="")
    assert any("image width" in line.casefold() for line in read_scan(path, None).unread)


# --- arrays, which are read in this process ----------------------------------------------------------


def npz(path: Path, header: dict[str, object], samples: int, method: int = ZIP_DEFLATED) -> Path:
    """An archive whose array "z" has a header and then `samples` MB of zeros, beside a small array."""
    with ZipFile(path, "w", method) as archive:
        with archive.open("z.npy", "w") as member:
            np.lib.format.write_array_header_2_0(member, header)
            for _ in range(samples):
                member.write(bytes(1 << 20))
        with archive.open("height.npy", "w") as member:
            np.lib.format.write_array(member, HEIGHTS)
    return path


def peak_of(path: Path, channel: str | None) -> tuple[str, int]:
    """Returns the refusal, or "", and the most bytes that reading asked Python and NumPy for."""
    tracemalloc.start()
    try:
        read_scan(path, channel)
    except InputError as error:
        return str(error), tracemalloc.get_traced_memory()[1]
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return "", peak


@pytest.mark.parametrize("shape", [(3000, 3000), (100000, 100000)])
def test_an_npz_is_decompressed_only_where_it_is_wanted(tmp_path: Path, shape: tuple[int, int]) -> None:
    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
    path = npz(tmp_path / "bomb.npz", header, 100)
    assert peak_of(path, "height") == ("", pytest.approx(0, abs=5e6))
    if max(shape) > 8192:
        message, peak = peak_of(path, "z")
        assert "at most 8192" in message
        assert peak < 5e6


def test_what_follows_an_array_is_not_decompressed(tmp_path: Path) -> None:
    header = {"descr": "<f8", "fortran_order": True, "shape": (8, 9)}
    message, peak = peak_of(npz(tmp_path / "bomb.npz", header, 100), "z")
    assert not message
    assert peak < 5e6


def test_an_npz_by_a_method_that_numpy_does_not_write(tmp_path: Path) -> None:
    header = {"descr": "<f8", "fortran_order": True, "shape": (8, 9)}
    assert "2-D array" in message_of(npz(tmp_path / "a.npz", header, 1, ZIP_LZMA))


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<u2"])
def test_arrays_in_either_order(tmp_path: Path, order: str, dtype: str) -> None:
    stored = np.asarray(HEIGHTS, dtype=dtype, order=order)  # type: ignore[call-overload]
    np.save(tmp_path / "a.npy", stored)
    np.savez_compressed(tmp_path / "a.npz", z=stored)
    for name in ("a.npy", "a.npz"):
        np.testing.assert_array_equal(read_scan(tmp_path / name, None).heights, HEIGHTS)


def test_an_npz_with_a_wrong_checksum(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, z=HEIGHTS)
    data = bytearray(path.read_bytes())
    data[300] ^= 1
    path.write_bytes(data)
    assert "damaged" in message_of(path)


# --- compressed scans, whose files say little of their samples ----------------------------------------


def tiff(path: Path, heights: np.ndarray, more: bytes = b"") -> Path:
    """A deflated TIFF of doubles in one strip, whose stream goes on with other bytes."""
    tifffile = pytest.importorskip("tifffile")
    packed = compressobj()
    strip = packed.compress(heights.tobytes()) + packed.compress(more) + packed.flush()
    tifffile.imwrite(
        path, iter([strip]), shape=heights.shape, dtype=heights.dtype, compression="zlib", rowsperstrip=len(heights)
    )
    return path


def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits reading to what small files need, so that fewer samples exceed it."""
    monkeypatch.setattr(limited, "limits", lambda _: limited.Limits(3.0, 60.0, 160 << 20, 2 << 30))


def test_a_scan_may_take_what_its_header_states(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    narrow(monkeypatch)
    heights = np.tile(np.arange(2560.0) % 64, (2048, 1))
    scan = read_scan(tiff(tmp_path / "large.tif", heights), None)
    np.testing.assert_array_equal(scan.heights, heights)
    assert (tmp_path / "large.tif").stat().st_size < 400_000


def test_a_scan_that_inflates_to_more_than_its_header_states(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    narrow(monkeypatch)
    path = tiff(tmp_path / "bomb.tif", np.ones((64, 64)), bytes(240 << 20))
    assert path.stat().st_size < 400_000
    assert "asks for more" in message_of(path)


@pytest.mark.parametrize("suffix", ["tif", "npy", "gsf"])
def test_a_scan_that_is_larger_than_the_memory_is_refused_by_its_header(tmp_path: Path, suffix: str) -> None:
    """Without the samples: the file is cut behind its header."""
    heights, path = np.ones((1000, 4000)), tmp_path / f"scan.{suffix}"
    if suffix == "tif":
        tiff(path, heights)
    elif suffix == "npy":
        np.save(path, heights)
        os.truncate(path, 200)
    else:
        path.write_bytes(b"Gwyddion Simple Field 1.0\nXRes = 4000\nYRes = 1000\n\0\0")
    words = rf"^scan\.{suffix}: 4000 x 1000 samples need 183 MiB, .* of --memory; crop the scan"
    with resources.allowing(150 << 20), pytest.raises(ResourceError, match=words):
        read_scan(path, None)


# --- what is no file ---------------------------------------------------------------------------------


def test_a_pipe_a_device_a_socket_and_empty_space_are_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.gwy")
    (tmp_path / "device.npy").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as listening:
        # the address of a socket has at most 108 bytes
        here = Path.cwd()
        os.chdir(tmp_path)
        listening.bind("socket.txt")
        os.chdir(here)
    for name, said in (("pipe.gwy", "a pipe"), ("device.npy", "a device"), ("socket.txt", "a socket")):
        assert said in message_of(tmp_path / name)
    for size, said in ((1 << 30, "empty space"), (20 << 30, "20.0 GiB")):
        for name in ("giant.txt", "giant.gwy"):
            with (tmp_path / name).open("wb") as file:
                file.write(b"GWYP")
                file.truncate(size)
            assert said in message_of(tmp_path / name)


def test_a_scan_with_a_hole_in_its_file_is_read(tmp_path: Path) -> None:
    """File systems may leave out blocks of zeros: a file is refused only where nearly nothing was written."""
    heights = np.zeros((3000, 3000))
    heights[:300] = 1.0
    path = tmp_path / "scan.npy"
    np.save(path, heights)
    assert require_file(path) == path.stat().st_size
    assert read_scan(path, None).heights.sum() == 300 * 3000


@pytest.mark.parametrize("command", ["inspect", "run"])
def test_commands_refuse_a_pipe_at_once(tmp_path: Path, command: str) -> None:
    os.mkfifo(tmp_path / "pipe.txt")
    config = tmp_path / "config.toml"
    config.write_text('name = "pipe"\n[surface]\npath = "pipe.txt"\n')
    source = [str(config), "--store", str(tmp_path / "store")] if command == "run" else [str(tmp_path / "pipe.txt")]
    begun = time.monotonic()
    result = CliRunner().invoke(cli, [command, *source])
    assert time.monotonic() - begun < 30
    assert isinstance(result.exception, InputError | ConfigError)
    assert "pipe.txt" in str(result.exception)


def test_an_answer_is_text_and_samples(text: Path) -> None:
    """What a child says is never unpickled."""
    request = json.dumps([str(text), None, asdict(limited.limits(1000)), None])
    code = "from pipeline.surface.readers.limited import main; main()"
    run = subprocess.run([sys.executable, "-c", code, request], capture_output=True, check=True,
                         cwd=Path(limited.__file__).parents[3])  # fmt: skip
    line, samples = run.stdout.split(b"\n", 1)
    assert json.loads(line)["shape"] == [9, 12]
    np.testing.assert_array_equal(np.frombuffer(samples).reshape(9, 12), HEIGHTS[::-1])
