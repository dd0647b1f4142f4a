"""Text files: headers of several programs, marks of missing samples, index columns, x y z triples."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.surface.load import load_scan
from pipeline.surface.readers import read_scan
from pipeline.surface.scan import Scan
from pipeline.surface.source import SurfaceSource
from tests.support import shared_file

RNG = np.random.default_rng(4)
# top row first; no value is an integer
TOP_FIRST = np.round(RNG.normal(0, 30, (12, 16)), 3) + 0.0004


def save(tmp_path: Path, content: str, name: str = "scan.txt", encoding: str = "utf-8") -> Path:
    path = tmp_path / name
    path.write_text(content, encoding=encoding)
    return path


def body(table: NDArray[Any], separator: str = "\t", point: str = ".") -> str:
    return "\n".join(separator.join(f"{v:.4f}".replace(".", point) for v in row) for row in table) + "\n"


def message_of(path: Path, **keys: Any) -> str:
    with pytest.raises(InputError) as caught:
        load_scan(SurfaceSource(path=str(path), **keys))
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path.name}: expected ")
    return message


# --- headers -----------------------------------------------------------------------------------------

SPIP = """# File Format = ASCII
# Created by SPIP 4.5
# x-pixels = 16
# y-pixels = 12
# x-length = 1600
# y-length = 2400
# x-offset = 20
# Bit2nm = 0.01
# Start-of-Data
"""
GWYDDION = {
    "German": ("Kanal", "Breite", "Höhe", "Werteinheiten"),
    "French": ("Canal ", "Largeur ", "Hauteur ", "Unités de valeur "),
    "Russian": ("Канал", "Ширина", "Высота", "Единицы значения"),
    "Czech": ("Kanál", "Šířka", "Výška", "Jednotky hodnot"),
}


@pytest.mark.parametrize("language", GWYDDION)
@pytest.mark.parametrize("point", [".", ","])
def test_gwyddion_in_other_languages(tmp_path: Path, language: str, point: str) -> None:
    values = ("Topo", f"1{point}6 \u00b5m", f"6{point}00 µm", "nm")
    header = "".join(f"# {k}: {v}\n" for k, v in zip(GWYDDION[language], values, strict=True))
    scan = read_scan(save(tmp_path, header + body(TOP_FIRST, point=point)), None)
    np.testing.assert_array_equal(scan.heights, TOP_FIRST.round(4)[::-1])
    assert scan.pitch_um == pytest.approx((0.1, 0.5))
    assert (scan.um_per_unit, scan.channel, scan.unread) == (1e-3, "Topo", ())


@pytest.mark.parametrize(
    ("header", "um_per_unit", "pitch"),
    [
        # WITec or ST: radians with a factor to metres
        (
            "h=12 w=16\npixel size=2e-007 m\ndata unit=rad\nheight conversion factor (-> m)=6.3e-008\n",
            0.063,
            (0.2, 0.2),
        ),
        # SPIP: counts, and lengths in nm
        (SPIP, 1e-5, (0.1, 0.2)),
        ("# x-size: 1.6 um\n# y-size: 2.4 um\n# z-unit: Å\n", 1e-4, (0.1, 0.2)),
        ("% Scan Size = 1.6 x 2.4 µm\n% Units: nm\n", 1e-3, (0.1, 0.2)),
        ("# Scan size: 1600 nm x 2.4 um\n# Height unit: pm\n", 1e-6, (0.1, 0.2)),
        ("# Width (um): 1.6\n# Height (um): 2.4\n# Z scale (nm/bit): 0.5\n", 5e-4, (0.1, 0.2)),
        ("Pixel size: 100 nm/px\nZ scale: 2.5 nm/count\n", 2.5e-3, (0.1, 0.1)),
        (
            "NX = 16\nNY = 12\nScale X = 0.1\nScale Y = 0.2\nUnit X = um\nUnit Y = um\nUnit Data = nm\n",
            1e-3,
            (0.1, 0.2),
        ),
    ],
    ids=["factor", "SPIP", "sizes", "two sizes", "two units", "brackets", "per pixel", "Nova"],
)
def test_headers_with_factors_units_and_sizes(
    tmp_path: Path, header: str, um_per_unit: float, pitch: tuple[float, float]
) -> None:
    scan = read_scan(save(tmp_path, header + body(TOP_FIRST)), None)
    np.testing.assert_array_equal(scan.heights, TOP_FIRST.round(4)[::-1])
    assert scan.um_per_unit == pytest.approx(um_per_unit)
    assert scan.pitch_um == pytest.approx(pitch)
    assert scan.unread == ()


@pytest.mark.parametrize(
    "line",
    [
        "# Umrechnungsfaktor = 63",
        "# Bits to height: 0.01 nm",
        "# Z multiplier: 4",
        "# Tiefe: 3,5 µm",
        "# 0.02 nm/bit",
    ],
)
def test_lines_that_are_not_understood_stop_a_guess(tmp_path: Path, line: str) -> None:
    path = save(tmp_path, f"{line}\n# Date: 2020-01-01\n" + body(TOP_FIRST))
    assert read_scan(path, None).unread == (line,)
    keys: dict[str, Any] = {"pitch_um": 0.1, "height_unit": "nm"}
    message = message_of(path, **keys)
    assert line in message
    assert "override_file_units" in message
    assert load_scan(SurfaceSource(path=str(path), override_file_units=True, **keys))[1].unit_from == "config"


@pytest.mark.parametrize(
    ("header", "um_per_unit", "pitch"),
    [
        ('"Height(nm)"\n', 1e-3, None),
        ("Scan Size X\t1.6 um\nScan Size Y\t2.4 um\nZ Unit\tnm\n[Header end]\n", 1e-3, (0.1, 0.2)),
        ("Width (um)\t1.6\nHeight (um)\t2.4\nUnit\tnm\n", 1e-3, (0.1, 0.2)),
    ],
)
def test_headers_without_marks(
    tmp_path: Path, header: str, um_per_unit: float, pitch: tuple[float, float] | None
) -> None:
    scan = read_scan(save(tmp_path, header + body(TOP_FIRST)), None)
    np.testing.assert_array_equal(scan.heights, TOP_FIRST.round(4)[::-1])
    assert scan.um_per_unit == um_per_unit
    assert scan.pitch_um == (None if pitch is None else pytest.approx(pitch))


@pytest.mark.parametrize("line", ["nm", "0.37 per unit of height", "16 12"])
def test_a_line_that_may_state_a_unit_is_marked_and_not_removed(tmp_path: Path, line: str) -> None:
    message = message_of(save(tmp_path, f"{line}\n" + body(TOP_FIRST)))
    assert "begin it with '#'" in message
    assert "remove" not in message


def test_first_row_of_empty_cells_is_a_row(tmp_path: Path) -> None:
    scan = read_scan(save(tmp_path, "\t" * 15 + "\n" + body(TOP_FIRST[1:])), None)
    assert scan.heights.shape == TOP_FIRST.shape
    assert np.isnan(scan.heights[-1]).all()


def test_harmless_lines_stop_nothing(tmp_path: Path) -> None:
    path = save(
        tmp_path, "# Scan rate: 1 Hz\n# Date: 2020-01-01\n# made by hand\n# samples 3 of 4\n" + body(TOP_FIRST)
    )
    load_scan(SurfaceSource(path=str(path), pitch_um=0.1, height_unit="nm"))


def test_unit_and_factor_that_contradict_each_other_are_not_guessed(tmp_path: Path) -> None:
    path = save(tmp_path, "# Z unit: nm\n# Height scale (nm/bit): 3\n" + body(TOP_FIRST))
    scan = read_scan(path, None)
    assert scan.um_per_unit is None
    assert len(scan.unread) == 2


def test_esri_grid(tmp_path: Path) -> None:
    table = TOP_FIRST.copy()
    table[0, 3:5] = -9999
    header = "ncols 16\nnrows 12\nxllcorner 0.0\nyllcorner 0.0\ncellsize 0.25\nNODATA_value -9999\n"
    scan = read_scan(save(tmp_path, header + body(table, " ")), None)
    assert np.isnan(scan.heights[-1, 3:5]).all()
    assert np.count_nonzero(np.isnan(scan.heights)) == 2
    assert (scan.pitch_um, scan.steps) == (None, (0.25, 0.25))


# --- cells -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "mark", ["NaN", "Bad", "---", "--", "", "N/A", "#N/A", "nan(ind)", "-1.#IND", "void", "null"]
)
@pytest.mark.parametrize("separator", ["\t", ",", ";", " "])
@pytest.mark.parametrize("whole_row", [False, True])
def test_marks_of_missing_samples_are_holes(tmp_path: Path, mark: str, separator: str, whole_row: bool) -> None:
    if separator == " " and mark == "":
        pytest.skip("blanks cannot hold an empty cell")
    cells = [line.split(separator) for line in body(TOP_FIRST, separator).splitlines()]
    holes = np.zeros(TOP_FIRST.shape, dtype=bool)
    holes[4, 2:4] = holes[6, -1] = holes[7, 0] = holes[3:9, 8] = True
    if whole_row:
        holes[9] = holes[-1] = True
    for i, j in np.argwhere(holes):
        cells[i][j] = mark
    scan = read_scan(save(tmp_path, "\n".join(separator.join(row) for row in cells) + "\n"), None)
    np.testing.assert_array_equal(np.isnan(scan.heights), holes[::-1])
    np.testing.assert_array_equal(scan.heights[~holes[::-1]], TOP_FIRST.round(4)[::-1][~holes[::-1]])


@pytest.mark.parametrize("separator", ["\t", ",", ";"])
def test_a_separator_around_every_row_is_no_column(tmp_path: Path, separator: str) -> None:
    rows = body(TOP_FIRST, separator).splitlines()
    for content in ([row + separator for row in rows], [separator + row for row in rows]):
        assert read_scan(save(tmp_path, "\n".join(content)), None).heights.shape == TOP_FIRST.shape


def test_advice_keeps_the_rows(tmp_path: Path) -> None:
    rows = body(TOP_FIRST, " ").splitlines()
    rows[5] = rows[5].replace(rows[5].split()[3], "oops")
    message = message_of(save(tmp_path, "\n".join(rows)))
    assert "'oops' in column 4 of line 6" in message
    assert "write NaN" in message
    assert "remove" not in message.split(";")[1].split(":")[0]
    rows[5] = rows[4].rsplit(" ", 2)[0]
    assert "found 14 in line 6 where others have 16" in message_of(save(tmp_path, "\n".join(rows)))


@pytest.mark.parametrize("integers", [False, True])
def test_index_of_a_table_is_no_height(tmp_path: Path, integers: bool) -> None:
    table = (10 * TOP_FIRST).astype(int) if integers else TOP_FIRST.round(4)
    names = "," + ",".join(str(i) for i in range(16))
    rows = [f"{i}," + ",".join(str(v) for v in row) for i, row in enumerate(table)]
    scan = read_scan(save(tmp_path, "\n".join([names, *rows])), None)
    np.testing.assert_array_equal(scan.heights, table[::-1])
    assert "index" in scan.format
    quoted = ",".join(['""', *(f'"V{i}"' for i in range(16))])
    rows = [f'"{i}",' + ",".join(str(v) for v in row) for i, row in enumerate(table, start=1)]
    np.testing.assert_array_equal(read_scan(save(tmp_path, "\n".join([quoted, *rows])), None).heights, table[::-1])


def test_index_column_or_row_alone(tmp_path: Path) -> None:
    table = TOP_FIRST.round(4)
    column = [f"{i}," + ",".join(str(v) for v in row) for i, row in enumerate(table)]
    np.testing.assert_array_equal(read_scan(save(tmp_path, "\n".join(column)), None).heights, table[::-1])
    row = ",".join(str(i) for i in range(16)) + "\n" + body(TOP_FIRST, ",")
    np.testing.assert_array_equal(read_scan(save(tmp_path, row), None).heights, table[::-1])


def test_a_ramp_is_no_index(tmp_path: Path) -> None:
    ramp = np.add.outer(np.arange(12), np.arange(16))
    path = save(tmp_path, "\n".join(" ".join(str(v) for v in row) for row in ramp))
    np.testing.assert_array_equal(read_scan(path, None).heights, ramp[::-1])


def test_axes_are_steps(tmp_path: Path) -> None:
    names = "," + ",".join(f"{0.25 * i:g}" for i in range(16))
    rows = [f"{0.5 * i:g}," + ",".join(str(v) for v in row) for i, row in enumerate(TOP_FIRST.round(4))]
    scan = read_scan(save(tmp_path, "\n".join([names, *rows])), None)
    np.testing.assert_array_equal(scan.heights, TOP_FIRST.round(4)[::-1])
    assert scan.steps == (0.25, 0.5)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf16_without_a_mark(tmp_path: Path, encoding: str) -> None:
    scan = read_scan(save(tmp_path, body(TOP_FIRST), encoding=encoding), None)
    np.testing.assert_array_equal(scan.heights, TOP_FIRST.round(4)[::-1])


def test_a_profile_is_no_small_scan(tmp_path: Path) -> None:
    assert "two columns of 40 numbers" in message_of(save(tmp_path, body(RNG.normal(size=(40, 2)))))


# --- x y z triples -----------------------------------------------------------------------------------


def gwyddion_xyz(
    heights: NDArray[Any], step: tuple[float, float], offset: tuple[float, float] = (0, 0), header: str = ""
) -> str:
    """The text of Gwyddion's xyzexport.c: y grows from the top row; five significant digits."""
    lines = [
        f"{offset[0] + step[0] * (j + 0.5):.5g}\t{offset[1] + step[1] * (i + 0.5):.5g}\t{h:.5g}\n"
        for i, row in enumerate(heights)
        for j, h in enumerate(row)
    ]
    return header + "".join(lines)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (53e-6, 53e-6), (-20e-6, 1e-3)])
