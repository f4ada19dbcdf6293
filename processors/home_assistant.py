"""The announcement of a machine to Home Assistant: MQTT discovery, one device with an entity for each signal.

    homeassistant/device/cnctwin/<machine>/config    retained JSON; an empty one removes the device

Home Assistant then reads the mirror's own topics. Documented at https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery
(device discovery); tests/processors/home_assistant_rules.py has the rules that payloads are checked by.
"""

import json
import re
from collections.abc import Iterator, Mapping
from hashlib import sha256
from typing import Any, NamedTuple

from processors.outputs import declared_outputs, kind_of_signal
from processors.plain_topic import topic_level, topic_path
from sparkplug.metric import Reading
from twin.vocabulary import topics, twin_signals
from twin.vocabulary.signals import PLC_PREFIX, VARIABLE_PREFIX, Kind, canonical

PREFIX = topics.HOME_ASSISTANT
SENSOR, BINARY_SENSOR = "sensor", "binary_sensor"
STATE_MAX = 255  # characters; a longer state is refused
VALUE = "{{ value_json.value if value_json.quality != 'bad' else none }}"
TEXT = f"{{{{ none if value_json.quality == 'bad' else (value_json.value | string)[:{STATE_MAX}] }}}}"
FLAG = "{{ none if value_json.value is none or value_json.quality == 'bad' else ('ON' if value_json.value else 'OFF') }}"
AVAILABLE = "{{ 'offline' if value_json.quality == 'stale' else 'online' }}"
"""A null is unknown (that is what `none` becomes), and what is stale is unavailable."""
UNITS: Mapping[str, tuple[str, str | None]] = {
    "°C": ("°C", "temperature"),
    "kW": ("kW", "power"),
    "A": ("A", "current"),
    "mm": ("mm", "distance"),
    "mm/s": ("mm/s", "speed"),
    "s": ("s", "duration"),
    "rev/min": ("rpm", None),
    "deg": ("°", None),
}
"""Unit → that of Home Assistant, with the device class that goes with it. All others are shown as they are, without a class: a K
is a difference here, which the class `temperature` would turn into °C, and mm/min is no unit of the class `speed`."""
DOCUMENTS = frozenset(
    {
        twin_signals.ANOMALY_VERDICTS,
        twin_signals.ANOMALY_WHY,
        twin_signals.CUT_RECORD,
        twin_signals.PRODUCTION,
        twin_signals.PRODUCTION_NOW,
        twin_signals.RULE_FINDINGS,
        twin_signals.CONTROL_ALARM_FINDINGS,
        twin_signals.STOPS,
        "alarms",
        "alarm_history",
        twin_signals.PART_RECORD,
        twin_signals.TOOL_LIVES,
    }
)
"""Signals that are JSON texts: nothing that a state could show."""
_DIAGNOSTIC = re.compile(r"clock_offset.*|stamp_clock|.*_(basis|source|evidence|reason|window|since|confidence)")
_PLAIN_NAME = re.compile(r"[a-zA-Z0-9_]+(/[a-zA-Z0-9_]+)*")
_OF_TYPE = {bool: Kind.FLAG, int: Kind.INTEGER, float: Kind.NUMBER, str: Kind.TEXT}


