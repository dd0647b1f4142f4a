"""Readers of scan files: images, arrays and text as they are, microscopes' formats by libraries.

`read_scan` is the way in. Libraries for microscopes are the extra `diffract-bake[readers]`, imported
only when a file needs them.
"""

from pathlib import Path

from pipeline.surface.readers import array, gwyddion, image, nanonis, spm, text
from pipeline.surface.readers.sniff import sniff
from pipeline.surface.scan import Scan

_READERS = {
    "image": image.read,
    "npy": array.read_npy,
    "npz": array.read_npz,
    "text": text.read,
    "gwyddion": gwyddion.read,
    "nanonis": nanonis.read,
}


def read_scan(path: Path, channel: str | None) -> Scan:
    """One channel of a scan file; `channel` None takes the height channel.

    The content decides the format, not the suffix. Raises InputError with one line where the file cannot
    be opened, is of no known format, is damaged, or does not hold the channel.
    """
    key = sniff(path)
    if key in spm.FORMATS:
        return spm.read(path, key, channel)
    return _READERS[key](path, channel)
