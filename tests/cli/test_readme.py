"""Every command that README and docs/usage.md print works as printed, and every page they link exists."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.cli.tool import REPOSITORY, Tool, recipe

PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "ARCHITECTURE.md",
    *sorted(f"docs/{path.name}" for path in (REPOSITORY / "docs").glob("*.md")),
)
TEXTS = {name: (REPOSITORY / name).read_text(encoding="utf-8") for name in PAGES}
USAGE = TEXTS["docs/usage.md"]
GUIDE = TEXTS["README.md"] + USAGE
# a command is alone in its indented line, or two spaces before its explanation
_LINE = re.compile(r"^ {4,}(?:\.venv/bin/)?diffract-bake (.+?)(?: {2,}.*)?$", re.MULTILINE)
_ALSO = re.compile(r"also: (store \w+), (store \w+)$", re.MULTILINE)
COMMANDS = [*_LINE.findall(GUIDE), *(command for pair in _ALSO.findall(GUIDE) for command in pair)]
# in prose, a target is in a code span
_TARGET = re.compile(r"(?:^ {4,}|`|; )make ([a-z][a-z0-9-]*)", re.MULTILINE)
TARGETS = sorted({*_TARGET.findall("\n".join(TEXTS.values()))})
_LINK = re.compile(r"\]\(([^)#:]+)[^):]*\)")
# what these do takes longer than the rest of this folder together
SLOW = ("run configs/", "bench ")


def marks(command: str) -> list[pytest.MarkDecorator]:
    return [pytest.mark.slow, pytest.mark.long] if command.startswith(SLOW) else []


def test_commands_are_found() -> None:
    lines = [line for line in GUIDE.splitlines() if re.match(r" {4,}\S*diffract-bake ", line)]
    assert len(lines) + 2 == len(COMMANDS) >= 15
    from cli.main import _COMMANDS

    assert {command.split()[0] for command in COMMANDS} == set(_COMMANDS)


@pytest.mark.parametrize("command", [pytest.param(command, marks=marks(command)) for command in COMMANDS])
def test_command(copy: Tool, published: Path, command: str) -> None:
    """Placeholders are in capitals and stand for files of one small bake; one that is new fails here."""
    shutil.copytree(REPOSITORY / "configs", copy.folder / "configs")
    (copy.folder / "directions.csv").write_text("theta_i,phi_i,theta_r,phi_r\n0,0,13,0\n", encoding="utf-8")
    files = {
        "CONFIG...": "small.toml",
        "CONFIG": "small.toml",
        "SOURCE": "small.toml",
        "BUNDLE": str(copy.bundle()),
        "FILE.csv": "directions.csv",
    }
    if command.startswith("bench speed "):
        # compared with plain numpy by relative errors: some I_p of a grating are 0
        files["CONFIG"] = copy.config("rough.toml", surface=recipe("gaussian")).name
    words = [files.get(word, word) for word in shlex.split(command)]
    assert not any(re.fullmatch(r"[A-Z]{2,}\S*", word) for word in words), f"unknown placeholder in {command!r}"
    if command.startswith(("run configs/", "bench figures ")):
        copy = Tool(copy.folder, published)
    result = copy(*words)
    assert result.code == 0, result.stderr
    assert result.stdout


def test_make_targets_exist_and_are_listed() -> None:
    assert {"bake", "test", "bench", "pipeline"} <= set(TARGETS)
    printed = subprocess.run(["make", "-C", str(REPOSITORY)], capture_output=True, text=True, check=True).stdout
    helped = subprocess.run(["make", "-C", str(REPOSITORY), "help"], capture_output=True, text=True, check=True)
    assert printed == helped.stdout
    for target in TARGETS:
        command = ["make", "-C", str(REPOSITORY), "-n", target, "CONFIG=configs/scan.toml"]
        subprocess.run(command, capture_output=True, check=True)
        assert f"make {target}" in printed


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name: str) -> None:
    """Pages and pictures, from the folder of the page that links them."""
    folder = (REPOSITORY / name).parent
    missing = [target for target in _LINK.findall(TEXTS[name]) if not (folder / target).exists()]
    assert not missing


def test_pictures_have_a_page() -> None:
    linked = {Path(target).name for text in TEXTS.values() for target in _LINK.findall(text)}
    assert {path.name for path in (REPOSITORY / "docs").glob("*.png")} <= linked


def test_exit_codes_are_those_of_the_code() -> None:
    from pipeline import errors

    table = {int(code) for code in re.findall(r"^\| (\d+) \|", USAGE, re.MULTILINE)}
    raised = {cls.exit_code for cls in vars(errors).values() if isinstance(cls, type) and hasattr(cls, "exit_code")}
    assert table == {0, 129, 130, 143} | raised


def test_every_config_and_every_key_is_documented() -> None:
    from pipeline.config.models import Config

    for path in (REPOSITORY / "configs").glob("*.toml"):
        assert f"`{path.stem}`" in USAGE or f"configs/{path.name}" in USAGE
    for key, field in Config.model_fields.items():
        name, section = field.alias or key, field.annotation
        if name in ("name", "scene"):
            continue
        row = next(line for line in USAGE.splitlines() if line.startswith(f"| `[{name}]`"))
        keys = {*getattr(section, "model_fields", {})} - {"recipe"}
        assert all(f"`{key}`" in row for key in keys), name
