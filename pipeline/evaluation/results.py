"""Results of the evaluation on disk: JSON, CSV, HTML and PNG, each file taking its place whole."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.evaluation.check import Check
from pipeline.stages import provenance
from pipeline.store import scratch
from pipeline.store.store import writing


def write(folder: Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write files beside their places, rename each into its own, and return the paths.

    folder: made where it is missing. contents: a file's text (kept as UTF-8) or bytes by its name. Raises
    StorageError where the folder cannot be written.
    """
    with writing(folder), scratch.replacing(folder) as beside:
        for name, content in contents.items():
            (beside / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return [folder / name for name in contents]


def document(checks: Sequence[Check], **measured: Any) -> dict[str, Any]:
    """Return one run's results for JSON: versions, device, the checks with their verdicts, and what was measured.

    measured: by key; dataclasses and numpy's types inside become dictionaries, lists and numbers.
    """
    return {
        "versions": provenance.versions(),
        "device": provenance.device(),
        **plain({"checks": checks, **measured}),
    }


def plain(value: Any) -> Any:
    """Return dataclasses as dictionaries, and numpy's types as JSON's, at any depth; None for infinities and NaN."""
    if isinstance(value, Check):
        return plain(value.document())
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not isfinite(value) else value


def json_text(content: Mapping[str, Any]) -> str:
    """Return a document as JSON text."""
    return json.dumps(content, indent=1) + "\n"


def csv_text(rows: Sequence[Mapping[str, Any]], columns: Sequence[str] | None = None) -> str:
    """Return rows as CSV with a header.

    rows: values by column; floats are written to four digits, pairs as "a x b", a missing value as nothing.
    columns: in order; None for those of the first row.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, columns or list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: _cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return " x ".join(map(str, value))
    return f"{value:.4g}" if isinstance(value, float) else value
