"""The as-built record of a part, JSON at the end of a program run for an MES or PLM (docs/reference/part_record.schema.json).

Each figure says where it comes from; what was missing stands in `reasons`, and `complete` is false where it concerns the run as a
whole: its beginning or its end was not seen, or the control was not heard for a share of it.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from processors.events.execution import OVERRIDES
from processors.events.run import BASES, FIGURES, FORCE, GAPS, OTHER_TOOLS, SCORE, TEMPERATURE, VIBRATION, Figure, Run, ToolUse
from processors.sample import Sample
from sparkplug.quality import Quality
from twin.vocabulary.twin_signals import TWIN_PREFIX

VERSION = 1
BYTES_MAX = 16_000
BASIS_MAX = 200
HOLES_SHARE_MAX = 0.01
PROVENANCE = {
    "cycle": "measured",
    "tools": "measured",
    "overrides": "measured",
    "temperature": "measured",
    "force": "inferred",
    "gap": "inferred",
    "alarms": "inferred",
    "score": "inferred",
}


def record(run: Run, sample: Sample, *, number: int, ended_by: str, is_end_seen: bool, ended_ms: int) -> str:
    """The record of a run that has ended, as JSON of at most BYTES_MAX bytes."""
    document = _document(run, sample, number=number, ended_by=ended_by, is_end_seen=is_end_seen, ended_ms=ended_ms)
    text = _written(document)
    if len(text.encode()) > BYTES_MAX:  # names of 80 characters in an alphabet of four bytes each
        document["temperature"] = _figure(run.figures.get(TEMPERATURE))
        document["alarms"] = document["alarms"][:5]
        document["reasons"] = [*document["reasons"], "cut to size"]
        document["twin"] = {}
        text = _written(document)
    return text


def part_id(machine: str, program: str | None, began_ms: int) -> str:
    """Return the id by which a receiver knows a record again: the same for a run of a machine, whoever computes it and when."""
    return "part-" + hashlib.sha256(f"{machine}\0{program}\0{began_ms}".encode()).hexdigest()[:20]


def _document(run: Run, sample: Sample, *, number: int, ended_by: str, is_end_seen: bool, ended_ms: int) -> dict[str, Any]:
    reasons = _missing(run, is_end_seen=is_end_seen)
    vibration = next((name for name in VIBRATION if name in run.figures), None)
    seconds = run.seconds
    return {
        "version": VERSION,
        "id": part_id(sample.machine, run.program, run.began_ms),
        "machine": sample.machine,
        "program": run.program,
        "part_number": number,
        "began": _utc(run.began_ms),
        "ended": _utc(ended_ms),
        "ended_by": ended_by,
        "complete": not reasons,
        "reasons": reasons + _absent(run),
        "cycle": {
            "cycle_time_s": _rounded(seconds) if run.is_begin_seen and is_end_seen else None,
            "active_s": _rounded(run.active_s),
            "interrupted_s": _rounded(run.interrupted_s),
            "unknown_s": _rounded(run.unknown_s),
            "interruptions": run.interruptions,
            "stops": {reason: _rounded(spent_s) for reason, spent_s in run.reasons.items()},
            "holes": run.holes,
            "unknown_share_pct": _rounded(100.0 * run.unknown_s / seconds) if seconds > 0.0 else 0.0,
        },
        "tools": [_tool(use) for use in run.tools],
        "tool_changes": run.tool_changes,
        "temperature": None if TEMPERATURE not in run.figures else _temperature(run),
        "vibration": None
        if vibration is None
        else {"signal": vibration, "unit": "mm/s", **(_figure(run.figures[vibration]) or {})},
        "gap": {name.removeprefix(TWIN_PREFIX): _gap(run.figures[name]) for name in GAPS if name in run.figures},
        "score": _figure(run.figures.get(SCORE)),
        "alarms": [{"flag": one.flag.removeprefix(TWIN_PREFIX), "at": _utc(one.at_ms)} for one in run.raised],
        "alarms_not_listed": run.raised_more,
        "overrides": {name: _figure(run.figures[name]) for name in OVERRIDES if name in run.figures},
        "twin": _bases(sample),
        "provenance": PROVENANCE | ({} if vibration is None else {"vibration": _whose(vibration)}),
    }


def _missing(run: Run, *, is_end_seen: bool) -> list[str]:
    """Why the record as a whole is not complete."""
    found = []
    if not run.is_begin_seen:
        found.append("its beginning was not seen")
    if not is_end_seen:
        found.append("its end was not seen")
    if run.unknown_s > HOLES_SHARE_MAX * run.seconds:
        found.append(f"the control was not heard for {run.unknown_s:.0f} s of it")
    if run.holes:
        found.append(f"messages were lost {run.holes} times")
    if run.program is None:
        found.append("the program is not known")
    return found


def _absent(run: Run) -> list[str]:
    """Return the figures that are missing."""
    wanted = {"spindle temperature": TEMPERATURE, "anomaly score": SCORE}
    absent = [f"no {what}" for what, name in wanted.items() if name not in run.figures]
    absent += [] if any(use.force is not None for use in run.tools) else ["no cutting force"]
    absent += [] if any(name in run.figures for name in VIBRATION) else ["no vibration"]
    absent += [] if any(name in run.figures for name in GAPS) else ["no gap"]
    return absent


def _tool(use: ToolUse) -> dict[str, Any]:
    number = "others" if use.number == OTHER_TOOLS else use.number
    return {"tool": number, "changes": use.changes, "active_s": _rounded(use.active_s), "force_n": _force(use.force)}


def _force(figure: Figure | None) -> dict[str, Any] | None:
    return None if figure is None else {"mean": _rounded(figure.mean), "max": _rounded(figure.high)}


def _figure(figure: Figure | None) -> dict[str, Any] | None:
    return None if figure is None else {name: _rounded(value) for name, value in _three(figure).items()}


def _three(figure: Figure) -> Mapping[str, float]:
    return {"min": figure.low, "max": figure.high, "mean": figure.mean}


def _gap(figure: Figure) -> dict[str, Any]:
    return {"mean": _rounded(figure.mean), "end": _rounded(figure.last)}


def _temperature(run: Run) -> dict[str, Any]:
    own = _figure(run.figures[TEMPERATURE]) or {}
    return {"signal": TEMPERATURE, "unit": "°C", **own, "every_s": run.profile_s, "profile": list(run.profile)}


def _bases(sample: Sample) -> dict[str, str]:
    found = {}
    for name in BASES:
        reading = sample.row.get(name)
        if reading is not None and reading.quality is Quality.GOOD and isinstance(reading.value, str):
            found[name.removeprefix(TWIN_PREFIX)] = reading.value[:BASIS_MAX]
    return found


def _whose(name: str) -> str:
    return "inferred" if name.startswith(TWIN_PREFIX) else "measured"


def _rounded(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None


def _utc(at_ms: int) -> str | None:
    try:
        return datetime.fromtimestamp(at_ms / 1000, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    except (OverflowError, ValueError, OSError):
        return None


def _written(document: Mapping[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


INPUTS = frozenset({FORCE, *FIGURES, *BASES})
