"""Files that anyone may have written: folders are listed without opening a file, and only plain files are read."""

import errno
import filecmp
import os
import stat
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

_MOST_ENTRIES = 100_000


def listing(folder: Path, expected: Iterable[str]) -> tuple[dict[str, int], list[str]]:
    """Lists the plain files of a folder, without opening or following anything.

    folder: the folder. expected: names of files relative to it, with slashes; only their folders are entered.
    Returns the size in bytes of each file by its relative name, and a fault for each folder that holds no expected
    file and for everything else, such as links, which could lead outside, pipes and devices.
    Raises OSError where a folder cannot be listed.
    """
    entered = {str(parent) for name in expected for parent in PurePosixPath(name).parents}
    found: dict[str, int] = {}
    faults: list[str] = []
    queue = [""]
    while queue:
        prefix = queue.pop()
        with os.scandir(folder / prefix) as entries:
            for entry in entries:
                name, status = prefix + entry.name, entry.stat(follow_symlinks=False)
                if stat.S_ISREG(status.st_mode):
                    found[name] = status.st_size
                elif not stat.S_ISDIR(status.st_mode):
                    faults.append(f"{name} is not a plain file")
                elif name in entered:
                    queue.append(f"{name}/")
                else:
                    faults.append(f"{name}/ was added")
                if len(found) + len(faults) > _MOST_ENTRIES:
                    return found, [*sorted(faults), f"more than {_MOST_ENTRIES} files; the others were not looked at"]
    return dict(sorted(found.items())), sorted(faults)


def differences(folder: Path, original: Path) -> list[str]:
    """Compares the files of a folder with those of an original, byte by byte.

    folder: the folder. original: a folder with the expected files.
    Returns one line for each file that is missing, added or changed, that cannot be read, or that is no plain file.
    Raises OSError where the folder cannot be listed.
    """
    names = sorted(path.relative_to(original).as_posix() for path in original.rglob("*") if path.is_file())
    sizes, faults = listing(folder, names)
    faults += [f"{name} is missing" for name in names if name not in sizes]
    faults += [f"{name} was added" for name in sizes if name not in names]
    common = [name for name in names if name in sizes]
    _, changed, unread = filecmp.cmpfiles(original, folder, common, shallow=False)
    return faults + [f"{name} was changed" for name in changed] + [f"{name} cannot be read" for name in unread]


def read_text(path: Path, most_bytes: int) -> str:
    """Reads a plain file of UTF-8 text.

    path: the file, no link. most_bytes: its largest size.
    Raises OSError where it cannot be read or is not a plain file; ValueError where it is larger, or not UTF-8.
    """
    # a pipe without a writer would block an ordinary open
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with open(descriptor, "rb") as stream:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "not a plain file", str(path))
        if status.st_size > most_bytes:
            raise ValueError(f"{status.st_size} bytes, more than the {most_bytes} that are read")
        return stream.read(most_bytes).decode("utf-8")
