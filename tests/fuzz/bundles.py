"""Mutates bundles and runs `verify` and `eval` on each: only exit 0 or 6 within 5 s and 1 GB is right.

    python -m tests.fuzz.bundles --count 1000 --seed 1 [BUNDLE...]

Without bundles, small ones of both layouts are baked. Every mutation ends in checksums that hold, unless it is about
files. Each command runs in a process of its own with limits; the case of number N depends on the seed and N alone.
"""

import argparse
import contextlib
import io
import itertools
import json
import math
import os
import random
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipeline.bundle import checksums
from pipeline.bundle.checksums import SUMS
from pipeline.bundle.document import MANIFEST

MOST_SECONDS, MOST_BYTES = 5.0, 2**30
# the machine may be busy: a process that waits for ever is found by this, others by their own processor time
_HANGS_AFTER_S = 60
_DIRECTIONS = "30,0,20,180\n30,0,30,180\n30,0,1,90\n"
_ODD_NUMBERS = (
    0, -1, 1, 2, 3, 1e-320, 1e-300, 1e300, -1e300, 1e19, 10**400, 0.5, 1e-9, 32768, 2**31, float("nan"), float("inf"),
)  # fmt: skip
_ODD_VALUES = (
    *_ODD_NUMBERS,
    None,
    True,
    "",
    "../../../etc/passwd",
    "\ud800",
    "\x1b]0;x\x07",
    [],
    {},
    [[[]]],
    "x" * 10_000,
)

Mutation = Callable[[Path, random.Random], None]


def _manifest(folder: Path) -> Any:
    return json.loads((folder / MANIFEST).read_text(encoding="utf-8"))


