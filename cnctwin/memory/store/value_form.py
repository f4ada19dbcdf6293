"""The form of a value in SQLite: as it is where SQLite keeps it exactly, else as bytes or JSON; each kind has its own series.

SQLite makes NaN a null, knows no whole numbers beyond 64 bits and no arrays. Arrays are little-endian: one letter that says how
wide an element is, as `struct` names it, and the elements. Floats are four bytes wide where that loses nothing.
"""

import json
import math
import struct
from collections.abc import Callable
from enum import IntEnum
from typing import Any

from sparkplug.values import Value

INT_MAX = 2**63 - 1
Kept = int | float | str | bytes | None
"""A value that SQLite holds."""


class Kind(IntEnum):
    """The kind of the values of a series; a null is of the series NULL beside it."""

    NULL = 0
    FLOAT = 1
    INT = 2
    BOOL = 3
    TEXT = 4
    BIG = 5  # a whole number beyond 64 bits, as text
    BYTES = 6
    FLOATS = 7
    INTS = 8
    BOOLS = 9
    TEXTS = 10  # as JSON
    BIGS = 11  # whole numbers of which one is beyond 64 bits, as JSON


NUMBERS = frozenset({Kind.FLOAT, Kind.INT})
ARRAYS = frozenset({Kind.FLOATS, Kind.INTS, Kind.BOOLS})
PLAIN = frozenset({Kind.FLOAT, Kind.INT, Kind.BOOL, Kind.TEXT})
"""Kinds that Parquet gives back as they are."""
BLOCKS = ARRAYS | {Kind.BYTES}
"""Kinds that take much room, and are kept for days only."""


class CannotKeepError(ValueError):
    """A value of a type that the store does not know."""


def kept(value: Value) -> tuple[Kind, Kept]:
    """The kind of a value, and what SQLite is given. Raises CannotKeepError.

    >>> kept(1.5), kept(True), kept(2**64)
    ((<Kind.FLOAT: 1>, 1.5), (<Kind.BOOL: 3>, 1), (<Kind.BIG: 5>, '18446744073709551616'))
    >>> kept((1, 2, 300))[1]
    b'h\\x01\\x00\\x02\\x00,\\x01'
    """
    form = _FORMS.get(type(value))
    if form is None:
        raise CannotKeepError(type(value).__name__)
    return form(value)


def given(kind: Kind, value: Any) -> Value:
    """The value again, bit for bit.

    >>> given(*kept((0.5, -0.0))), given(*kept((True, False)))
    ((0.5, -0.0), (True, False))
    """
    back = _BACK.get(kind)
    return value if back is None else back(value)  # type: ignore[no-any-return]


def same(a: Value, b: Value) -> bool:
    """Return True if two values are the very same, type and bits.

    >>> same(1, True), same(0.0, -0.0), same(math.nan, math.nan), same((1.0,), (1.0,))
    (False, False, True, True)
    """
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, float) and isinstance(b, float):
        return a == b != 0.0 or struct.pack("<d", a) == struct.pack("<d", b)
    if isinstance(a, tuple):
        try:
            return kept(a) == kept(b)
        except CannotKeepError:
            return False
    return a == b


def _text(value: str) -> tuple[Kind, Kept]:
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise CannotKeepError("a text that is no Unicode") from error
    return Kind.TEXT, value


def _float(value: float) -> tuple[Kind, Kept]:
    return Kind.FLOAT, struct.pack("<d", value) if math.isnan(value) else value


def _int(value: int) -> tuple[Kind, Kept]:
    return (Kind.INT, value) if -INT_MAX <= value <= INT_MAX else (Kind.BIG, str(value))


def _tuple(value: tuple[Any, ...]) -> tuple[Kind, Kept]:
    types = set(map(type, value))
    if types == {float} or not types:
        return Kind.FLOATS, _floats(value)
    if types == {int}:
        return _ints(value)
    if types == {bool}:
        return Kind.BOOLS, b"?" + struct.pack(f"<{len(value)}?", *value)
    if types == {str}:
        return Kind.TEXTS, json.dumps(value)
    raise CannotKeepError("an array of " + ", ".join(sorted(t.__name__ for t in types)))


def _floats(value: tuple[float, ...]) -> bytes:
    double = struct.pack(f"<{len(value)}d", *value)
    try:
        single = struct.pack(f"<{len(value)}f", *value)
    except OverflowError:
        return b"d" + double
    return b"f" + single if struct.pack(f"<{len(value)}d", *struct.unpack(f"<{len(value)}f", single)) == double else b"d" + double


def _ints(value: tuple[int, ...]) -> tuple[Kind, Kept]:
    for letter in "bhiq":
        try:
            return Kind.INTS, letter.encode() + struct.pack(f"<{len(value)}{letter}", *value)
        except struct.error:
            continue
    return Kind.BIGS, json.dumps(value)


def _array(value: bytes) -> tuple[Any, ...]:
    letter = chr(value[0])
    return struct.unpack(f"<{(len(value) - 1) // struct.calcsize('<' + letter)}{letter}", value[1:])


def _float_back(value: Any) -> float:
    return value if isinstance(value, float) else float(struct.unpack("<d", value)[0])


_FORMS: dict[type, Callable[[Any], tuple[Kind, Kept]]] = {
    float: _float,
    int: _int,
    bool: lambda value: (Kind.BOOL, int(value)),
    str: _text,
    bytes: lambda value: (Kind.BYTES, value),
    tuple: _tuple,
    type(None): lambda _: (Kind.NULL, None),
}
_BACK: dict[Kind, Callable[[Any], Any]] = {
    Kind.FLOAT: _float_back,
    Kind.BOOL: bool,
    Kind.BIG: int,
    Kind.FLOATS: _array,
    Kind.INTS: _array,
    Kind.BOOLS: _array,
    Kind.TEXTS: lambda value: tuple(json.loads(value)),
    Kind.BIGS: lambda value: tuple(json.loads(value)),
}
