"""Runs diffract-bake as people do: in this process where that is as good, in another where it is not."""

import contextlib
import io
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

from cli.main import main

REPOSITORY = Path(__file__).parents[2]
COMMAND = str(Path(sys.executable).with_name("diffract-bake"))

# bakes in some 3 s: validation integrates every nanometre, so the spectrum is narrow
SMALL: dict[str, Any] = {
    "name": "small",
    "surface": {"recipe": {"kind": "sinusoid", "amplitude_um": 0.02, "size_um": 10, "pitch_um": 0.1}},
    "coherence": {"sigma_um": 2.0},
    "spectrum": {"range_nm": [540, 560]},
    "table": {"layout": "taylor", "resolution": 41},
    "accuracy": {"delta_e": 50.0},
    "render": {"size": 32},
}


@dataclass(frozen=True)
class Result:
    """The result of a command: its exit code and its output."""

    code: int
    stdout: str
    stderr: str

    @property
    def json(self) -> Any:
        """stdout as strict JSON: NaN and Infinity are none."""

        def refuse(name: str) -> None:
            raise AssertionError(f"{name} is not JSON")

        return json.loads(self.stdout, parse_constant=refuse)

    @property
    def errors(self) -> list[str]:
        return [line for line in self.stderr.splitlines() if line.startswith("error: ")]


@dataclass(frozen=True)
class Tool:
    """diffract-bake in a folder of its own: configs and `out` are below it, and by default the store too."""

    folder: Path
    store: Path

    @property
    def out(self) -> Path:
        return self.folder / "out"

    def __call__(self, *arguments: str | Path, stdin: str = "") -> Result:
        """Runs a command in this process."""
        out, err = io.StringIO(), io.StringIO()
        with (
            contextlib.chdir(self.folder),
            mock.patch.dict(os.environ, {"DIFFRACT_BAKE_STORE": str(self.store)}),
            mock.patch.object(sys, "argv", ["diffract-bake", *map(str, arguments)]),
            mock.patch.object(sys, "stdin", io.StringIO(stdin)),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            code = _exit_code()
        return Result(code, out.getvalue(), err.getvalue())

    def start(
        self, *arguments: str | Path, environment: Mapping[str, str] | None = None, wrapper: str | None = None
    ) -> subprocess.Popen[str]:
        """Starts a command in a process of its own; `wrapper` is Python that runs first in it."""
        command = (
            [COMMAND] if wrapper is None else [sys.executable, "-c", f"{wrapper}\nfrom cli.main import main\nmain()"]
        )
        return subprocess.Popen(
            [*command, *map(str, arguments)],
            cwd=self.folder,
            env={**os.environ, "DIFFRACT_BAKE_STORE": str(self.store), **(environment or {})},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def process(self, *arguments: str | Path, **keys: Any) -> Result:
        """Runs a command in a process of its own."""
        with self.start(*arguments, **keys) as process:
            stdout, stderr = process.communicate(timeout=120)
        return Result(process.returncode, stdout, stderr)

    def config(self, file: str = "small.toml", **sections: Any) -> Path:
        """Writes the small config, keys of its sections replaced, and gives its path."""
        document = {**SMALL}
        for name, value in sections.items():
            old = SMALL.get(name)
            document[name] = {**old, **value} if isinstance(old, dict) and name != "surface" else value
        path = self.folder / file
        path.write_text(toml(document), encoding="utf-8")
        return path

    def bundle(self, name: str = "small") -> Path:
        """The one bundle in out/NAME."""
        (found,) = (self.out / name).glob(f"{name}-*")
        return found

    def artifacts(self) -> dict[str, list[str]]:
        """Keys of the artifacts in the store by stage."""
        found: dict[str, list[str]] = {}
        for record in sorted(self.store.glob("*/*/artifact.json")):
            # a run that was killed may leave a whole artifact under tmp, which is never read
            if record.parents[1].name != "tmp":
                found.setdefault(record.parents[1].name, []).append(record.parent.name)
        return found


def _exit_code() -> int:
    try:
        result = main()
    except SystemExit as done:
        result = done.code
    return 0 if result is None else int(result)


def recipe(kind: str, **keys: Any) -> dict[str, Any]:
    """A [surface] with a small recipe."""
    return {"recipe": {"kind": kind, "size_um": 10, "pitch_um": 0.1, **keys}}


def toml(document: Mapping[str, Any]) -> str:
    """A TOML document of one level of sections."""
    lines = [f"{key} = {_value(value)}" for key, value in document.items() if not isinstance(value, dict)]
    for name, section in document.items():
        if isinstance(section, dict):
            lines += [f"[{name}]", *(f"{key} = {_value(value)}" for key, value in section.items())]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value)


def files(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Time of change and content of every file below a folder."""
    found = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): (path.stat().st_mtime_ns, path.read_bytes()) for path in found}


def temporary_files(tool: Tool) -> list[str]:
    """Files of work in progress: hidden ones, and those under the store's tmp."""
    hidden = [path for path in tool.folder.rglob(".*") if path.name not in (".", "..")]
    return [str(path) for path in (*hidden, *tool.store.glob("tmp/*"))]


def flip_a_byte(path: Path) -> None:
    """Changes one bit in the middle of a file."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def too_wide(text: str, columns: int = 80) -> list[str]:
    return [line for line in text.splitlines() if len(line) > columns]


@contextlib.contextmanager
def mounted(folder: Path, options: str) -> Iterator[bool]:
    """A tmpfs on a folder, False where this system does not let us."""
    folder.mkdir(parents=True, exist_ok=True)
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        done = False
    try:
        yield done
    finally:
        if done:
            subprocess.run(["umount", str(folder)], check=True)
