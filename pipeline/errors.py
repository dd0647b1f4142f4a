"""What can go wrong, told to a person in one line.

Every message says where the fault is, what was expected, what was found and the way out. Each class
carries the process exit code that docs/usage.md documents.
"""


class BakeError(Exception):
    """A fault the user can mend; never shown with a traceback."""

    exit_code = 1


class ConfigError(BakeError):
    """A config file has faults; `faults` lists every one as (key path, message)."""

    exit_code = 2

    def __init__(self, source: str, faults: list[tuple[str, str]]) -> None:
        self.source = source
        self.faults = faults
        lines = [f"{source}: {key}: {text}" if key else f"{source}: {text}" for key, text in faults]
        super().__init__("\n".join(lines))


class InputError(BakeError):
    """An input file (a scan, a CSV of a light or a metal, a list of directions) cannot be read or trusted."""

    exit_code = 3


class AccuracyError(BakeError):
    """The digits asked for cannot be had by the method chosen."""

    exit_code = 4


class DeviceError(BakeError):
    """No OpenCL device can build and run a kernel."""

    exit_code = 5


class DamagedError(BakeError):
    """A stored artifact or a bundle is not what it was when it was written."""

    exit_code = 6


class StorageError(BakeError):
    """Nothing could be written: disk full, no permission."""

    exit_code = 7
