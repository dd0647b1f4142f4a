"""Understands the header of a text file: sizes, counts, units and factors, in the words of several programs."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.surface.readers.common import fault, micrometres, one_line

Pair = tuple[float, float]

_COMMENT_MARKS = "#;%!/'\"* \t"
_KEY_VALUE = re.compile(r"([^:=]+)[:=](.*)")
_PAIRS = re.compile(r"\s*(?:[A-Za-z][\w-]*\s?=\s?[^\s=]+[\s,;]*){2,}")
_BRACKETS = re.compile(r"[(\[{]\s*(?:->|in|→)?\s*([^)\]}]*?)\s*[)\]}]")
# a count of samples with more digits is no count, and Python refuses to convert thousands of them
_MOST_DIGITS = 9
_NUMBER = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?"
_QUANTITY = re.compile(rf"({_NUMBER})\s*(.*)")
_TWO_QUANTITIES = re.compile(rf"({_NUMBER})\s*([^\d\s]*?)\s*(?:[x×*;]|\s)\s*({_NUMBER})\s*(\D*)")
_WORD_NUMBER = re.compile(rf"([A-Za-z_ ]+)\s+({_NUMBER})")
_PIXEL_UNITS = ("", "px", "pixel", "pixels", "pts", "points")
_PER_PIXEL = re.compile(r"\s*(?:/|per\s)\s*(?:px|pixels?|points?|samples?)$", re.IGNORECASE)
_PER_COUNT = re.compile(r"\s*(?:/|per\s)\s*(?:bits?|counts?|lsb|digits?|units?|grey levels?)$", re.IGNORECASE)

# keys in lower case, with '-' and '_' written as blanks
_ALONG = ("# size", "#size", "# length", "#length", "# range", "size #", "# scan size", "scan size #", "#real",
          "scan range #", "# scan range")  # fmt: skip
_WIDTH = ("width", "real width", "scan width", "field width", "fastscansize", *(k.replace("#", "x") for k in _ALONG))
_HEIGHT = ("height", "real height", "scan height", "field height", "slowscansize",
           *(k.replace("#", "y") for k in _ALONG))  # fmt: skip
_FIELD = ("scan size", "scansize", "field size", "scan range", "scan area", "field of view", "image size")
_PIXEL = ("pixel size", "pixelsize", "pixel spacing", "point spacing", "pitch", "step size", "cellsize", "xy step")
_STEP_X = ("scale x", "pixel width", "x step", "step x", "dx", "x pixel size", "pixel size x", "x spacing")
_STEP_Y = ("scale y", "pixel height", "y step", "step y", "dy", "y pixel size", "pixel size y", "y spacing")
_COLUMNS = ("image width", "x pixels", "pixels x", "ncols", "columns", "w", "nx", "xres", "x points")
_ROWS = ("image height", "y pixels", "pixels y", "nrows", "rows", "h", "ny", "yres", "y points")
_VALUE_UNIT = ("value units", "value unit", "z unit", "z units", "zunit", "data unit", "data units", "unit data",
               "height unit", "height units", "unit z")  # fmt: skip
_ANY_UNIT = ("unit", "units")
_LATERAL_UNIT = ("lateral units", "lateral unit", "xy unit", "xy units", "x unit", "x units", "xunit", "unit x",
                 "y unit", "y units", "yunit", "unit y")  # fmt: skip
_NAME = ("channel", "name")
_NO_DATA = ("nodata value", "no data value", "nodata", "void value", "missing value")
_NM_PER_COUNT = ("bit2nm",)
_FACTOR = re.compile(r"(?:height|z|data|value)\s*(?:conversion|scale|scaling|factor|calibration|multiplier)|nm/bit")
# keys that state neither a size nor a unit, though numbers follow them
_NEUTRAL = re.compile(
    r"\b(?:date|time|version|created|file|comment|operator|user|title|samples?\b|probe|tip\b|.*rate\b|.*speed|.*offset|"
    r".*center|.*corner|angle|rotation|temperature|humidity|serial|software|start of data|void pixels|bias|current|"
    r"instrument)",
    re.IGNORECASE,
)
_SCALE_WORDS = re.compile(
    r"unit|factor|scale|scaling|bit2|/bit|lsb|calib|conver|multipl|einheit|unit[éà]|unidad|faktor|facteur|fattore|"
    r"skal|échelle|escala|scala|единиц|單位|单位|単位",
    re.IGNORECASE,
)
_LENGTH = re.compile(r"\d\s*(?:[munpfµμ~]|Å|c)?(?:m|Å)\b(?!/s)|\b(?:[nupµμ]m|Å)\b")


@dataclass
class Header:
    """What a header states.

    channel: name. um_per_unit: micrometres per stored height. size_um, pitch_um: of the field and of a sample along
    (x, y), um. size, steps: the same in a unit that is not stated. columns, rows: numbers of samples. no_data: the
    number that marks a missing height. unread: lines with numbers or units that were not understood.
    """

    channel: str | None = None
    um_per_unit: float | None = None
    size_um: Pair | None = None
    pitch_um: Pair | None = None
    size: Pair | None = None
    steps: Pair | None = None
    columns: int | None = None
    rows: int | None = None
    no_data: float | None = None
    unread: tuple[str, ...] = ()
    gwyddion_triples: bool = False
    lateral_um: float | None = None


@dataclass
class _Entries:
    """Values by key, units in brackets behind the keys, the lines of the keys, and the keys already used."""

    values: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    lines: dict[str, str] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)

    def take(self, keys: Sequence[str]) -> tuple[str, str] | None:
        """Returns key and value of the first of these keys, and marks all of them as understood."""
        present = [key for key in keys if key in self.values]
        self.used.update(present)
        return (present[0], self.values[present[0]]) if present else None


def may_state_scale(line: str) -> bool:
    """Says whether a line that was not understood may state a unit, a factor or a length."""
    return _SCALE_WORDS.search(line) is not None or _LENGTH.search(line) is not None


def understand(file: str, lines: Sequence[str], triples: bool) -> Header:
    """Reads the lines above the numbers.

    file: its name, for messages. lines: the header. triples: whether x y z triples follow.
    Raises InputError where heights or the field have a unit that is no length.
    """
    entries = _entries(_translated(lines, triples))
    header = Header()
    name = entries.take(_NAME)
    header.channel = name[1] if name is not None and name[1] else None
    header.columns, header.rows = _count(entries, _COLUMNS), _count(entries, _ROWS)
    spip = "bit2nm" in entries.values or entries.values.get("file format", "").casefold() == "ascii"
    lateral = entries.take(_LATERAL_UNIT)
    header.lateral_um = micrometres(lateral[1]) if lateral is not None else 1e-3 if spip else None
    header.gwyddion_triples = triples and lateral is not None and "lateral units" in entries.values
    header.um_per_unit = _value_unit(file, entries)
    _sizes(file, entries, header)
    missing = entries.take(_NO_DATA)
    quantity = _QUANTITY.fullmatch(missing[1]) if missing is not None else None
    header.no_data = _float(quantity[1]) if quantity is not None else None
    header.unread = _unread(entries, lines)
    return header


def _translated(lines: Sequence[str], triples: bool) -> list[str]:
    """Gives Gwyddion's header its English keys. A localised Gwyddion translates them, in the same order."""
    texts = [line.strip().lstrip("#").strip().replace("：", ":") for line in lines if line.strip().startswith("#")]
    values = [match[2].strip() if (match := _KEY_VALUE.fullmatch(text)) else None for text in texts]
    keys: tuple[str, ...]
    if triples:
        keys = ("Channel", "Lateral units", "Value units")
        fits = len(values) >= 3 and all(micrometres(value or "") is not None for value in values[1:3])
    else:
        keys = ("Channel", "Width", "Height", "Value units")
        fits = len(values) >= 4 and all(_is_length(value or "") for value in values[1:3])
        fits = fits and values[3] is not None and not re.match(r"\d", values[3])
    if not fits or None in values[: len(keys)]:
        return list(lines)
    return [f"{key}: {value}" for key, value in zip(keys, values, strict=False)] + texts[len(keys) :]


