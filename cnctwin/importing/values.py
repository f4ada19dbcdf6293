"""Numbers, flags and texts of a run log out of what stands in a file. What cannot be read is no value, and is counted."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import cast

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from cnctwin.importing.column_map import ColumnOptions
from cnctwin.importing.dialects.layout import NULLS
from cnctwin.importing.run_columns import Kind, bounds_of, kind_of, unit_of
from cnctwin.importing.units import Conversion, conversion
from twin.vocabulary.signals import canonical

Values = NDArray[np.float64] | NDArray[np.object_]
TRUE_WORDS = ("1", "true", "on", "yes", "ein", "ja", "active", "1.0", "open")
FALSE_WORDS = ("0", "false", "off", "no", "aus", "nein", "inactive", "0.0", "closed")
_NUMBER = r"^-?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"


@dataclass(slots=True)
class Tally:
    """The values of one column: how many there are, how many could not be read or cannot be, and between which they lie."""

    values: int = 0
    faults: dict[str, int] = field(default_factory=dict)
    low: float = float("inf")
    high: float = float("-inf")
    example: str = ""

    def count(self, what: str, by: int) -> None:
        """Count values that were left out."""
        if by:
            self.faults[what] = self.faults.get(what, 0) + by


@dataclass(frozen=True, slots=True)
class Reader:
    """The conversion of a column of a file to one of a run log. decimal, nulls: as the file writes numbers and missing values."""

    column: str
    options: ColumnOptions
    convert: Conversion
    decimal: str = "."
    nulls: tuple[str, ...] = ()

    def read(self, told: pa.Array, tally: Tally) -> Values:
        """Return the values of some rows: numbers with NaN, or texts with None, where there is none."""
        kind = kind_of(self.column)
        if self.options.values:
            told = _mapped(told, self.options.values, tally)
        if kind is Kind.TEXT:
            return self._texts(told, tally)
        if kind is Kind.FLAG and not self.options.values:
            numbers = self._flags(told, tally)
        else:
            numbers = read_numbers(told, self.decimal, self.nulls, tally)
        return self.scaled(numbers, tally)

    def scaled(self, numbers: NDArray[np.float64], tally: Tally) -> NDArray[np.float64]:
        """Return numbers in the unit of the run log; what is beyond the bounds of the column is none."""
        numbers = (numbers * self.convert.scale + self.convert.offset) * self.options.scale + self.options.offset
        if bounds := bounds_of(self.column):
            beyond = (numbers < bounds[0]) | (numbers > bounds[1])
            tally.count(f"outside {bounds[0]:g} to {bounds[1]:g}, so no values", int(beyond.sum()))
            numbers[beyond] = np.nan
        finite = numbers[np.isfinite(numbers)]
        if len(finite):
            tally.values += len(finite)
            tally.low, tally.high = min(tally.low, float(finite.min())), max(tally.high, float(finite.max()))
        return numbers

    def _texts(self, told: pa.Array, tally: Tally) -> NDArray[np.object_]:
        texts = _as_text(told)
        words = (known.words if (known := canonical(self.column)) else None) or frozenset()
        absent = {*NULLS, *(word.lower() for word in self.nulls)}
        out = np.full(len(texts), None, dtype=object)
        odd = 0
        for at, text in enumerate(texts):
            if text is None or text.lower() in absent:
                continue
            if words and text not in words:
                odd, tally.example = odd + 1, tally.example or text
                continue
            out[at] = text
        tally.count(f"none of the words {', '.join(sorted(words))}; give `values` in the map", odd)
        tally.values += int(sum(value is not None for value in out))
        return out

    def _flags(self, told: pa.Array, tally: Tally) -> NDArray[np.float64]:
        if pa.types.is_boolean(told.type):
            return _floats(pc.cast(told, pa.float64()))
        true = {str(word).lower() for word in self.options.true} or set(TRUE_WORDS)
        false = {str(word).lower() for word in self.options.false} or (set(FALSE_WORDS) - true)
        absent = {*NULLS, *(word.lower() for word in self.nulls)} - true - false
        means = {**dict.fromkeys(false, 0.0), **dict.fromkeys(true, 1.0)}
        out = np.full(len(told), np.nan)
        odd = 0
        for at, text in enumerate(_as_text(told)):
            word = (text or "").lower()
            out[at] = means.get(word, np.nan)
            if word not in means and word not in absent:
                odd, tally.example = odd + 1, tally.example or word
        tally.count("neither true nor false; give `true` and `false` in the map", odd)
        return out


def reader(column: str, options: ColumnOptions, stated: str, decimal: str, nulls: tuple[str, ...]) -> Reader | None:
    """Return how a column is read; None where the unit that the file states has no conversion and the map gives none."""
    into, unit = unit_of(column), options.unit or stated
    if not into or not unit:
        return Reader(column, options, Conversion(1.0), decimal, nulls)
    convert = conversion(unit, into)
    if convert is None and options.unit is None and (options.scale, options.offset) != (1.0, 0.0):
        convert = Conversion(1.0)  # the map says how, whatever the file calls it
    return None if convert is None else Reader(column, options, convert, decimal, nulls)


def read_numbers(told: pa.Array, decimal: str, nulls: tuple[str, ...], tally: Tally) -> NDArray[np.float64]:
    """Return numbers, NaN where there is none. A text that is neither a number nor says that there is none is counted."""
    if not (pa.types.is_string(told.type) or pa.types.is_large_string(told.type)):
        if pa.types.is_boolean(told.type) or pa.types.is_integer(told.type) or pa.types.is_floating(told.type):
            return _floats(pc.cast(told, pa.float64(), safe=False))
        if pa.types.is_decimal(told.type):
            return _floats(pc.cast(told, pa.float64()))
        tally.count(f"no numbers ({told.type})", len(told) - told.null_count)
        return np.full(len(told), np.nan)
    texts = pc.utf8_ltrim(pc.utf8_trim_whitespace(told), "+")
    if decimal == ",":
        texts = pc.replace_substring(texts, ",", ".")
    try:
        return _floats(pc.cast(texts, pa.float64()))
    except pa.ArrowInvalid:
        pass
    is_number = pc.match_substring_regex(texts, _NUMBER)
    absent = pa.array([*NULLS, *(word.lower() for word in nulls)])
    is_absent = pc.or_kleene(pc.is_in(pc.utf8_lower(texts), absent), pc.is_null(texts))
    odd = pc.and_kleene(pc.invert(is_number), pc.invert(is_absent))
    count = int(pc.sum(odd).as_py() or 0)
    if count:
        tally.count("no numbers", count)
        tally.example = tally.example or str(told.filter(odd)[0].as_py())
    return _floats(pc.cast(pc.if_else(is_number, texts, None), pa.float64()))


def _floats(values: pa.Array) -> NDArray[np.float64]:
    """Return the numbers of an array as ones that may be changed; infinities are none."""
    numbers = np.array(values.to_numpy(zero_copy_only=False), dtype=np.float64)
    numbers[~np.isfinite(numbers)] = np.nan
    return numbers


def _as_text(told: pa.Array) -> list[str | None]:
    if pa.types.is_string(told.type) or pa.types.is_large_string(told.type):
        return cast("list[str | None]", pc.utf8_trim_whitespace(told).to_pylist())
    return [None if value is None else _plain(value) for value in told.to_pylist()]


def _plain(value: object) -> str:
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def _mapped(told: pa.Array, means: dict[str, str | int | float | bool], tally: Tally) -> pa.Array:
    """Put what the map says in place of what stands there; what it says nothing of is no value."""
    get: Callable[[str], str | int | float | bool | None] = means.get
    out: list[str | None] = []
    odd = 0
    for text in _as_text(told):
        found = None if text is None else get(text)
        if text and found is None and text.lower() not in NULLS:
            odd, tally.example = odd + 1, tally.example or text
        out.append(None if found is None else str(int(found)) if isinstance(found, bool) else str(found))
    tally.count("not among `values` of the map", odd)
    return pa.array(out, type=pa.string())
