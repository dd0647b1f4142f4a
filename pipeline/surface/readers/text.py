"""Reads text files: rows of numbers, the first row at the top, with or without a header that states units."""

import codecs
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.surface.readers import keyence, xyz
from pipeline.surface.readers.common import (
    MIN_SAMPLES,
    check_shape,
    fault,
    library_version,
    micrometres,
    one_line,
    pick_channel,
)
from pipeline.surface.readers.header import Header, may_state_scale, understand
from pipeline.surface.scan import Scan

_NUMBER = re.compile(r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eEdD][-+]?\d+)?")
# rows with nothing but these need no look at each cell, unless a sign stands alone
_PLAIN = frozenset("0123456789.,;eE+- \t\r")
_LONE_SIGN = re.compile(r"[-+](?:[^\d.,]|$)")
_EXCEL_ERROR = re.compile(r"#(?:n/a|num!|value!|div/0!|ref!|name\?|null!)", re.IGNORECASE)
_VOID = re.compile(
    r"|[-+]?nan(?:\(\w*\))?|-?1\.#\w+|bad|void|null|none|nil|masked|invalid|n/?a|#n/?a|#\w+[!?/]\w*!?|-+|–|—|\*+|\?+|_+",
    re.IGNORECASE,
)
_GROUPED = re.compile(r"[1-9]\d{0,2}(?:,\d{3})+(?!\d)")
_INFINITY = re.compile(r"[-+]?inf(?:inity)?", re.IGNORECASE)
_COMMENT = ("#", "%", "//", "!")
_REMOVE = "remove that line, or begin it with '#'"
# lines that may state a unit are read behind a '#', and lost where they are removed
_MARK = "begin it with '#' if it is no row of heights"
_WRITE_NAN = "write NaN for a sample that was not measured: a row that is removed shifts the rest"
_CUT = "the file may be cut short: copy or export it again"
# Nanoscope's text export has one line such as "Height(nm)"
_QUANTITY_NAME = re.compile(r"[\"']?([A-Za-z][\w ]*?)\s*[(\[]\s*([^)\]\d]{1,3})\s*[)\]][\"']?")
_AXIS_NAME = re.compile(r"\W*([xyz])\b[^(\[]*(?:[(\[]\s*([^)\]]*)\s*[)\]])?\W*", re.IGNORECASE)
# largest deviation of evenly spaced axis labels from their mean step
_EVEN = 1e-3
# typical deviation of heights beside such labels, in their mean step
_UNEVEN = 0.1


@dataclass(frozen=True)
class _Content:
    """A text file's header lines, the names above its columns, and its rows of numbers with their line numbers."""

    header: list[str]
    names: list[str]
    rows: list[str]
    numbers: list[int]
    separator: str | None
    decimal_comma: bool


def read(path: Path, channel: str | None) -> Scan:
    """Reads a matrix, a flat list with the image's width and height in the header, or x y z triples.

    Matrices and lists are flipped, because their first row is the top. NaN, Bad, ---, empty cells and the like are
    holes. Raises InputError for anything but numbers, for rows of different lengths, and for a single column or row
    without a width.
    """
    content = _split(path, _decode(path))
    table = _table(path, content)
    table, steps, labels = _without_labels(content, table)
    _refuse_axis(path, table)
    triples = table.shape[1] == 3 and table.shape[0] > 3
    warnings: tuple[str, ...] = ()
    header = understand(path.name, content.header, triples)
    if header.no_data is not None:
        table[table == header.no_data] = np.nan
    form = f"text with a header{labels}" if content.header or content.names else f"text{labels}"
    if triples:
        header = _with_names(header, content.names)
        # Gwyddion separates by tabs
        grid = xyz.grid(path.name, table, header.gwyddion_triples or content.separator == "\t")
        heights, header, warnings = grid.heights, replace(header, steps=grid.steps), grid.warnings
        form += ", x y z triples with y " + ("downwards, as Gwyddion writes them" if grid.y_down else "upwards")
    else:
        heights = np.ascontiguousarray(_matrix(path, header, table)[::-1])
        header = replace(header, steps=header.steps or steps)
    check_shape(path.name, heights.shape)
    name = header.channel or "data"
    pick_channel(path.name, [name], channel)
    pitch, relative = _pitch(header, heights.shape, triples)
    return Scan(
        heights,
        header.um_per_unit,
        pitch,
        None,
        name,
        (name,),
        form,
        library_version("numpy"),
        steps=relative,
        unread=header.unread,
        warnings=warnings,
    )


