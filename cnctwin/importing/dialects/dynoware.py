"""Text export of DynoWare (Kistler dynamometers): lines about the measurement, names, units, then rows.

`Sampling rate [Hz]:,10000` stands among the lines above; a file whose first column is no time has its rows at that rate. By the
description in docs/how-to/recording.md; no public specification was found.
"""

import re
from pathlib import Path

from cnctwin.errors import UsageError
from cnctwin.importing.column_map import FileOptions
from cnctwin.importing.dialects.contract import Content, Dialect, Head, Times
from cnctwin.importing.dialects.delimited import content
from cnctwin.importing.dialects.layout import layout

_RATE = re.compile(r"(?mi)^\W*Sampling rate \[Hz\]\W*[:,;\t]+\W*([\d.,]+)")


def rate_hz(text: str) -> float | None:
    """Return the sampling rate that the lines above state.

    >>> rate_hz("Sampling rate [Hz]:,10000"), rate_hz("Abtastrate"), rate_hz("Sampling rate [Hz]:;2500,5")
    (10000.0, None, 2500.5)
    """
    found = _RATE.search(text)
    try:
        return float(found[1].replace(",", ".")) if found else None
    except ValueError:
        return None


def _reads(path: Path, head: Head, options: FileOptions) -> Content:
    found = layout(head, options)
    if found is None:
        raise UsageError(f"{path}: has the head of a DynoWare file and no rows of numbers; export it again as text")
    has_time = any(column.name.lower() in {"time", "zeit"} for column in found.columns)
    hz = rate_hz(head.text)
    return content(path, options.encoding or head.encoding, found, Times() if has_time or not hz else Times(period_s=1.0 / hz))


DIALECT = Dialect(name="DynoWare text", recognises=lambda head: rate_hz(head.text[:20_000]) is not None, reads=_reads)
