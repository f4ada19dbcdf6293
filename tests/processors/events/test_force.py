"""The force of a part record: that of the cut, and never that of a spindle which speeds up or runs down."""

import json
import math
from typing import Any

import pytest

from cnctwin.standins.simulated_machine.description import description_text
from cnctwin.standins.simulated_machine.part import Moment, spare_part
from processors.actions import Publish
from processors.cutting_force import PROCESSOR as CUTTING_FORCE
from processors.description import Description, Role
from processors.events.processor import PROCESSOR
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from tests.processors.events.test_processor import state
from tests.processors.streams import birth, data, engine_of, event

FORCE = NodeId("cnc", "twin-cutting_force")
SHOWN = {"Srpm": "spindle_rpm", "Sload": "spindle_load_pct", "Tool_number": "tool_number"}


def rows_of(moments: tuple[Moment, ...], ramp_load_pct: float | None = None) -> list[tuple[float, dict[str, float]]]:
    """Return the control's display of a part: (s, what is new), with this load while the spindle changes its speed."""
    rows, before_rpm = [], 0.0
    for moment in moments:
        told = {name: float(text) for key, name in SHOWN.items() if (text := moment.values.get(key))}
        row: dict[str, float] = told | ({"tool_number": int(told["tool_number"])} if "tool_number" in told else {})
        rpm = row.get("spindle_rpm", before_rpm)
        if ramp_load_pct is not None and abs(rpm - before_rpm) > 0.02 * rpm:
            row["spindle_load_pct"] = ramp_load_pct
        before_rpm = rpm
        rows.append((moment.at_s, row))
    return [(at_s, row) for at_s, row in rows if row]


def as_of_old(rows: list[tuple[float, dict[str, float]]], description: Description) -> dict[int, float]:
    """Return the largest force by tool where power over speed is taken for the cut whatever the speed does."""
    spindle, tools = description.machine.spindle, description.machine.tools
    assert spindle is not None
    row: dict[str, float] = {"spindle_rpm": 0.0, "spindle_load_pct": 0.0, "tool_number": 1.0}
    largest: dict[int, float] = {}
    for _, news in rows:
        row |= news
        if row["spindle_rpm"] < 50.0:
            continue
        tool = int(row["tool_number"])
        power_kw = spindle.efficiency * (row["spindle_load_pct"] / 100 * spindle.rated_power_kw - spindle.idle_power_kw)
        force_n = 6e7 * max(power_kw, 0.0) / (math.pi * tools[str(tool)].diameter_mm * row["spindle_rpm"])
        largest[tool] = max(largest.get(tool, 0.0), force_n)
    return largest


def record_of(rows: list[tuple[float, dict[str, float]]], description: Description) -> dict[str, Any]:
    """The record of a part, by the force that the other processor publishes of it."""
    force, events = engine_of(CUTTING_FORCE), engine_of(PROCESSOR)
    force.describe("okuma", Role.LIVE, description)
    found: list[dict[str, Any]] = []

    def hear(one: HostEvent) -> None:
        for action in events.feed(one, 0.0):
            if isinstance(action, Publish):
                found.extend(json.loads(str(c.value)) for c in action.changes if c.name == "twin/part_record" and c.value)

    def both(one: HostEvent, at_s: float) -> None:
        hear(one)
        for action in force.feed(one, 0.0):
            if isinstance(action, Publish):
                readings = (Reading(c.name, c.value, c.timestamp_ms, c.quality, None, c.reason, False) for c in action.changes)
                hear(event(EventKind.DATA, at_s, *readings, node=FORCE))

    born = birth(0.0, exec_state="READY", program="O1701", spindle_rpm=0.0, spindle_load_pct=0.0, tool_number=1)
    hear(born)
    force.feed(born, 0.0)
    hear(birth(0.0, node=FORCE, **{"twin/cutting_force_n": None}))
    both(state(5.0, "ACTIVE"), 5.0)
    for at_s, news in rows:
        both(data(10.0 + at_s, **news), 10.0 + at_s)
    both(state(20.0 + rows[-1][0], "PROGRAM_COMPLETED"), 20.0 + rows[-1][0])
    (record,) = found
    return record


def largest_of(rows: list[tuple[float, dict[str, float]]], description: Description) -> dict[int, float]:
    record = record_of(rows, description)
    return {use["tool"]: use["force_n"]["max"] for use in record["tools"] if use["force_n"]}


def test_no_ramp_of_the_spindle_gets_into_a_part_record() -> None:
    """The part of the simulated machine: its spindle turns by itself at low speeds too, which was read as a force."""
    description, rows = Description.from_toml(description_text()), rows_of(spare_part().moments)
    assert as_of_old(rows, description) == pytest.approx({1: 298.0, 2: 15.5, 3: 118.9, 4: 207.1, 5: 70.1}, abs=0.1)
    assert largest_of(rows, description) == {1: 298.0, 2: 8.1, 3: 10.2, 4: 40.6, 5: 70.1}


def test_a_drive_at_its_limit_while_it_speeds_up_leaves_the_record_as_it_was() -> None:
    description, moments = Description.from_toml(description_text()), spare_part().moments
    rows = rows_of(moments, ramp_load_pct=150.0)
    assert min(as_of_old(rows, description).values()) > 30_000.0
    assert largest_of(rows, description) == largest_of(rows_of(moments), description)
