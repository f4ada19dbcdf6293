"""Tables of production figures by machine, shift, part or program, out of the records of shifts and parts.

A shift has its times from its own record and its parts from theirs, so that a quality that is told late is in. What a process
that began again in mid-shift did not see is unknown.
"""

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from typing import Any, NamedTuple

from cnctwin.figures.documents import PartTold, ShiftTold
from processors.production.ratios import KNOWN_SHARE_MIN, Sums, ratios

ELEMENTS = ("production_s", "setup_s", "delay_s", "down_s")
_SUMMED = (
    "planned_s", *ELEMENTS, "unknown_s", "beside_s", "energy_s",
    "parts", "good", "scrap", "made_s", "judged_s", "ideal_s", "parts_kwh", "metered",
)  # fmt: skip
UNKNOWN_KIND, NO_DATA = "unknown", "no data"


class By(StrEnum):
    """The rows of a table."""

    MACHINE = "machine"
    SHIFT = "shift"
    PART = "part"
    PROGRAM = "program"


class Asked(NamedTuple):
    """A question for figures: of shifts that begin, and parts that end, in [from_ms, to_ms)."""

    by: By
    from_ms: int
    to_ms: int
    known_share_min: float = KNOWN_SHARE_MIN


Row = dict[str, Any]


def time_zone_of(shifts: Iterable[ShiftTold]) -> str:
    """Return the time zone of the calendar that these shifts name; UTC where they name none, or several."""
    named = {one.time_zone for one in shifts if one.time_zone is not None}
    return named.pop() if len(named) == 1 else "UTC"


def table(shifts: Sequence[ShiftTold], parts: Sequence[PartTold], asked: Asked) -> list[Row]:
    """Return the rows."""
    if asked.by in (By.PART, By.PROGRAM):
        within = [one for one in parts if asked.from_ms <= one.end < asked.to_ms]
        return [_part(one) for one in within] if asked.by is By.PART else _programs(within)
    shifts = [one for one in shifts if asked.from_ms <= one.begin < asked.to_ms]
    of_shift: dict[tuple[str, int], list[PartTold]] = {}
    for part in parts:
        of_shift.setdefault((part.machine, part.shift_begin), []).append(part)
    groups: dict[tuple[Any, ...], list[ShiftTold]] = {}
    for one in shifts:
        groups.setdefault((one.machine, one.begin, one.shift), []).append(one)
    rows = [_shift(found, of_shift.get((found[0].machine, found[0].begin), ()), asked) for found in groups.values()]
    if asked.by is By.SHIFT:
        return [_public(row) for row in rows]
    machines: dict[str, list[Row]] = {}
    for row in rows:
        machines.setdefault(row["machine"], []).append(row)
    return [_public(_machine(machine, own, asked)) for machine, own in machines.items()]


def _shift(told: Sequence[ShiftTold], parts: Sequence[PartTold], asked: Asked) -> Row:
    """Return one shift. Several records of it are of processes that began again: what one saw, another did not."""
    planned_s = max(one.planned_s for one in told)
    times = {name: sum(getattr(one, name) for one in told) for name in (*ELEMENTS, "beside_s")}
    has_calendar = any(one.calendar for one in told)
    if has_calendar:
        times["unknown_s"] = max(planned_s - sum(times[name] for name in ELEMENTS), 0.0)
    else:
        times["unknown_s"] = sum(one.unknown_s for one in told)
    stops = _stops(told, times["unknown_s"])
    first = told[0]
    head: Row = {"machine": first.machine, "shift": first.shift, "begin": first.begin, "end": first.end}
    energy_s = sum(one.energy_s for one in told)
    energy_kwh = sum(one.energy_kwh or 0.0 for one in told) if energy_s > 0.0 else None
    head |= {"over": all(one.over for one in told), "planned_s": planned_s, **times, "stops": stops}
    return _judged(head | {"energy_kwh": energy_kwh, "energy_s": energy_s, "calendar": has_calendar} | _made(parts), asked)


def _stops(told: Iterable[ShiftTold], unknown_s: float) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for one in told:
        for reason, stop in one.stops.items():
            if stop.kind == UNKNOWN_KIND:
                continue
            known = found.setdefault(reason, {"kind": stop.kind, "s": 0.0, "n": 0})
            known["s"], known["n"] = round(known["s"] + stop.s, 1), known["n"] + stop.n
    if unknown_s > 0.0:
        found[NO_DATA] = {"kind": UNKNOWN_KIND, "s": round(unknown_s, 1), "n": 1}
    return dict(sorted(found.items(), key=lambda pair: -pair[1]["s"]))


