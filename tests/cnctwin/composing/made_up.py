"""A made-up machine in a store: parts, tool changes, coolant, and a spindle that warms as its twin says, or is cooled better."""

from pathlib import Path
from typing import Any

import numpy as np

from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.standins.simulated_machine.description import TOLD
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants
from twin.machine import machine_from_toml

DAY_MS = 86_400_000
T0_MS = 1_790_000_000_000 // DAY_MS * DAY_MS + 6 * 3_600_000
"""Six o'clock of the first day."""
PART_S, PAUSE_S, FIRST_S = 180, 15, 120
DESCRIPTION = TOLD.read_text(encoding="utf-8")
Columns = dict[str, np.ndarray[Any, Any]]


def day(seed: int, seconds: int = 2700, *, coolant_gain: float = 0.0) -> Columns:
    """Return what the control shows every second of a day's work; the spindle stands in the last 1500 s of it."""
    chance = np.random.default_rng(seed)
    t_s = np.arange(seconds)
    columns: Columns = {name: np.zeros(seconds) for name in ("spindle_rpm", "spindle_load_pct", "feed_mm_min")}
    columns |= {name: np.zeros(seconds, dtype=bool) for name in ("coolant_on", "tool_change_active")}
    columns |= {"exec_state": np.full(seconds, "READY", dtype=object), "program": np.full(seconds, "O1701", dtype=object)}
    columns["nc_line"] = np.zeros(seconds, dtype=int)
    for at in range(FIRST_S, seconds - 1500, PART_S + PAUSE_S):
        here = slice(at, at + PART_S)
        columns["exec_state"][here] = "ACTIVE"
        columns["exec_state"][at + PART_S : at + PART_S + 2] = "PROGRAM_COMPLETED"
        columns["nc_line"][here] = np.arange(PART_S) // 4
        for first, last, rpm in ((5, 60, 3000.0), (70, 120, 8000.0), (130, 175, 12_000.0)):
            turning, cutting = slice(at + first, at + last), slice(at + first + 15, at + last - 10)
            columns["spindle_rpm"][turning] = rpm
            columns["spindle_load_pct"][turning] = 3.0 + rpm / 4000.0
            columns["spindle_load_pct"][cutting] += 20.0 + chance.normal(0.0, 2.0, last - first - 25)
            columns["feed_mm_min"][cutting] = 1200.0
            columns["coolant_on"][turning] = rpm > 5000.0
        for first in (62, 122):
            columns["tool_change_active"][at + first : at + first + 4] = True
    ambient = 21.5 + 0.5 * np.sin(t_s * np.pi / 1800.0)
    columns["spindle_load_pct"] = np.round(columns["spindle_load_pct"], 1)
    warming = Warming(t_s, columns["spindle_load_pct"], columns["spindle_rpm"], ambient, columns["coolant_on"])
    thermal = machine_from_toml(DESCRIPTION).thermal
    assert thermal is not None
    constants = thermal_constants(thermal) | {"coolant_cooling__gain": coolant_gain}
    shown = spindle_temperature_c(constants, warming, 21.5, effects=("coolant_cooling",))[0]
    columns["spindle_temp_c"] = np.round(shown + chance.normal(0.0, 0.03, seconds), 1)
    columns["ambient_temp_c"] = np.round(ambient, 1)
    return columns


def told_changes(columns: Columns, begin_ms: int, known: dict[str, Any]) -> list[Message]:
    """Return the messages of a control that reports what changes. known: what it said last; grows"""
    messages = []
    said = {name: values.tolist() for name, values in columns.items()}
    for n in range(len(columns["spindle_rpm"])):
        now = {name: values[n] for name, values in said.items()}
        news = {name: value for name, value in now.items() if name not in known or known[name] != value}
        if news:
            messages.append(message(news, begin_ms + 1000 * n, is_birth=not known))
        known |= news
    return messages


def message(values: dict[str, Any], t_ms: int, *, is_birth: bool = False, quality: Quality = Quality.GOOD) -> Message:
    """Return a message of the machine at a time of its control."""
    why = None if quality is Quality.GOOD else "UNAVAILABLE"
    readings = tuple(Reading(name, value, t_ms, quality, None, why, False) for name, value in values.items())
    kind = EventKind.BIRTH if is_birth else EventKind.DATA
    return Message(t_ms + 20, HostEvent(kind, NodeId("cnc", "edge-vmc"), "vmc", t_ms, readings))


def store_of_days(folder: Path, days: int, *, seconds: int = 2700, coolant_gain: float = 0.0) -> EmbeddedStore:
    """Return a store with so many days of the machine."""
    store = EmbeddedStore(folder, writable=True)
    known: dict[str, Any] = {}
    for number in range(days):
        store.append(told_changes(day(number, seconds, coolant_gain=coolant_gain), T0_MS + number * DAY_MS, known))
    return store
