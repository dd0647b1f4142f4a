"""Tables of typed columns, from which text and JSON are made; sources and bands that all pages share."""

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.evaluation.check import Check
from pipeline.evaluation.figures.maps import bands_of, under_normal_light, window_on_sample_zero
from pipeline.evaluation.figures.page import Column, Page, PageTable, numbers
from pipeline.evaluation.sources import SOURCES
from pipeline.surface.heightfield import HeightField

ROOT = Path(__file__).resolve().parents[3]


def test_a_tables_text_and_json_come_from_its_numbers() -> None:
    columns = [Column("name"), *numbers("{:.2f}", "mean"), Column("ends", "{:.0f} to {:.0f}"), Column("note", "{:g}")]
    table = PageTable(
        "t", "Caption", columns, [("a", np.float64(1.234), (1.0, 2.0), None), ("b", 2, (3, 4), "beyond")]
    )
    assert table.texts == [["a", "1.23", "1 to 2", ""], ["b", "2.00", "3 to 4", "beyond"]]
    assert table.records[0] == {"name": "a", "mean": 1.234, "ends": [1.0, 2.0], "note": None}


def test_a_row_has_a_cell_for_every_column() -> None:
    with pytest.raises(ValueError, match="shorter"):
        _ = PageTable("t", "Caption", [Column("a"), Column("b")], [("1",)]).texts


def test_a_pages_document_is_json_without_infinities() -> None:
    checks = [Check("a", "a", np.inf), Check("b", "b", 1.0, source="closed form")]
    page = Page("p", "P", "[D14]", "", checks, [PageTable("t", "", [Column("a")], [(np.nan,)])])
    document = json.loads(json.dumps(page.document(), allow_nan=False))
    assert document["tables"] == {"t": [{"a": None}]}
    assert [(check["value"], check["source"]) for check in document["checks"]] == [
        (None, "[D14]"),
        (1.0, "closed form"),
    ]


def test_sources_are_those_of_the_references() -> None:
    """Tag and title are those of docs/references.md."""
    references = " ".join((ROOT / "docs" / "references.md").read_text(encoding="utf-8").split())
    for tag, work in SOURCES.items():
        entry = references[references.index(f"**{tag}**") :]
        title = work.split(", ", 1)[1].rpartition(",")[0]
        assert 0 < entry.lower().find(f"*{title.lower()}.*") < 200, tag


@pytest.mark.parametrize("reach", [np.inf, 0.5])
def test_the_search_for_bands_ends_at_its_reach(reach: float) -> None:
    """Bands beyond the reach count as none."""
    axis = np.linspace(-1.0, 1.0, 101)
    profile = np.exp(-np.abs(axis) / 0.2)
    profile[np.isclose(axis, 0.7)] *= 3.0
    found = bands_of(profile, axis, 0.1, reach)
    expected = 3.0 * np.exp(-0.02 / 0.2) - 1.0 if reach > 0.7 else 0.0
    assert found.contrast == pytest.approx(expected)


def test_views_are_unit_vectors_and_the_corner_becomes_the_middle() -> None:
    wi, wr = under_normal_light(np.array([0.0, 0.3]), np.array([0.4, -0.5]))
    np.testing.assert_allclose(np.linalg.norm(wr, axis=1), 1.0)
    np.testing.assert_array_equal(wi, [[0.0, 0.0, 1.0]] * 2)
    field = HeightField(np.arange(30.0).reshape(5, 6), (0.1, 0.2))
    assert window_on_sample_zero(field).heights_um[5 // 2, 6 // 2] == field.heights_um[0, 0]