@pytest.mark.parametrize(
    "header",
    ["", "# Channel: Height\n# Lateral units: m\n# Value units: m\n", "# Kanal: H\n# XY: m\n# Werteinheiten: m\n"],
)
def test_gwyddion_triples(tmp_path: Path, offset: tuple[float, float], header: str) -> None:
    heights = RNG.normal(0, 1e-8, (40, 50))
    scan = read_scan(save(tmp_path, gwyddion_xyz(heights, (8e-9, 16e-9), offset, header), "scan.xyz"), None)
    np.testing.assert_allclose(scan.heights, heights[::-1], rtol=1e-4)
    # where the offset leaves no digits of the step, it is a fit
    rel = 1e-3 if max(offset) < 1e-4 else 1e-1
    if header:
        assert scan.pitch_um == pytest.approx((8e-3, 16e-3), rel=rel)
        assert scan.um_per_unit == 1e6
    else:
        assert scan.steps == pytest.approx((8e-9, 16e-9), rel=rel)


def test_five_digits_on_many_columns(tmp_path: Path) -> None:
    heights = RNG.normal(0, 1e-8, (9, 1100))
    content = gwyddion_xyz(heights, (8e-9, 8e-9))
    scan = read_scan(save(tmp_path, content), None)
    np.testing.assert_allclose(scan.heights, heights[::-1], rtol=1e-4)
    lines = content.splitlines()
    RNG.shuffle(lines)
    shuffled = read_scan(save(tmp_path, "\n".join(lines[5:])), None)
    assert shuffled.heights.shape == heights.shape
    assert np.count_nonzero(np.isnan(shuffled.heights)) == 5