# --- bytes and lines ---------------------------------------------------------------------------------


def _decode(path: Path) -> str:
    data = path.read_bytes()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    if (encoding := utf16_without_mark(data[:4096])) is not None:
        return data.decode(encoding, errors="replace")
    if b"\0" in data:
        found = f"binary data behind a text header ({one_line(data[:40].decode('latin-1').split(chr(0))[0], 40)!r})"
        raise fault(path.name, "a text file of numbers", found, "export the height channel as .npy, text or .gwy")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # instruments on Windows write the micro sign in one byte
        return data.decode("latin-1")


def utf16_without_mark(head: bytes) -> str | None:
    """Returns the encoding of UTF-16 text that lacks a byte order mark; None for anything else."""
    for encoding, high in (("utf-16-le", head[1::2]), ("utf-16-be", head[::2])):
        low = head[::2] if encoding == "utf-16-le" else head[1::2]
        if len(head) >= 16 and high.count(0) > 0.9 * len(high) and 0 not in low:
            return encoding
    return None


def _split(path: Path, content: str) -> _Content:
    """Separates the header from the rows of numbers. Raises InputError for a line that is neither."""
    # typographic programs write the sign of mathematics
    lines = keyence.translated(path.name, content.replace("\u2212", "-").splitlines())
    separator, decimal_comma = _separator(path, lines)
    usual = _typical_row(lines).count("\t")
    found = _Content([], [], [], [], separator, decimal_comma)
    second = None
    for number, line in enumerate(lines, start=1):
        stripped = line.strip()
        if not stripped:
            # a row of nothing but separators is a row that was not measured
            if separator == "\t" and line.count("\t") == usual:
                found.rows.append(line)
                found.numbers.append(number)
            continue
        if stripped.startswith(_COMMENT) and not _EXCEL_ERROR.match(stripped):
            if not found.rows:
                found.header.append(line)
            elif second is None and _key(line) and _key(line) in map(_key, found.header):
                second = number
            continue
        if second is not None:
            raise fault(path.name, "one table", f"another header in line {second}", "keep the table of heights alone")
        if _is_plain(stripped) or _is_row(line, separator, bool(found.rows)):
            found.rows.append(line)
            found.numbers.append(number)
        else:
            _take_header_line(path, found, line, number)
    if not found.rows:
        raise fault(path.name, "a matrix of heights", "no numbers", "export the height data again")
    return found


def _key(line: str) -> str:
    """Returns the key of a `key: value` line; an empty text for any other."""
    return re.split("[:=]", line)[0].strip(" #%;/!").casefold() if re.search("[:=]", line) else ""


def _take_header_line(path: Path, content: _Content, line: str, number: int) -> None:
    """Adds a line above the numbers to the header or to the names of columns; refuses any other line."""
    stripped = line.strip()
    cells = _cells(line, content.separator)
    odd = [(i, cell) for i, cell in enumerate(cells, start=1) if not _is_cell(cell)]
    if content.rows:
        if len(odd) == len(cells) or len(cells) == 1:
            raise fault(path.name, "numbers", f"{one_line(stripped, 40)!r} in line {number}", _REMOVE)
        column, cell = odd[0]
        found = f"{one_line(cell, 40)!r} in column {column} of line {number}"
        raise fault(path.name, "numbers", found, _WRITE_NAN)
    if re.match(r"[^:=]+[:=]", stripped) or re.fullmatch(r"[A-Za-z_]+\s+[-+.\deE]+", stripped):
        content.header.append(line)
    elif _is_entry(filled := [cell for cell in cells if cell]):
        content.header.append(f"{filled[0]}: {filled[1]}")
    elif match := _QUANTITY_NAME.fullmatch(stripped):
        content.header.extend((f"Channel: {match[1]}", f"Value units: {match[2]}"))
    elif _names_columns(cells, content.separator):
        content.names[:] = cells
    elif re.fullmatch(r"\W+|\[[^\]]*\]", stripped):
        return
    else:
        way_out = _MARK if re.search(r"\d", stripped) or may_state_scale(stripped) else _REMOVE
        raise fault(path.name, "numbers", f"{one_line(stripped, 40)!r} in line {number}", way_out)