def _write_manifest(folder: Path, manifest: Any) -> None:
    (folder / MANIFEST).write_text(json.dumps(manifest), encoding="utf-8")


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Lists (container, key) of every value below a JSON value."""
    keys = list(value) if isinstance(value, dict) else list(range(len(value))) if isinstance(value, list) else []
    return [place for key in keys for place in [(value, key), *_places(value[key])]]


def change_a_value(folder: Path, rng: random.Random) -> None:
    """Gives up to three values of the manifest another one, most often those that an evaluator reads."""
    manifest = _manifest(folder)
    read = ("grid", "tables", "material", "maps", "report", "name", "version", "provenance", "coverage")
    for _ in range(rng.randint(1, 3)):
        keys = [key for key in (read if rng.random() < 0.8 else list(manifest)) if key in manifest]
        within = {key: manifest[key] for key in [rng.choice(keys)]}
        container, key = rng.choice(_places(within))
        value = container[key]
        if isinstance(value, int | float) and not isinstance(value, bool) and rng.random() < 0.7:
            new = rng.choice([rng.choice(_ODD_NUMBERS), value * 10 ** rng.uniform(-3, 3), -value, value + 1])
        else:
            new = rng.choice(_ODD_VALUES)
        container[key] = new
        manifest.update(within)
    _write_manifest(folder, manifest)


def drop_or_add_a_value(folder: Path, rng: random.Random) -> None:
    """Removes, repeats or adds an entry of the manifest."""
    manifest = _manifest(folder)
    container, key = rng.choice(_places(manifest))
    how = rng.randrange(3)
    if how == 0:
        del container[key]
    elif isinstance(container, list):
        container.extend([container[key]] * rng.choice([1, 100, 60_000]))
    else:
        container[f"{key}\x07more"] = container[key]
    _write_manifest(folder, manifest)


def spoil_the_json(folder: Path, rng: random.Random) -> None:
    """Makes the manifest deep, cut, not UTF-8, a giant, or changes bytes of it."""
    path = folder / MANIFEST
    data = bytearray(path.read_bytes())
    how = rng.randrange(5)
    if how == 0:
        deep = rng.choice([100, 1000, 100_000])
        data = bytearray(b'{"a":' * deep + b"1" + b"}" * deep if rng.random() < 0.5 else b"[" * deep + b"]" * deep)
    elif how == 1:
        del data[rng.randrange(len(data)) :]
    elif how == 2:
        data[rng.randrange(len(data))] = 0xFF
    elif how == 3:
        for _ in range(rng.randint(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
    path.write_bytes(data)
    if how == 4:
        os.truncate(path, rng.choice([2**23, 2**33]))


def _image(folder: Path, rng: random.Random) -> Path:
    return rng.choice(sorted(folder.rglob("*.exr")))


def change_bytes_of_an_image(folder: Path, rng: random.Random) -> None:
    """Changes 1 to 5 bytes of an EXR, in its header half of the time."""
    path = _image(folder, rng)
    data = bytearray(path.read_bytes())
    end = 450 if rng.random() < 0.5 else len(data)
    for _ in range(rng.randint(1, 5)):
        data[rng.randrange(min(end, len(data)))] = rng.randrange(256)
    path.write_bytes(data)


def cut_an_image(folder: Path, rng: random.Random) -> None:
    """Cuts an EXR, or lengthens it."""
    path = _image(folder, rng)
    data = path.read_bytes()
    path.write_bytes(data[: rng.randrange(len(data))] if rng.random() < 0.8 else data + bytes(rng.randint(1, 5000)))


def change_a_texel(folder: Path, rng: random.Random) -> None:
    """Decompresses a block of an EXR, changes numbers in it, and compresses it again, in place."""
    path = _image(folder, rng)
    _write_blocks(path, lambda raw: _with_odd_floats(raw, rng))


def _with_odd_floats(raw: bytes, rng: random.Random) -> bytes:
    data = bytearray(raw)
    words = (b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff\xff\x7f\x7f", b"\xff\xff\x7f\xff", b"\1\0\0\0", b"\0\0\0\0")
    for _ in range(rng.randint(1, 3)):
        at = 4 * rng.randrange(max(1, len(data) // 4))
        data[at : at + 4] = rng.choice(words)
    return bytes(data[: len(raw)])


def _write_blocks(path: Path, change: Callable[[bytes], bytes]) -> None:
    """Writes an EXR of ZIP blocks again with every block's pixels changed, as float32 words in planes of bytes."""
    data = path.read_bytes()
    start = data.index(b"scanlineimage") + len(b"scanlineimage") + 1
    (first,) = struct.unpack_from("<Q", data, start)
    count = (first - start) // 8
    blocks, places, at = [], [], first
    for place in struct.unpack_from(f"<{count}Q", data, start):
        line, size = struct.unpack_from("<ii", data, place)
        packed = data[place + 8 : place + 8 + size]
        with contextlib.suppress(zlib.error):
            packed = zlib.compress(_filtered(change(_unfiltered(zlib.decompress(packed)))))
        blocks.append(struct.pack("<ii", line, len(packed)) + packed)
        places.append(at)
        at += len(blocks[-1])
    path.write_bytes(data[:start] + struct.pack(f"<{count}Q", *places) + b"".join(blocks))


def _unfiltered(data: bytes) -> bytes:
    """Undoes OpenEXR's predictor, and its split into even and odd bytes."""
    out = bytearray(data)
    for i in range(1, len(out)):
        out[i] = (out[i - 1] + out[i] - 128) & 255
    half = (len(out) + 1) // 2
    raw = bytearray(len(out))
    raw[0::2], raw[1::2] = out[:half], out[half:]
    return bytes(raw)


def _filtered(raw: bytes) -> bytes:
    split = raw[0::2] + raw[1::2]
    return split[:1] + bytes((b - a + 128) & 255 for a, b in itertools.pairwise(split))


