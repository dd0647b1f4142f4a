"""Reads a scan in this process: recognises the format and calls its reader.

Images, arrays and text are read here, formats of microscopes by the libraries of the extra `diffract-bake[readers]`,
which are imported only when a file needs them. Use `readers.read_scan`, which sets limits.
"""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from pipeline.surface.readers.formats import BY_LIBRARY
from pipeline.surface.readers.sniff import sniff
from pipeline.surface.scan import Scan

# format -> module and function; a module is imported when a file needs it
_READERS = {
    "image": ("image", "read"),
    "npy": ("array", "read_npy"),
    "npz": ("array", "read_npz"),
    "text": ("text", "read"),
    "gwyddion": ("gwyddion", "read"),
    "gsf": ("gsf", "read"),
    "nanonis": ("nanonis", "read"),
    "nanosurf": ("nanosurf", "read"),
    "nhf": ("hdf5", "read_nanosurf"),
    "h5jpk": ("hdf5", "read_jpk"),
}


def read(path: Path, channel: str | None) -> Scan:
    """Reads one channel of a scan file, whose format is recognised by content.

    path: the file. channel: name of the channel; None takes the height channel.
    Returns the channel as stored.
    Raises InputError where the file cannot be opened, has an unknown format, is damaged, or lacks the channel.
    """
    key = sniff(path)
    if key in BY_LIBRARY:
        from pipeline.surface.readers import spm

        return spm.read(path, key, channel)
    module, function = _READERS[key]
    reader: Callable[[Path, str | None], Scan] = getattr(
        import_module(f"pipeline.surface.readers.{module}"), function
    )
    return reader(path, channel)