def _made(parts: Sequence[PartTold]) -> Row:
    """Return the sums of parts."""
    whole = [one for one in parts if one.complete]
    judged = [one for one in whole if one.ideal_s is not None]
    metered = [one for one in parts if one.energy_kwh is not None]
    return {
        "parts": len(parts),
        "good": sum(one.quality == "good" for one in parts),
        "scrap": sum(one.quality == "scrap" for one in parts),
        "made_s": sum(one.active_s for one in whole),
        "judged_s": sum(one.active_s for one in judged),
        "ideal_s": sum(one.ideal_s or 0.0 for one in judged),
        "parts_kwh": sum(one.energy_kwh or 0.0 for one in metered),
        "metered": len(metered),
    }


def _machine(machine: str, rows: Sequence[Row], asked: Asked) -> Row:
    """Return the sums of a machine over its shifts; over what is outside all shifts only where it has none, or as `beside_s`."""
    beside_s = sum(row["beside_s"] for row in rows)
    rows = [row for row in rows if row["planned_s"] > 0.0] or rows
    head: Row = {"machine": machine, "shifts": len(rows), "begin": rows[0]["begin"], "end": max(row["end"] for row in rows)}
    head |= {name: sum(row[name] for row in rows) for name in _SUMMED} | {"beside_s": beside_s}
    metered = [row["energy_kwh"] for row in rows if row["energy_kwh"] is not None]
    stops: dict[str, dict[str, Any]] = {}
    for row in rows:
        for reason, stop in row["stops"].items():
            known = stops.setdefault(reason, {"kind": stop["kind"], "s": 0.0, "n": 0})
            known["s"], known["n"] = round(known["s"] + stop["s"], 1), known["n"] + stop["n"]
    head["stops"] = dict(sorted(stops.items(), key=lambda pair: -pair[1]["s"]))
    head |= {"energy_kwh": sum(metered) if metered else None, "calendar": any(row["calendar"] for row in rows)}
    return _judged(head, asked)


def _judged(row: Row, asked: Asked) -> Row:
    """Return the row with its ratios, and the reasons of those that are null."""
    sums = Sums(
        row["calendar"], row["planned_s"], row["production_s"], row["unknown_s"],
        row["ideal_s"], row["judged_s"], row["made_s"], row["parts"], row["good"], row["scrap"],
    )  # fmt: skip
    found = ratios(sums, asked.known_share_min)
    shares = {name: None if ratio.value is None else round(ratio.value, 4) for name, ratio in found.items()}
    mean_kwh = round(row["parts_kwh"] / row["metered"], 5) if row["metered"] else None
    return (
        row | shares | {"energy_a_part_kwh": mean_kwh, "why": {name: one.why for name, one in found.items() if one.value is None}}
    )


def _public(row: Row) -> Row:
    left_out = {"made_s", "parts_kwh", "metered"}
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items() if name not in left_out}


def _part(one: PartTold) -> Row:
    row: Row = one.model_dump(exclude={"kind"})
    is_judged = one.complete and one.ideal_s is not None and one.active_s > 0.0
    row["performance"] = round((one.ideal_s or 0.0) / one.active_s, 4) if is_judged else None
    return row


def _programs(parts: Sequence[PartTold]) -> list[Row]:
    """Return a row for each program of each machine."""
    groups: dict[tuple[str, str | None], list[PartTold]] = {}
    for one in parts:
        groups.setdefault((one.machine, one.program), []).append(one)
    rows: list[Row] = []
    for (machine, program), own in sorted(groups.items(), key=lambda pair: (pair[0][0], pair[0][1] or "")):
        made: Mapping[str, Any] = _made(own)
        whole = sum(one.complete for one in own)
        ideals = [one.ideal_s for one in own if one.ideal_s is not None]
        rows.append(
            {
                "machine": machine,
                "program": program,
                "parts": len(own),
                "good": made["good"],
                "scrap": made["scrap"],
                "ideal_s": round(ideals[-1], 1) if ideals else None,
                "active_s": round(made["made_s"] / whole, 1) if whole else None,
                "performance": round(made["ideal_s"] / made["judged_s"], 4) if made["judged_s"] > 0.0 else None,
                "energy_a_part_kwh": round(made["parts_kwh"] / made["metered"], 5) if made["metered"] else None,
                "energy_kwh": round(made["parts_kwh"], 4) if made["metered"] else None,
            }
        )
    return rows
