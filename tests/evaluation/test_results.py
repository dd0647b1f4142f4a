"""Results on disk: numbers that JSON and CSV know, and files that take their places whole."""

import csv
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import StorageError
from pipeline.evaluation import results
from pipeline.evaluation.check import Check

CHECK = Check("surface.error", "mean dE", 0.05, "<=", 0.08)


@dataclass(frozen=True)
class Pair:
    name: str
    at: tuple[np.float64, int]


def test_files_take_their_places(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "here"
    written = results.write(folder, {"a.txt": "µm\n", "b.png": b"\x89PNG"})
    assert written == [folder / "a.txt", folder / "b.png"]
    assert sorted(folder.iterdir()) == written
    assert (folder / "a.txt").read_bytes() == "µm\n".encode()


def test_a_folder_that_cannot_be_written_is_a_storage_error(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("", encoding="utf-8")
    with pytest.raises(StorageError, match="taken"):
        results.write(tmp_path / "taken" / "below", {"a.txt": ""})


def test_a_document_is_json() -> None:
    made = results.document(
        [CHECK], deep={3: [Pair("x", (np.float64(1.5), 2))]}, array=np.arange(2), truth=np.bool_(1)
    )
    read = json.loads(results.json_text(made))
    assert read == made
    assert read["checks"] == [{**CHECK.document()}]
    assert read["checks"][0]["verdict"] == "holds"
    assert read["deep"] == {"3": [{"name": "x", "at": [1.5, 2]}]}
    assert (read["array"], read["truth"]) == ([0, 1], True)
    assert {"versions", "device"} <= set(read)


def test_rows_are_csv() -> None:
    rows = [{"name": "a", "shape": (40, 48), "seconds": 0.123456}, {"name": "b, c"}]
    read = list(csv.DictReader(results.csv_text(rows).splitlines()))
    assert read[0] == {"name": "a", "shape": "40 x 48", "seconds": "0.1235"}
    assert read[1] == {"name": "b, c", "shape": "", "seconds": ""}
