"""Mutates sample scans of every format: each must give a reading or a refusal of one line, in 5 s and 1 GB.

python -m tests.fuzz.scans [COUNT [SEED]] prints the counts, and exits with 1 where a mutation did anything else.

The mutations are read as `read_scan` reads them, by `limited.answer` under the limits of a file of their size, but in
copies of one process that has imported all readers: a new interpreter for each would take ten times as long. The
processor time of a reading counts, because others may have the processor.
"""

import os
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
from PIL import Image

from pipeline.errors import InputError
from pipeline.surface.readers import limited, reading
from tests.support import SHARED
from tests.surface.test_formats import FILES as EXCHANGE
from tests.surface.test_profilometers import FILES as PROFILOMETERS

MOST_SECONDS, MOST_BYTES = 5.0, 1 << 30
_FOLDERS = ("scans", "field", "bad", "attack")
# a larger one is no better a sample, and takes long to read
_MOST_SAMPLE = 4 << 20
_HEADER = 4096
_LICENCES = re.compile(r"LICENSE|\.(?:py|toml|csv)$")
_NUMBERS = re.compile(rb"\d[\d.]*")
_ODD_NUMBERS = (b"0", b"-1", b"1e308", b"1.2.3", b".", b"99999999999", b"7" * 5000, b"nan", b"")


@dataclass(frozen=True)
class Outcome:
    """What reading a mutation did: its kind, the message or the fault, processor time and the most memory."""

    kind: str
    words: str
    seconds: float
    memory: int


def samples() -> dict[str, bytes]:
    """Returns small scans by file name: those that tests make, and real ones where they lie beside the checkout."""
    found = {name: data for name, (data, _) in EXCHANGE.items()}
    found |= {name: make() for name, (make, *_) in PROFILOMETERS.items()}
    found |= _written()
    for folder in _FOLDERS:
        for path in sorted((SHARED / folder).glob("*")):
            if not _LICENCES.search(path.name) and path.stat().st_size <= _MOST_SAMPLE:
                found[path.name] = path.read_bytes()
    return found