def _is_length(value: str) -> bool:
    quantity = _QUANTITY.fullmatch(value)
    return quantity is not None and micrometres(quantity[2]) is not None


def _entries(lines: Sequence[str]) -> _Entries:
    entries = _Entries()
    for line in lines:
        text = line.strip().strip(_COMMENT_MARKS).replace("：", ":")
        if _PAIRS.fullmatch(text):
            found = re.findall(r"([A-Za-z][\w-]*)\s?=\s?([^\s=,;]+)", text)
        elif match := (_KEY_VALUE.match(text) or _WORD_NUMBER.fullmatch(text)):
            found = [(match[1], match[2])]
        else:
            continue
        for key, value in found:
            _enter(entries, key, value, line)
    return entries


def _enter(entries: _Entries, key: str, value: str, line: str) -> None:
    unit = _BRACKETS.search(key)
    if unit is not None:
        key = key[: unit.start()] + key[unit.end() :]
    key = " ".join(re.sub(r"[-_]", " ", key).casefold().split())
    if key and key not in entries.values:
        entries.values[key] = value.strip().strip("\"'").strip()
        entries.lines[key] = line.strip()
        if unit is not None:
            entries.units[key] = unit[1]


def _count(entries: _Entries, keys: Sequence[str]) -> int | None:
    for key in keys:
        value = entries.values.get(key, "")
        number = value.split()[0] if value and value.split()[-1].casefold() in (*_PIXEL_UNITS, value) else ""
        if number.isdecimal() and len(number) <= _MOST_DIGITS and int(number) > 0:
            entries.used.add(key)
            return int(number)
    return None