def test_a_missing_grid_line_is_no_rounding(tmp_path: Path) -> None:
    x = np.delete(np.arange(30), 14) * 0.5 + 0.25
    lines = [f"{a:.5g} {b:.5g} {a * b:.5g}" for b in range(12) for a in x]
    assert "steps along x" in message_of(save(tmp_path, "\n".join(lines)))


def test_other_triples_have_y_upwards(tmp_path: Path) -> None:
    heights = RNG.normal(size=(10, 12)).round(4)
    up = [f"{j * 0.1:.2f},{i * 0.1:.2f},{h}" for i, row in enumerate(heights) for j, h in enumerate(row)]
    np.testing.assert_array_equal(read_scan(save(tmp_path, "\n".join(up)), None).heights, heights)
    # rows from the top with y descending
    down = [line for i in range(9, -1, -1) for line in up[12 * i : 12 * i + 12]]
    np.testing.assert_array_equal(read_scan(save(tmp_path, "\n".join(down)), None).heights, heights)


def test_names_of_three_columns_state_units(tmp_path: Path) -> None:
    rows = [f"{j * 0.1:.2f},{i * 0.2:.2f},{i + j}.5" for i in range(9) for j in range(10)]
    scan = read_scan(save(tmp_path, "\n".join(["X (um),Y (um),Z [nm]", *rows])), None)
    assert scan.pitch_um == pytest.approx((0.1, 0.2))
    assert scan.um_per_unit == 1e-3