def make_a_bomb(folder: Path, rng: random.Random) -> None:
    """Writes an EXR of zeros that is a thousand times as large in memory; the manifest states its size, or not."""
    manifest = _manifest(folder)
    width, height = rng.choice(
        [(2000, 2000), (4001, 4001), (12000, 12000), (32768, 4096), (32768, 32768), (46340, 1)]
    )
    stated = rng.random() < 0.7
    images = manifest["tables"] if rng.random() < 0.7 else manifest["maps"]
    for image in images[: rng.choice([1, len(images)])]:
        names = sorted(image["channels"])
        (folder / image["file"]).write_bytes(zeros(names, width, height, image["pixel_type"]))
        if stated:
            image["width"], image["height"] = width, height
    if stated and images is manifest["tables"]:
        grid = manifest["grid"]
        grid["width"], grid["height"] = width, height
        if grid["layout"] == "polar":
            grid["step"] = math.asinh(grid["rho_max"] / grid["r0"]) / max(1, height - 1)
    _write_manifest(folder, manifest)


def zeros(names: list[str], width: int, height: int, pixel_type: str) -> bytes:
    kind, size = {"half": (1, 2), "float": (2, 4)}[pixel_type]
    channels = b"".join(name.encode() + b"\0" + struct.pack("<iIii", kind, 0, 1, 1) for name in names) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = [
        (b"channels", b"chlist", channels),
        (b"compression", b"compression", b"\3"),
        (b"dataWindow", b"box2i", window),
        (b"displayWindow", b"box2i", window),
        (b"lineOrder", b"lineOrder", b"\0"),
        (b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
        (b"screenWindowCenter", b"v2f", bytes(8)),
        (b"screenWindowWidth", b"float", struct.pack("<f", 1)),
    ]
    header = b"\x76\x2f\x31\x01" + struct.pack("<I", 2)
    header += b"".join(n + b"\0" + t + b"\0" + struct.pack("<i", len(v)) + v for n, t, v in attributes) + b"\0"
    packed: dict[int, bytes] = {}
    places, blocks, at = [], [], len(header) + 8 * -(-height // 16)
    for line in range(0, height, 16):
        raw = min(16, height - line) * width * size * len(names)
        if raw not in packed:
            packed[raw] = zlib.compress(b"\0" + b"\x80" * (raw - 1))
        places.append(at)
        blocks.append(struct.pack("<ii", line, len(packed[raw])) + packed[raw])
        at += len(blocks[-1])
    return header + struct.pack(f"<{len(places)}Q", *places) + b"".join(blocks)


def recompress_an_image(folder: Path, rng: random.Random) -> None:
    """Writes an EXR by OpenEXR in another form: compression, type, window, tiles or parts."""
    import numpy as np
    import OpenEXR

    path = _image(folder, rng)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        planes = {name: channel.pixels for name, channel in file.channels().items()}
    how = rng.choice(["compression", "type", "channels", "window", "tiles", "parts"])
    names = ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB", "ZSTD"]
    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    if how == "compression":
        header["compression"] = getattr(OpenEXR, f"{rng.choice(names)}_COMPRESSION")
    elif how == "type":
        planes = {
            name: plane.astype(rng.choice([np.float16, np.float32, np.uint32])) for name, plane in planes.items()
        }
    elif how == "channels":
        planes.pop(rng.choice(sorted(planes)))
    elif how == "window":
        height, width = next(iter(planes.values())).shape
        left = rng.randint(-50, 50)
        header["dataWindow"] = (np.array([left, 7], np.int32), np.array([left + width - 1, 6 + height], np.int32))
    elif how == "tiles":
        header |= {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    planes = {name: np.ascontiguousarray(plane) for name, plane in planes.items()}
    if how == "parts":
        parts = [OpenEXR.Part({**header}, {**planes}, f"part {i}") for i in range(2)]
        OpenEXR.File(parts).write(str(path))
    else:
        OpenEXR.File(header, planes).write(str(path))


def _file(folder: Path, rng: random.Random) -> Path:
    return rng.choice(sorted(path for path in folder.rglob("*") if path.is_file()))


def replace_a_file(folder: Path, rng: random.Random) -> None:
    """Puts something that is no plain file, or a sparse giant, in the place of a file."""
    path = _file(folder, rng)
    how = rng.choice(["pipe", "link", "device", "folder", "giant", "emptied"])
    if how == "giant":
        os.truncate(path, rng.choice([2**33, 30 * 2**30]))
    elif how == "emptied":
        path.write_bytes(b"")
    else:
        path.unlink()
        if how == "pipe":
            os.mkfifo(path)
        elif how == "folder":
            path.mkdir()
        else:
            path.symlink_to("/dev/zero" if how == "device" else "/etc/passwd")


def add_or_remove_files(folder: Path, rng: random.Random) -> None:
    """Adds files with odd names, folders, pipes, or removes a file."""
    how = rng.choice(["remove", "name", "folder", "pipe", "deep", "listed"])
    if how == "remove":
        _file(folder, rng).unlink()
    elif how == "folder":
        (folder / "tables" / "more").mkdir()
    elif how == "pipe":
        os.mkfifo(folder / "maps" / "more")
    elif how == "deep":
        (folder / "/".join("d" * 200)).mkdir(parents=True)
    elif how == "listed":
        (folder / "more.txt").write_text("more", encoding="utf-8")
        checksums.write(folder)
    else:
        (Path(os.fsdecode(os.fsencode(folder) + b"/a\x1b[31m\nb\xff"))).touch()


def spoil_the_sums(folder: Path, rng: random.Random) -> None:
    """Changes SHA256SUMS: bytes, odd lines, a giant."""
    path = folder / SUMS
    text = path.read_bytes()
    odd = [
        b"no line\n",
        b"0" * 64 + b"  ../../etc/passwd\n",
        b"0" * 64 + b"  /etc/passwd\n",
        b"\xff\n",
        text,
        b"\0" * 99,
    ]
    how = rng.randrange(3)
    if how == 0:
        path.write_bytes(text + rng.choice(odd) * rng.choice([1, 1000]))
    elif how == 1:
        os.truncate(path, 2**33)
    else:
        at = rng.randrange(len(text))
        path.write_bytes(text[:at] + bytes([rng.randrange(256)]) + text[at + 1 :])


# those whose checksums and name are made right again, then those of files
MENDED: tuple[Mutation, ...] = (
    change_a_value,
    change_a_value,
    drop_or_add_a_value,
    spoil_the_json,
    change_bytes_of_an_image,
    change_bytes_of_an_image,
    cut_an_image,
    change_a_texel,
    make_a_bomb,
    recompress_an_image,
)
OF_FILES: tuple[Mutation, ...] = (replace_a_file, add_or_remove_files, spoil_the_sums)


def mutate(source: Path, target: Path, rng: random.Random) -> tuple[str, Path]:
    """Makes a mutated copy of a bundle below `target`; returns the name of the mutation, and the folder."""
    folder = Path(shutil.copytree(source, target / source.name))
    mutation = rng.choice(MENDED + OF_FILES)
    mutation(folder, rng)
    if mutation in MENDED and (folder / MANIFEST).stat().st_size < 2**30:
        (folder / SUMS).unlink()
        digest = checksums.write(folder)
        # a renamed folder is a bundle, too
        name = rng.choice([f"{source.name.rpartition('+')[0]}+{digest}", "renamed"])
        folder = folder.rename(target / name)
    return mutation.__name__, folder


def in_a_child(work: Callable[[], int], output: Path) -> tuple[int, float, int]:
    """Runs a function in a process of its own whose output goes to a file.

    Returns its exit code, negative for a signal; its processor time, s; the memory that it added to this process's.
    """
    child = os.fork()
    if child == 0:
        stream = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(stream, 1)
        os.dup2(stream, 2)
        sys.stdout, sys.stderr = io.TextIOWrapper(io.FileIO(1, "w")), io.TextIOWrapper(io.FileIO(2, "w"))
        signal.alarm(_HANGS_AFTER_S)
        before = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        # the pool of OpenEXR's threads is address space that is never touched
        resource.setrlimit(resource.RLIMIT_AS, (before + 3 * MOST_BYTES,) * 2)
        resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
        code = 1
        try:
            code = work()
        except SystemExit as done:
            code = done.code if isinstance(done.code, int) else int(done.code is not None)
        finally:
            with contextlib.suppress(Exception):
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(code)
    _, status, usage = os.wait4(child, 0)
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, 1024 * max(usage.ru_maxrss - own, 0)


def command(*arguments: str) -> Callable[[], int]:
    """Returns a function that runs diffract-bake."""

    def work() -> int:
        from cli.main import main

        sys.argv = ["diffract-bake", *arguments]
        main()
        return 0

    return work


def bake(folder: Path) -> int:
    """Bakes the small bundles of the tests, both layouts, whole and in half floats, with and without a scene."""
    from pipeline.store.store import Store
    from tests.bundle.conftest import LAYOUTS, SCENE, Baker, publish, small

    baker = Baker(Store(folder / "store"))
    for layout in LAYOUTS:
        for name, sections in {
            "plain": {},
            "half": {"publish": {"precision": "half"}},
            "scene": {"scene": SCENE, "render": {"lights": SCENE["lights"]}},
            "metal": {"material": {"fresnel": "conductor", "metal": "Au"}},
        }.items():
            config = small(layout, **sections)
            publish(config, baker(config), folder / "bundles" / layout / name)
    return 0


def sweep(bundles: list[Path], count: int, seed: int, work: Path) -> tuple[Counter[str], list[str]]:
    """Runs `count` cases; returns the number of each outcome, and a line for each case that went wrong."""
    outcomes: Counter[str] = Counter()
    wrong: list[str] = []
    directions = work / "directions.csv"
    directions.write_text(_DIRECTIONS, encoding="utf-8")
    output = work / "output"
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        case = work / "case"
        case.mkdir()
        source = rng.choice(bundles)

        def prepare(source: Path = source, case: Path = case, rng: random.Random = rng) -> int:
            name, folder = mutate(source, case, rng)
            (case / "made").write_text(f"{name}\n{folder.name}", encoding="utf-8")
            return 0

        code, _, _ = in_a_child(prepare, output)
        if code != 0:
            wrong.append(f"case {number}: could not be made ({code}): {output.read_text(errors='replace')[-300:]}")
            shutil.rmtree(case)
            continue
        made = (case / "made").read_text(encoding="utf-8").splitlines()
        folder = case / made[1]
        for name, work_of in (
            ("verify", command("verify", str(folder))),
            ("eval", command("eval", str(folder), "--directions", str(directions))),
        ):
            code, seconds, held = in_a_child(work_of, output)
            outcomes[f"{name} exit {code}"] += 1
            text = output.read_text(errors="replace")
            faults = [
                *([f"exit {code}"] if code not in (0, 6) else []),
                *([f"{seconds:.1f} s"] if seconds > MOST_SECONDS else []),
                *([f"{held / 2**20:.0f} MB"] if held > MOST_BYTES else []),
                *(["lines without 'error: '"] if code == 6 and not _tidy(text) else []),
                *(["a warning"] if code == 0 and "Warning" in text else []),
            ]
            if faults:
                wrong.append(f"case {number}: {made[0]} of {source}: {name}: {', '.join(faults)}: {text[-300:]!r}")
        shutil.rmtree(case)
    return outcomes, wrong


def _tidy(text: str) -> bool:
    return all(line.startswith("error: ") and line.isprintable() for line in text.splitlines())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundles", nargs="*", type=Path)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        bundles = given.bundles
        if not bundles:
            # in a child: a process with OpenEXR's or OpenCL's threads must not fork
            code, _, _ = in_a_child(lambda: bake(work), work / "output")
            if code != 0:
                print((work / "output").read_text(errors="replace"), file=sys.stderr)
                return 1
            bundles = sorted((work / "bundles").glob("*/*/*"))
        # children inherit what is imported here
        from pipeline.bundle import evaluator, verify  # noqa: F401

        outcomes, wrong = sweep(bundles, given.count, given.seed, work)
    for line in wrong:
        print(line)
    counts = ", ".join(f"{outcome}: {outcomes[outcome]}" for outcome in sorted(outcomes))
    print(f"{given.count} mutated bundles, seed {given.seed}: {counts}; {len(wrong)} wrong", end="")
    print(f"; {time.monotonic() - started:.0f} s")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
