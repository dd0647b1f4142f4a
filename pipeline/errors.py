"""The project's exceptions.

Every message fits in one line: it names the file or key, what was expected, what was found and how to proceed. Each
class carries the exit code that docs/usage.md documents.
"""


class BakeError(Exception):
    """Base of faults that the user can correct; the command line shows them without a traceback.

    message: one line. others: those of further faults of the same kind.
    """

    exit_code = 1

    def __init__(self, message: str, *others: str) -> None:
        self.lines = (message, *others)
        super().__init__("\n".join(self.lines))


class ConfigError(BakeError):
    """A config is faulty.

    source: the config's file or name. faults: all of them, as (path of the key, message).
    """

    exit_code = 2

    def __init__(self, source: str, faults: list[tuple[str, str]]) -> None:
        self.source = source
        self.faults = faults
        lines = [f"{source}: {key}: {text}" if key else f"{source}: {text}" for key, text in faults]
        super().__init__(*lines)


class InputError(BakeError):
    """An input file (a scan, a CSV of a light or a metal, a list of directions) cannot be read or trusted."""

    exit_code = 3


class AccuracyError(BakeError):
    """The chosen method cannot reach the requested accuracy."""

    exit_code = 4


class ResourceError(BakeError):
    """The work needs more memory than it may take."""

    exit_code = 4


class DeviceError(BakeError):
    """No OpenCL device can compile and run a kernel."""

    exit_code = 5


class DamagedError(BakeError):
    """A stored artifact or a bundle has changed since it was written."""

    exit_code = 6


class StorageError(BakeError):
    """A file could not be written: the disk is full, or permission is missing."""

    exit_code = 7
