"""The records that the fold tells, as JSON: one of each shift when it is over, and one of each part when it has ended.

Times are ms since 1970; a shift names the time zone of its calendar. A record that comes again with the same `id` replaces the
one before: a part whose quality is told later.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

from processors.production.ratios import Sums, ratios
from processors.production.tally import Tally

VERSION = 1
BYTES_MAX = 8_000


def sums_of(tally: Tally) -> Sums:
    """Return what the ratios take of a tally."""
    return Sums(
        tally.has_calendar, tally.planned_s, tally.production_s, tally.unknown_s,
        tally.ideal_s, tally.judged_s, tally.made_s, tally.made, tally.good, tally.scrap,
    )  # fmt: skip


def shift_record(machine: str, tally: Tally, known_share_min: float, time_zone: str, *, is_over: bool) -> str:
    """Return the record of a shift; time_zone: that of the calendar."""
    found = ratios(sums_of(tally), known_share_min)
    document: dict[str, Any] = {
        "version": VERSION,
        "kind": "shift",
        "id": shift_id(machine, tally),
        "machine": machine,
        "shift": tally.shift,
        "begin": _ms(tally.begin_s),
        "end": _ms(tally.end_s),
        "time_zone": time_zone,
        "over": is_over,
        "calendar": tally.has_calendar,
        "planned_s": _rounded(tally.planned_s),
        "production_s": _rounded(tally.production_s),
        "setup_s": _rounded(tally.setup_s),
        "delay_s": _rounded(tally.delay_s),
        "down_s": _rounded(tally.down_s),
        "unknown_s": _rounded(tally.unknown_s),
        "beside_s": _rounded(tally.beside_s),
        "stops": {
            reason: {"kind": str(stop.kind), "s": _rounded(stop.seconds), "n": stop.count} for reason, stop in tally.stops.items()
        },
        "parts": tally.made,
        "good": tally.good,
        "scrap": tally.scrap,
        "ideal_s": _rounded(tally.ideal_s),
        "judged_s": _rounded(tally.judged_s),
        "made_s": _rounded(tally.made_s),
        "energy_kwh": _energy(tally.energy_kwh, tally.energy_s),
        "energy_s": _rounded(tally.energy_s),
        "ratios": {name: _share(ratio.value) for name, ratio in found.items()},
        "why": {name: ratio.why for name, ratio in found.items() if ratio.value is None},
    }
    text = _written(document)
    if len(text.encode()) > BYTES_MAX:  # reasons in an alphabet of four bytes each
        document["stops"] = {}
        document["why"] = {**document["why"], "stops": "left out: the reasons are too long"}
        text = _written(document)
    return text


def shift_id(machine: str, tally: Tally) -> str:
    """Return the id of a shift as it was looked at: the same whoever computes it from the same first look on."""
    text = f"{machine}\0{tally.shift}\0{_ms(tally.begin_s)}\0{_ms(tally.began_s)}"
    return "shift-" + hashlib.sha256(text.encode()).hexdigest()[:20]


def part_record(machine: str, part: Mapping[str, Any]) -> str:
    """Return the record of a part; `part` holds everything but what all records have. Its id is that of its as-built record."""
    return _written({"version": VERSION, "kind": "part", "machine": machine, **part})


def _written(document: Mapping[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def _ms(at_s: float) -> int:
    return round(at_s * 1000)


def _share(value: float | None) -> float | None:
    return None if value is None else round(value, 4)


def _rounded(value: float) -> float:
    return round(value, 1)


def _energy(kwh: float, seconds: float) -> float | None:
    return round(kwh, 4) if seconds > 0.0 and math.isfinite(kwh) else None