def test_the_ratio_in_the_file_is_held_against_the_pitch(tmp_path: Path) -> None:
    path = save(tmp_path, gwyddion_xyz(RNG.normal(size=(12, 20)), (0.208333, 0.416667)))
    keys: dict[str, Any] = {"height_unit": "nm"}
    message = message_of(path, pitch_um=0.208333, **keys)
    assert "steps of 0.20833" in message
    assert "pitch_um = [0.208333, 0.41666" in message
    field, _ = load_scan(SurfaceSource(path=str(path), pitch_um=(0.208333, 0.416666), **keys))
    assert field.pitch_um == (0.208333, 0.416666)
    field, _ = load_scan(SurfaceSource(path=str(path), pitch_um=0.2, override_file_units=True, **keys))
    assert field.pitch_um == (0.2, 0.2)


# --- files of the field ------------------------------------------------------------------------------


def field(name: str) -> Scan:
    return read_scan(shared_file(f"field/{name}"), None)


def test_one_scan_by_gwy_and_by_xyz() -> None:
    pytest.importorskip("gwyfile")
    stored, triples = field("handed_L.gwy"), field("handed_L_as_gwyddion_exports.xyz")
    np.testing.assert_allclose(triples.heights, stored.heights, atol=1e-12)
    assert triples.steps == pytest.approx((1e-7, 1e-7))