class Entity(NamedTuple):
    """One signal as an entity."""

    name: str
    kind: Kind
    unit: str | None

    @property
    def platform(self) -> str:
        """Return the platform that shows it."""
        return BINARY_SENSOR if self.kind is Kind.FLAG else SENSOR

    @property
    def component(self) -> str:
        """Return its platform and its id within the device, as the mirror's state keeps it."""
        return f"{self.platform} {identifier(self.name)}"

    @property
    def is_diagnostic(self) -> bool:
        """Return True if it says how a figure came about, and is none itself."""
        return _DIAGNOSTIC.fullmatch(self.name) is not None

    def config(self, machine: str) -> dict[str, Any]:
        """Return its configuration."""
        topic = f"{topics.MIRROR}{topic_level(machine)}/{topic_path(self.name)}"
        said: dict[str, Any] = {
            "platform": self.platform,
            "unique_id": f"cnctwin_{identifier(machine)}_{identifier(self.name)}",
            "name": self.name.replace("_", " ").replace("/", " "),
            "state_topic": topic,
            "availability": [{"topic": topic, "value_template": AVAILABLE}],
            **self._of_kind(),
        }
        return said | {"entity_category": "diagnostic"} if self.is_diagnostic else said

    def _of_kind(self) -> dict[str, Any]:
        if self.kind is Kind.FLAG:
            output = declared_outputs().get(self.name)
            is_alarm = output is not None and output.is_alarm
            return {"value_template": FLAG} | ({"device_class": "problem"} if is_alarm else {})
        if self.kind is Kind.TEXT:
            return {"value_template": TEXT}
        said: dict[str, Any] = {"value_template": VALUE}
        if self.unit:
            unit, device_class = UNITS.get(self.unit, (self.unit, None))
            said["unit_of_measurement"] = unit
            if device_class is not None:
                said["device_class"] = device_class
        return said | {"state_class": "measurement"} if self.kind is Kind.NUMBER else said


def entities(row: Mapping[str, Reading]) -> list[Entity]:
    """Return the signals of a machine that can be entities, those that a person looks for first in front."""
    return sorted(_entities(row), key=lambda one: (one.is_diagnostic, canonical(one.name) is None, one.name))


def topic_of(machine: str) -> str:
    """Return the topic on which a machine is announced.

    >>> topic_of("vmc"), topic_of("cell 4/mill")
    ('homeassistant/device/cnctwin/vmc/config', 'homeassistant/device/cnctwin/cell_4_mill--82bd84ae/config')
    """
    return f"{PREFIX}{identifier(machine)}/config"


def announcement(machine: str, shown: list[Entity], left_out: int, removed: list[str]) -> bytes:
    """Return the announcement of a machine. `removed` has the components of an earlier one that are none any more."""
    name = identifier(machine)
    model = "CNC machine tool" + (f", {len(shown)} of {len(shown) + left_out} signals" if left_out else "")
    return json.dumps(
        {
            "device": {"identifiers": [f"cnctwin_{name}"], "name": machine, "model": model},
            "origin": {"name": "cnctwin"},
            "components": {component: {"platform": platform} for platform, component in map(str.split, removed)}
            | {identifier(one.name): one.config(machine) for one in shown},
        },
        ensure_ascii=False,
        separators=(",", ":"),
    ).encode("utf-8", "replace")


def identifier(name: str) -> str:
    """Return a name of letters, digits, _ and - that no other name gives: what else is in it becomes _, and a hash follows.

    >>> identifier("spindle_rpm"), identifier("twin/spindle_temp_c"), identifier("Fräse 3")
    ('spindle_rpm', 'twin-spindle_temp_c', 'Fr_se_3--b729e782')
    """
    if len(name) <= 100 and _PLAIN_NAME.fullmatch(name):
        return name.replace("/", "-")
    digest = sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{re.sub('[^a-zA-Z0-9]', '_', name[:60])}--{digest}"


def _entities(row: Mapping[str, Reading]) -> Iterator[Entity]:
    for name, reading in row.items():
        is_chosen = name.startswith((PLC_PREFIX, VARIABLE_PREFIX))  # by configuration, which may make a flag of it
        kind = _kind_of_chosen(reading) if is_chosen else kind_of_signal(name) or _OF_TYPE.get(type(reading.value))
        if kind is not None and name not in DOCUMENTS and twin_signals.live_name(name) is None:
            yield Entity(name, kind, reading.unit)


def _kind_of_chosen(reading: Reading) -> Kind:
    """Return the kind by the value. A null has a number's where it has a unit, else a text's, until a birth shows a value."""
    if reading.value is None:
        return Kind.NUMBER if reading.unit else Kind.TEXT
    return _OF_TYPE.get(type(reading.value), Kind.TEXT)