def _written() -> dict[str, bytes]:
    heights = np.add.outer(np.arange(24.0), np.arange(30.0) ** 2)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.save(folder / "made.npy", heights)
        np.savez_compressed(folder / "made.npz", height=heights, other=heights[0])
        np.savetxt(folder / "made.txt", heights, header="Width: 10 um\nHeight: 8 um\nValue units: nm")
        for suffix in ("png", "bmp", "tif"):
            Image.fromarray((heights / 4).astype(np.uint8)).save(folder / f"made.{suffix}")
        return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def mutated(data: bytes, chance: random.Random) -> bytes:
    """Cuts a file, flips bits, inserts or deletes bytes, or changes numbers; mostly in its first 4 kB."""
    kind = chance.choice(("cut", "flip", "insert", "delete", "number", "word"))
    reach = min(len(data), _HEADER) if chance.random() < 0.7 else len(data)
    place = chance.randrange(max(reach, 1))
    length = chance.choice((1, 2, 4, 16, 256))
    if kind == "cut":
        return data[:place]
    if kind == "insert":
        filling = chance.choice((chance.randbytes(length), bytes(length), b"\xff" * length, data[:length]))
        return data[:place] + filling + data[place:]
    if kind == "delete":
        return data[:place] + data[place + length :]
    if kind == "number":
        numbers = list(_NUMBERS.finditer(data, 0, reach))
        if numbers:
            number = chance.choice(numbers)
            return data[: number.start()] + chance.choice(_ODD_NUMBERS) + data[number.end() :]
    if kind == "word":
        word = chance.choice((b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", bytes(4), b"\x00\x00\x00\x80", b"\x00\x20"))
        return data[:place] + word + data[place + len(word) :]
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 3, 8))):
        if changed:
            changed[chance.randrange(max(reach, 1))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def mutations(count: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Yields names and contents: the samples in turn, each with a mutation that the seed determines."""
    chance = random.Random(seed)
    found = samples()
    order = sorted(found)
    chance.shuffle(order)
    for i in range(count):
        name = order[i % len(order)]
        yield name, mutated(found[name], chance)


def outcome(path: Path) -> Outcome:
    """Reads a scan in a copy of this process, and says what came of it."""
    try:
        allowed = limited.limits(limited.require_file(path))
    except InputError as error:
        return Outcome("refused", str(error), 0.0, 0)
    coming, going = os.pipe()
    child = os.fork()
    if child == 0:
        with os.fdopen(going, "wb") as stream:
            # what libraries print
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.dup2(nowhere, 2)
            limited.answer(stream, path, None, allowed)
        os._exit(0)
    os.close(going)
    kind, words = "read", ""
    with os.fdopen(coming, "rb") as answer:
        try:
            if limited.received(path.name, answer, allowed) is None:
                kind, words = "ended", "no answer"
        except InputError as error:
            kind, words = "refused", str(error)
    _, status, used = os.wait4(child, 0)
    if kind == "ended":
        words = str(limited.ended(path.name, os.waitstatus_to_exitcode(status), allowed))
    return Outcome(kind, words, used.ru_utime + used.ru_stime, used.ru_maxrss << 10)


def faults(found: Outcome) -> list[str]:
    """Lists what a reading should not have done."""
    wrong = []
    if found.kind != "read" and ("\n" in found.words or not found.words):
        wrong.append("not one line")
    # what no reader foresees is refused by `read_scan` all the same, in words that do not help
    if "a scan that can be read" in found.words:
        wrong.append("not foreseen")
    if found.seconds > MOST_SECONDS:
        wrong.append(f"{found.seconds:.1f} s")
    if found.memory > MOST_BYTES:
        wrong.append(f"{found.memory / 2**30:.2f} GB")
    return wrong


def sweep(count: int, seed: int, kept: Path | None = None) -> tuple[Counter[str], list[str]]:
    """Reads mutations and counts what they did.

    count: number of mutations. seed: determines them. kept: where mutations with faults are kept, if at all.
    Returns the counts, with the largest time (ms) and memory (MB), and one line for each fault.
    """
    _import_all()
    counts: Counter[str] = Counter()
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        for i, (name, data) in enumerate(mutations(count, seed)):
            path = Path(folder) / name
            path.write_bytes(data)
            found = outcome(path)
            kind = (
                "stopped by a limit"
                if "takes longer" in found.words or "asks for more" in found.words
                else found.kind
            )
            counts[kind] += 1
            counts["ms"] = max(counts["ms"], round(1000 * found.seconds))
            counts["MB"] = max(counts["MB"], found.memory >> 20)
            wrong = faults(found)
            if wrong:
                lines.append(f"{i} {name}: {', '.join(wrong)}: {found.words[:200]}")
                if kept is not None:
                    kept.mkdir(parents=True, exist_ok=True)
                    (kept / f"{i}-{name}").write_bytes(data)
            path.unlink()
    return counts, lines


def _import_all() -> None:
    """Imports all readers, so that copies of this process have them."""
    for module, _ in reading._READERS.values():
        import_module(f"pipeline.surface.readers.{module}")
    for library in ("gwyfile", "nanonispy2.read", "tifffile", "h5py", "PIL.PngImagePlugin", "SurfaceTopography.IO"):
        import_module(library)


def main() -> int:
    """Runs the sweep that the arguments ask for."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 5000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    kept = Path("out/fuzz")
    begun = time.monotonic()
    counts, lines = sweep(count, seed, kept)
    largest = f"at most {counts.pop('ms') / 1000:.2f} s and {counts.pop('MB')} MB each"
    told = ", ".join(f"{number} {kind}" for kind, number in sorted(counts.items()))
    print("\n".join(lines))
    print(f"{count} mutations, seed {seed}: {told}; {largest}; {len(lines)} faults; {time.monotonic() - begun:.0f} s")
    if lines:
        print(f"mutations with faults are in {kept}")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