@pytest.mark.parametrize(
    ("name", "um_per_unit", "pitch", "holes"),
    [
        ("t_phase_rad_header.txt", 0.0630079, 0.15625, 0),
        ("t_gwy_de.txt", 1e-3, 0.15625, 0),
        ("t_gwy_en_deccomma.txt", 1e-3, 0.15625, 0),
        ("t_tab_empty_column.txt", None, None, 64),
        ("t_csv_pandas.csv", None, None, 0),
        ("t_csv_rowindex.csv", None, None, 0),
        ("t_csv_empty_inner.csv", None, None, 51),
        ("t_wyko_bad_inner.txt", None, None, 51),
    ],
)
def test_texts_of_the_field(name: str, um_per_unit: float | None, pitch: float | None, holes: int) -> None:
    scan = field(name)
    assert scan.heights.shape == (64, 64)
    assert np.count_nonzero(np.isnan(scan.heights)) == holes
    assert scan.um_per_unit == (None if um_per_unit is None else pytest.approx(um_per_unit))
    assert scan.pitch_um == (None if pitch is None else pytest.approx((pitch, pitch)))


def test_text_before_binary_data_is_named() -> None:
    with pytest.raises(InputError, match="a Createc"):
        field("text_header_then_binary.dat")


@pytest.mark.parametrize("header", [b"key = 1\r\n", b"key = 1\r\n" * 1000])
def test_binary_data_behind_any_text_is_said(tmp_path: Path, header: bytes) -> None:
    path = tmp_path / "scan.dat"
    path.write_bytes(header + bytes(range(256)))
    with pytest.raises(InputError) as caught:
        read_scan(path, None)
    assert "remove that line" not in str(caught.value)
    assert "binary data behind a text header" in str(caught.value) or "unknown content" in str(caught.value)


def test_separators_of_thousands_are_named(tmp_path: Path) -> None:
    """Where a comma is the decimal point, 19,993.3 is no number; NaN in its place would lose a height."""
    rows = "\n".join(";".join(f"{20000 + v:,.1f}" for v in row) for row in TOP_FIRST)
    message = message_of(save(tmp_path, rows + "\n"), pitch_um=0.1, height_unit="nm")
    assert "where a comma is the decimal point; export them without separators of thousands" in message


# --- coordinates by sensors --------------------------------------------------------------------------


def _noisy_triples(path: Path, noise: float, missing: int = 0) -> NDArray[np.float64]:
    """Points in no order, each beside its grid point by normal noise, in steps."""
    chance = np.random.default_rng(1)
    y, x = np.mgrid[:30, :40].astype(float)
    heights = np.sin(x / 5) + 0.1 * y
    points = np.stack((x, y), axis=-1) + noise * chance.standard_normal((30, 40, 2))
    table = np.column_stack(((points * (0.1, 0.2)).reshape(-1, 2), heights.ravel()))
    np.savetxt(path, table[chance.permutation(len(table))[missing:]])
    return heights


