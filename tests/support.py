"""What tests share: real scans, fields made of them, reading without a child, and processes that die on request."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.surface.conditioning import condition
from pipeline.surface.heightfield import HeightField
from pipeline.surface.readers import limited, reading
from pipeline.surface.scan import Scan

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"

_KILLED_AT = """
import atexit, os, signal, sys
left = {count}
def hook(event, arguments):
    global left
    if event in ("os.mkdir", "os.rename", "os.remove", "os.utime", "shutil.copyfile") or (
        event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)
    ):
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(hook)
atexit.register(lambda: print("changes:", {count} - left, file=sys.stderr))
"""


def killed_at(count: int) -> str:
    """Python that runs first in a process and kills it just before its `count`-th change to the disk.

    One that comes to its end tells on stderr how many "changes: " there were.
    """
    return _KILLED_AT.format(count=count)


def shared_file(name: str) -> Path:
    """A real scan from beside the checkout, or a skip that says so."""
    path = SHARED / name
    if not path.is_file():
        pytest.skip(f"real scan {name} is not beside this checkout")
    return path


def read_scans_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replaces the child process that reads a scan: each takes half a second to start."""

    def read(path: Path, channel: str | None, _limits: limited.Limits) -> Scan:
        return reading.read(path, channel)

    monkeypatch.setattr(limited, "_by_child", read)


def snake(name: str) -> HeightField:
    """A real snake scan (65 um, levelled and clipped as [D14] 6.3's sigma_h says): "elaphe" or "xenopeltis"."""
    from PIL import Image

    height_range = {"elaphe": 0.518, "xenopeltis": 0.81869}[name]
    with Image.open(shared_file(f"snakes/{name}_65um.png")) as image:
        codes = np.asarray(image.convert("RGB"))[::-1, :, 0]
    field = HeightField(codes / 255.0 * height_range, (65.0 / codes.shape[1], 65.0 / codes.shape[0]))
    return condition(field, "plane", (0.05, 99.9))[0]