def _is_entry(cells: list[str]) -> bool:
    """Says whether a line above the numbers is a key and its value in two cells."""
    if len(cells) != 2 or _is_cell(cells[0]):
        return False
    return re.match(_NUMBER, cells[1]) is not None or micrometres(cells[1]) is not None


def _names_columns(cells: list[str], separator: str | None) -> bool:
    """Says whether a line names columns: several words between separators, or x y z."""
    if len(cells) < 2 or any(_NUMBER.fullmatch(cell) for cell in cells):
        return False
    return separator is not None or [cell[0].casefold() for cell in cells if cell[:1].isalpha()][:3] == [
        "x",
        "y",
        "z",
    ]


# --- cells -------------------------------------------------------------------------------------------


def _separator(path: Path, lines: list[str]) -> tuple[str | None, bool]:
    """Returns what separates the numbers (None: white space), and whether a comma is the decimal point."""
    row = _typical_row(lines)
    if ";" in row:
        return ";", True
    if "\t" in row:
        # a tab that only indents, or follows a row, separates nothing
        inner = row.strip().split("\t")
        blanks = any(len(cell.split()) > 1 for cell in inner)
        return (None, True) if blanks or len(inner) == 1 else ("\t", True)
    if "," not in row:
        return None, False
    if re.search(r"\d,\d", row) and re.search(r"\d\s+[-+.\d]", row):
        # '1,5 2,5' is two numbers to some and three to others
        found = f"both in {one_line(row, 40)!r}"
        raise fault(path.name, "numbers separated by commas or by blanks", found, "write decimal points")
    return ",", False


def _typical_row(lines: list[str]) -> str:
    """Returns the line with the most numbers among the first and the middle rows."""
    middle = len(lines) // 2
    looked_at = [*lines[:100], *lines[middle : middle + 20]]
    plain = [line for line in looked_at if not line.lstrip().startswith(_COMMENT)]
    return max(plain, key=lambda line: len(re.findall(r"(?<![\w.])[-+]?[\d.]", line)), default="")


def _cells(line: str, separator: str | None) -> list[str]:
    cells = line.split() if separator is None else line.strip("\r\n").split(separator)
    return [cell.strip().strip("\"'").strip() for cell in cells]


def _is_plain(row: str) -> bool:
    return _PLAIN.issuperset(row) and re.search(r"\d", row) is not None and _LONE_SIGN.search(row) is None


def _has_empty_cell(row: str, separator: str | None) -> bool:
    if separator is None:
        return False
    row = row.strip(" \r\n")
    return (
        row.startswith(separator)
        or row.endswith(separator)
        or re.search(rf"{separator} *{separator}", row) is not None
    )


def _is_cell(cell: str) -> bool:
    return any(form.fullmatch(cell) for form in (_NUMBER, _VOID, _INFINITY))


def _is_row(line: str, separator: str | None, below_rows: bool) -> bool:
    """Says whether all cells are numbers or marks of a missing one, with at least one number above the first row."""
    cells = _cells(line, separator)
    if not all(_is_cell(cell) for cell in cells):
        return False
    if any(_NUMBER.fullmatch(cell) for cell in cells):
        return True
    return len(cells) > 1 and (below_rows or any(re.search(r"\w", cell) for cell in cells))


def _table(path: Path, content: _Content) -> NDArray[np.float64]:
    """Converts the rows to numbers (rows, columns), NaN for marks of missing ones."""
    rows, separator = content.rows, content.separator
    if separator is not None:
        rows = _without_outer_separators(rows, separator)
    rows = [
        row if _is_plain(row) and not _has_empty_cell(row, separator) else _with_nan(row, separator) for row in rows
    ]
    if content.decimal_comma:
        _refuse_thousands(path, rows, separator)
        rows = [row.replace(",", ".") for row in rows]
    try:
        table = np.loadtxt(rows, dtype=np.float64, delimiter=separator, comments=None, ndmin=2)
    except ValueError as error:
        raise _uneven(path, content, rows, str(error)) from None
    return table