@pytest.mark.parametrize(("noise", "missing"), [(0.02, 0), (0.045, 0), (0.02, 100)])
def test_points_beside_their_grid_are_taken_as_its_points(tmp_path: Path, noise: float, missing: int) -> None:
    heights = _noisy_triples(tmp_path / "a.xyz", noise, missing)
    scan = read_scan(tmp_path / "a.xyz", None)
    assert np.count_nonzero(np.isnan(scan.heights)) == missing
    assert np.nanmax(np.abs(scan.heights - heights)) < 1e-12
    assert scan.steps == pytest.approx((0.1, 0.2), rel=2e-3)
    told = re.search(
        r"beside their grid by ([\d.]+) % .* changes heights by ([\d.]+) % of their rms", scan.warnings[0]
    )
    assert told is not None
    assert float(told[1]) == pytest.approx(100 * noise, rel=0.1)
    assert 0 < float(told[2]) < 100 * noise
    _, record = load_scan(SurfaceSource(path=str(tmp_path / "a.xyz"), pitch_um=(0.1, 0.2), height_unit="um"))
    assert scan.warnings[0] in record.warnings


@pytest.mark.parametrize(("noise", "said"), [(0.08, "off by 8"), (0.3, "steps along x")])
def test_points_far_from_a_grid_are_refused(tmp_path: Path, noise: float, said: str) -> None:
    _noisy_triples(tmp_path / "a.xyz", noise)
    with pytest.raises(InputError, match=said):
        read_scan(tmp_path / "a.xyz", None)


# --- numbers -----------------------------------------------------------------------------------------


def test_thousands_that_look_like_decimals(tmp_path: Path) -> None:
    rows = [[f"{value:,.0f}" for value in row] for row in TOP_FIRST * 60]
    said = message_of(save(tmp_path, "\n".join("\t".join(row) for row in rows)))
    assert "beside integers such as" in said
    # decimals that happen to have three digits
    rows = [[f"{value:.3f}".replace(".", ",") for value in row] for row in TOP_FIRST]
    scan = read_scan(save(tmp_path, "\n".join("\t".join(row) for row in rows)), None)
    np.testing.assert_allclose(scan.heights, TOP_FIRST[::-1], atol=1e-3)


def test_the_sign_of_mathematics(tmp_path: Path) -> None:
    scan = read_scan(save(tmp_path, body(TOP_FIRST).replace("-", "\u2212")), None)
    np.testing.assert_allclose(scan.heights, TOP_FIRST[::-1], atol=1e-4)


def test_a_factor_of_spip_for_another_quantity(tmp_path: Path) -> None:
    header = "# File Format = ASCII\n# x-length = 1000\n# y-length = 500\n# Bit2nm = 1.0\n# z-unit = V\n"
    assert "found values in 'V'" in message_of(save(tmp_path, header + body(TOP_FIRST), "scan.asc"))


@pytest.mark.parametrize("place", ["first column", "last column", "first row", "last row"])
def test_an_axis_is_no_height(tmp_path: Path, place: str) -> None:
    side, line = place.split()
    axis = 0.1 * np.arange(TOP_FIRST.shape[0 if line == "column" else 1])
    order = (axis, TOP_FIRST.T if line == "column" else TOP_FIRST)
    table = np.vstack(order if side == "first" else order[::-1])
    table = table.T if line == "column" else table
    said = message_of(save(tmp_path, body(table)))
    assert f"found a {place} that goes evenly from 0 to" in said
    # a tilted mirror with dust is no axis
    dusty = 0.1 * np.arange(16.0) + 0.2 * np.arange(12.0)[:, None] + (RNG.random((12, 16)) < 0.1)
    dusty[0], dusty[-1] = dusty[0].min() + 0.1 * np.arange(16), dusty[-1].max() + 0.1 * np.arange(16)
    read_scan(save(tmp_path, body(dusty)), None)


def test_a_second_table(tmp_path: Path) -> None:
    header = "# Channel: {}\n# Width: 10 um\n# Height: 10 um\n# Value units: {}\n"
    content = header.format("Height", "nm") + body(TOP_FIRST)
    message = message_of(save(tmp_path, content + header.format("Phase", "deg") + body(TOP_FIRST)))
    assert "another header in line 17" in message
    read_scan(save(tmp_path, content + "# Channel: end of it\n"), None)


@pytest.mark.parametrize("name", ["Phase", "Deflection", "Amplitude error"])
def test_a_text_of_another_quantity_is_not_taken_unasked(tmp_path: Path, name: str) -> None:
    path = save(
        tmp_path, f"# Channel: {name}\n# Width: 10 um\n# Height: 10 um\n# Value units: nm\n" + body(TOP_FIRST)
    )
    assert f"found only '{name}'" in message_of(path)
    assert read_scan(path, name).channel == name