def _value_unit(file: str, entries: _Entries) -> float | None:
    """Returns micrometres per stored height, from a unit or from a factor; None where neither is understood."""
    taken = entries.take(_VALUE_UNIT)
    unit = taken[1] if taken is not None else ""
    factor = _factor(entries)
    scale = micrometres(unit)
    if factor is not None:
        key, um = factor
        if key in _NM_PER_COUNT and unit and scale is None:
            # SPIP writes this factor for other quantities than heights, too
            raise fault(file, "heights in a unit of length", f"values in {unit!r}", "export the height channel")
        # a factor beside a unit of length says nothing new where it is 1, and is ambiguous where it is not
        if scale is None or abs(um - scale) <= 1e-6 * scale:
            entries.used.add(key)
            return um
        if taken is not None:
            entries.used.discard(taken[0])
        return None
    if unit and scale is None:
        raise fault(file, "heights in a unit of length", f"values in {unit!r}", "export the height channel")
    if scale is None:
        general = next((key for key in _ANY_UNIT if key in entries.values), None)
        scale = micrometres(entries.values[general]) if general is not None else None
        if general is not None and scale is not None:
            entries.used.add(general)
    return scale


def _factor(entries: _Entries) -> tuple[str, float] | None:
    """Returns the key of a factor and micrometres per count, where the factor states its unit."""
    for key, value in entries.values.items():
        quantity = _QUANTITY.fullmatch(value)
        if quantity is None or not (key in _NM_PER_COUNT or _FACTOR.search(key)):
            continue
        unit = _PER_COUNT.sub("", quantity[2]) or entries.units.get(key, "")
        scale = 1e-3 if key in _NM_PER_COUNT or "nm/bit" in key else micrometres(_PER_COUNT.sub("", unit))
        if scale is not None:
            return key, _float(quantity[1]) * scale
    return None


def _sizes(file: str, entries: _Entries, header: Header) -> None:
    """Enters the sizes of the field and of a sample, with or without their unit."""
    header.size_um, header.size = _pair_of(file, entries, header, _WIDTH, _HEIGHT, _FIELD)
    header.pitch_um, header.steps = _pair_of(file, entries, header, _STEP_X, _STEP_Y, _PIXEL)


def _pair_of(
    file: str, entries: _Entries, header: Header, keys_x: Sequence[str], keys_y: Sequence[str], both: Sequence[str]
) -> tuple[Pair | None, Pair | None]:
    """Returns a length along (x, y) in um, or in a unit that is not stated."""
    x, y = _length(file, entries, header, keys_x), _length(file, entries, header, keys_y)
    if x is None or y is None:
        x, y = _two_lengths(entries, header, both)
    if x is None or y is None or min(x[0], y[0]) <= 0:
        return None, None
    if x[1] is None or y[1] is None:
        return None, ((x[0], y[0]) if x[1] == y[1] else None)
    return (x[0] * x[1], y[0] * y[1]), None


Length = tuple[float, float | None]


def _length(file: str, entries: _Entries, header: Header, keys: Sequence[str]) -> Length | None:
    for key in keys:
        quantity = _QUANTITY.fullmatch(entries.values.get(key, ""))
        if quantity is None:
            continue
        unit = _PER_PIXEL.sub("", quantity[2]).strip() or entries.units.get(key, "")
        entries.used.add(key)
        if unit.casefold() in _PIXEL_UNITS and unit:
            continue
        scale = header.lateral_um if not unit else micrometres(unit)
        if unit and scale is None:
            value = entries.values[key]
            raise fault(file, "a field in a unit of length", f"'{key}: {value}'", "correct the header")
        return _float(quantity[1]), scale
    return None


def _two_lengths(entries: _Entries, header: Header, keys: Sequence[str]) -> tuple[Length | None, Length | None]:
    """Reads '10 x 5 um', '10 um x 5 um', or one length for both axes."""
    for key in keys:
        value = _PER_PIXEL.sub("", entries.values.get(key, ""))
        two, one = _TWO_QUANTITIES.fullmatch(value), _QUANTITY.fullmatch(value)
        if two is not None:
            numbers, units = (two[1], two[3]), (two[2] or two[4], two[4] or two[2])
        elif one is not None:
            numbers, units = (one[1], one[1]), (one[2], one[2])
        else:
            continue
        stated = [unit.strip() or entries.units.get(key, "") for unit in units]
        scales = [micrometres(unit) if unit else header.lateral_um for unit in stated]
        if any(unit and scale is None for unit, scale in zip(stated, scales, strict=True)):
            continue
        entries.used.add(key)
        return (_float(numbers[0]), scales[0]), (_float(numbers[1]), scales[1])
    return None, None


def _float(number: str) -> float:
    return float(number.replace(",", "."))


def _unread(entries: _Entries, lines: Sequence[str]) -> tuple[str, ...]:
    """Lists lines with numbers or units that nothing above has used; dates and the like are left out."""
    unused = [line for key, line in entries.lines.items() if key not in entries.used and not _NEUTRAL.search(key)]
    keyed = {line.strip() for line in entries.lines.values()}
    translated = {line.strip().lstrip("#").strip() for line in entries.lines.values()}
    for line in lines:
        stripped = line.strip()
        known = stripped in keyed or stripped.lstrip("#").strip() in translated
        if not known and not _KEY_VALUE.match(stripped) and not _NEUTRAL.search(stripped):
            unused.append(stripped)
    return tuple(one_line(line, 80) for line in unused if re.search(r"\d", line) or may_state_scale(line))