def _refuse_thousands(path: Path, rows: list[str], separator: str | None) -> None:
    """Refuses integers with commas between thousands, which would be taken for decimal points.

    Decimals are printed with equally many digits; here all numbers without a comma are integers below 1000.
    """
    with_comma = re.search(_GROUPED, next((row for row in rows if "," in row), ""))
    if with_comma is None:
        return
    looked_at = rows[:: len(rows) // 200 + 1]
    cells = [cell.lstrip("+-") for row in looked_at for cell in _cells(row, separator) if not _VOID.fullmatch(cell)]
    plain = [cell for cell in cells if "," not in cell]
    others = [cell for cell in cells if "," in cell]
    if not plain or not all(cell.isdecimal() and len(cell) <= 3 for cell in plain):
        return
    if others and all(_GROUPED.fullmatch(cell) for cell in others):
        found = f"{with_comma[0]!r} beside integers such as {plain[0]!r}, which may be thousands or decimals"
        raise fault(path.name, "numbers", found, "export them without separators of thousands")


def _without_outer_separators(rows: list[str], separator: str) -> list[str]:
    """Removes the separator that every row begins or ends with; a single row's is an empty cell."""
    rows = [row.strip(" \r\n") for row in rows]
    if all(row.endswith(separator) for row in rows):
        rows = [row[:-1] for row in rows]
    if all(row.startswith(separator) for row in rows):
        rows = [row[1:] for row in rows]
    return rows


def _with_nan(row: str, separator: str | None) -> str:
    cells = ["nan" if _VOID.fullmatch(cell) else re.sub("[dD]", "e", cell) for cell in _cells(row, separator)]
    return (separator or " ").join(cells)


def _uneven(path: Path, content: _Content, rows: list[str], cause: str) -> Exception:
    """Returns the error for rows that NumPy cannot read, which are mostly of different lengths."""
    lengths = [len(_cells(row, content.separator)) for row in rows]
    usual = max(set(lengths), key=lengths.count) if len(set(lengths)) > 1 else lengths[0]
    odd = next((i for i, length in enumerate(lengths) if length != usual), None)
    if odd is None:
        grouped = next((cell for row in rows for cell in _cells(row, content.separator) if cell.count(".") > 1), None)
        if content.decimal_comma and grouped is not None:
            found = f"{one_line(grouped, 30)!r} where a comma is the decimal point"
            return fault(path.name, "numbers", found, "export them without separators of thousands")
        return fault(path.name, "rows of numbers", one_line(cause, 80), _WRITE_NAN)
    found = f"{lengths[odd]} in line {content.numbers[odd]} where others have {usual}"
    way_out = {0: _MARK, len(rows) - 1: _CUT}.get(odd, _WRITE_NAN)
    return fault(path.name, "rows of equally many numbers", f"{found} (the number of columns changed)", way_out)


# --- labels of rows and columns ----------------------------------------------------------------------


def _without_labels(
    content: _Content, table: NDArray[np.float64]
) -> tuple[NDArray[np.float64], tuple[float, float] | None, str]:
    """Removes an index row and column, or the axes x and y above and left of the heights.

    Returns the heights, the steps of the axes in their unit (None for an index), and words on what was removed.
    """
    if min(table.shape) < 4:
        return table, None, ""
    row, column = table[0, 1:], table[1:, 0]
    corner = bool(np.isnan(table[0, 0]))
    if corner and _even(row) and _even(column):
        heights = table[1:, 1:]
        if _counts_up(row) and _counts_up(column):
            return heights, None, ", without its index row and column"
        return heights, (abs(float(row[1] - row[0])), abs(float(column[1] - column[0]))), ", without its axes"
    cells = [_cells(line, content.separator)[0] for line in content.rows]
    indexed = all(cell.isdecimal() for cell in cells) and _counts_up(table[:, 0])
    others = table[:, 1:][np.isfinite(table[:, 1:])]
    named = (bool(content.names) and content.names[0] == "") or len(content.names) == table.shape[1] - 1
    if indexed and (named or bool((others != np.round(others)).any())):
        return table[:, 1:], None, ", without its index column"
    first = _cells(content.rows[0], content.separator)
    below = table[1:][np.isfinite(table[1:])]
    if all(cell.isdecimal() for cell in first) and _counts_up(table[0]) and bool((below != np.round(below)).any()):
        return table[1:], None, ", without its index row"
    return table, None, ""


def _refuse_axis(path: Path, table: NDArray[np.float64]) -> None:
    """Refuses a row or column at an edge that is evenly spaced where those beside it are not: an axis."""
    if min(table.shape) < MIN_SAMPLES:
        return
    for lines, word in ((table.T, "column"), (table, "row")):
        for name, edge, beside in (("first", lines[0], lines[1]), ("last", lines[-1], lines[-2])):
            steps = np.diff(beside)[np.isfinite(np.diff(beside))]
            # a few specks of dust do not make heights uneven
            middle = float(np.median(steps)) if steps.size else 0.0
            if steps.size and np.median(np.abs(steps - middle)) > _UNEVEN * abs(middle) and _even(edge):
                found = f"a {name} {word} that goes evenly from {edge[0]:.6g} to {edge[-1]:.6g}, like an axis"
                raise fault(path.name, "heights alone", found, f"remove that {word}")


def _even(labels: NDArray[np.float64]) -> bool:
    steps = np.diff(labels)
    mean = float(steps.mean())
    return bool(np.isfinite(labels).all()) and mean != 0 and bool((np.abs(steps - mean) <= _EVEN * abs(mean)).all())


def _counts_up(labels: NDArray[np.float64]) -> bool:
    return labels[0] in (0, 1) and bool((np.diff(labels) == 1).all())


# --- shape and units ---------------------------------------------------------------------------------


def _with_names(header: Header, names: list[str]) -> Header:
    """Adds the units that the names of three columns state, as in 'X (um)', 'Y (um)', 'Z [nm]'."""
    found = [_AXIS_NAME.fullmatch(name) for name in names]
    if [match[1].casefold() if match else None for match in found] != ["x", "y", "z"]:
        return header
    units = [micrometres(match[2] or "") if match else None for match in found]
    lateral = units[0] if units[0] == units[1] else None
    return replace(
        header,
        um_per_unit=header.um_per_unit if header.um_per_unit is not None else units[2],
        lateral_um=header.lateral_um if header.lateral_um is not None else lateral,
    )


def _matrix(path: Path, header: Header, table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the numbers in the shape of the image, top row first."""
    columns, rows = header.columns, header.rows
    if columns is None or rows is None:
        if table.shape[1] == 2:
            found = f"two columns of {table.shape[0]} numbers, as of a profile"
            raise fault(path.name, "a 2-D height map", found, "export the whole image")
        if 1 in table.shape:
            form = "row" if table.shape[0] == 1 else "column"
            raise fault(
                path.name,
                "a matrix, or a list with 'Image Width' and 'Image Height' in its header",
                f"a single {form} of {table.size} numbers and no width",
                "add these two lines, or export a matrix",
            )
        return table
    if table.size != rows * columns or (1 not in table.shape and table.shape != (rows, columns)):
        found = f"{table.shape[0]} x {table.shape[1]} numbers"
        raise fault(path.name, f"{rows} x {columns} numbers, as its header says", found, "export it again")
    return table.reshape(rows, columns)


def _pitch(
    header: Header, shape: tuple[int, ...], triples: bool
) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Computes the pitch along (x, y), um, or else the steps in a unit that the file does not state."""
    rows, columns = shape
    if triples and header.steps is not None:
        scale = header.lateral_um
        return (None, header.steps) if scale is None else ((header.steps[0] * scale, header.steps[1] * scale), None)
    if header.size_um is not None:
        return (header.size_um[0] / columns, header.size_um[1] / rows), None
    if header.pitch_um is not None:
        return header.pitch_um, None
    if header.size is not None and header.size != (columns, rows):
        return None, (header.size[0] / columns, header.size[1] / rows)
    return None, header.steps