# --- Keyence -----------------------------------------------------------------------------------------


def _keyence(separator: str, words: tuple[str, ...], channel: str = "Height", pitch: str = "138.5") -> str:
    """A VK microscope's export, whose header is a published one: Kcsv2Bcr and vk4 converters name its lines."""
    date, lens, calibration, image, columns, rows, low, unit = words
    ny, nx = TOP_FIRST.shape
    header = [(date, "2024/03/01 12:30:05"), (lens, "150"), (calibration, pitch, "nm"), (image, channel)]
    header += [(columns, str(nx)), (rows, str(ny)), (low, "-50.000"), (unit, "µm")]
    lines = [separator.join(f'"{cell}"' for cell in cells) for cells in header] + ["", f'"{channel}"']
    point = "," if separator == ";" else "."
    cells = [[f'"{value:.4f}"'.replace(".", point) for value in row] for row in TOP_FIRST]
    return "\r\n".join([*lines, *(separator.join(row) for row in cells), ""])


_ENGLISH = ("Measured date", "Objective Lens Power", "XY Calibration", "Output image data", "Horizontal", "Vertical",
            "Minimum value", "Unit")  # fmt: skip
_GERMAN = ("Gemessenes Datum", "Objektivvergrößerung", "XY-Justierung", "Bilddatenausg.", "Horizont.", "Vertikal",
           "Mindestwert", "Einheit")  # fmt: skip


@pytest.mark.parametrize(
    ("separator", "words", "channel", "pitch"),
    [(",", _ENGLISH, "Height", "138.5"), (";", _GERMAN, "Höhe", "138,5"), ("\t", _ENGLISH, "Height", "138.5")],
)
def test_keyence(tmp_path: Path, separator: str, words: tuple[str, ...], channel: str, pitch: str) -> None:
    scan = read_scan(save(tmp_path, _keyence(separator, words, channel, pitch), "scan.csv"), None)
    np.testing.assert_allclose(scan.heights, TOP_FIRST[::-1], atol=1e-4)
    assert (scan.um_per_unit, scan.channel, scan.unread) == (1.0, channel, ())
    assert scan.pitch_um == pytest.approx((0.1385, 0.1385))


def test_keyence_without_heights(tmp_path: Path) -> None:
    content = _keyence(",", _ENGLISH, "Laser")
    assert "expected heights in a Keyence .csv, found 'Laser'" in message_of(save(tmp_path, content, "scan.csv"))


# --- what was not measured, in text ------------------------------------------------------------------


def _noisy() -> NDArray[np.float64]:
    y, x = np.mgrid[:64, :64]
    return np.asarray(np.round(30 * np.sin(x / 5) + np.random.default_rng(3).normal(0, 5, y.shape), 3), np.float64)


_HIGH = _noisy() > 20
# what a program wrote into a part of the scan -> holes, cropped (bottom, top, left, right), and words of a warning
_WRITTEN: dict[str, tuple[tuple[Any, ...], float, int, tuple[int, int, int, int], str]] = {
    "a number of convention": ((_HIGH,), -10000, 1065, (0, 0, 0, 0), "no-data number"),
    "the largest float": ((slice(0, 10),), 1.70141e38, 0, (0, 10, 0, 0), "no-data number"),
    "a number five ranges away": ((slice(20, 40), slice(20, 40)), -500, 400, (0, 0, 0, 0), "no-data number"),
    "zero among the heights": ((slice(20, 40), slice(20, 40)), 0, 400, (0, 0, 0, 0), "one value among heights"),
    "columns of zero": ((slice(None), slice(50, 64)), 0, 0, (0, 0, 0, 14), "columns of one value"),
    "a number below all heights": ((slice(20, 40), slice(20, 40)), -60, 0, (0, 0, 0, 0), "apart from all others"),
}


@pytest.mark.parametrize("name", _WRITTEN)
def test_numbers_that_programs_write_for_no_data(tmp_path: Path, name: str) -> None:
    place, number, holes, cropped, said = _WRITTEN[name]
    heights = _noisy()
    heights[place] = number
    path = tmp_path / "scan.txt"
    np.savetxt(path, heights, fmt="%.6g", delimiter="\t")
    _, record = load_scan(SurfaceSource(path=str(path), pitch_um=0.1, height_unit="nm"))
    assert (record.holes, record.cropped) == (holes, cropped)
    assert said in record.warnings[0]
