"""A table of figures as CSV (RFC 4180): one line of names, times in UTC as ISO 8601, an empty field where there is no figure."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from cnctwin.figures.table import By

_SUMS = (
    "planned_s", "production_s", "setup_s", "delay_s", "down_s", "unknown_s", "beside_s", "parts", "good", "scrap",
    "ideal_s", "judged_s", "availability", "performance", "quality", "oee", "energy_kwh", "energy_a_part_kwh", "stops",
)  # fmt: skip
COLUMNS: Mapping[By, tuple[str, ...]] = {
    By.MACHINE: ("machine", "begin", "end", "shifts", *_SUMS),
    By.SHIFT: ("machine", "shift", "begin", "end", "over", *_SUMS),
    By.PART: (
        "machine", "id", "program", "shift", "begin", "end", "complete", "ideal_s", "active_s", "interrupted_s", "unknown_s",
        "performance", "energy_kwh", "quality",
    ),
    By.PROGRAM: (
        "machine", "program", "parts", "good", "scrap", "ideal_s", "active_s", "performance", "energy_a_part_kwh", "energy_kwh",
    ),
}  # fmt: skip
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def to_csv(rows: Sequence[Mapping[str, Any]], by: By) -> str:
    """Return the rows as CSV. A text that a spreadsheet would run as a formula gets an apostrophe in front.

    >>> to_csv([{"machine": "vmc", "program": "=1+1", "parts": 2, "performance": None}], By.PROGRAM).splitlines()[1]
    "vmc,'=1+1,2,,,,,,,"
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerow(COLUMNS[by])
    for row in rows:
        writer.writerow([_cell(name, row.get(name)) for name in COLUMNS[by]])
    return out.getvalue()


def _cell(name: str, value: Any) -> Any:
    if value is None:
        return ""
    if name in ("begin", "end"):
        return datetime.fromtimestamp(value / 1000, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return json.dumps({reason: stop["s"] for reason, stop in value.items()}, ensure_ascii=False)
    if isinstance(value, str) and value.startswith(_FORMULA):
        return f"'{value}"
    return value
