"""A simple device model for a recording that came without one: one data item for each key that occurs.

Names that controls commonly use get their MTConnect type; everything else becomes an event of type VARIABLE. Units are
only stated where the name leaves no doubt (percent, rev/min): lengths and feeds may be metric or inch.
"""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from cnctwin.standins.mtconnect_agent.errors import RecordingError
from cnctwin.standins.mtconnect_agent.shdr import CONDITION_LEVELS, CONDITION_WIDTH, Command, Line, Unusable
from cnctwin.standins.mtconnect_agent.xml_text import attributes

KEYS_MAX = 5_000


class Known(NamedTuple):
    """The meaning of a key of this name."""

    pattern: re.Pattern[str]
    category: str
    type: str
    sub_type: str = ""
    units: str = ""


def _known(pattern: str, category: str, item_type: str, sub_type: str = "", units: str = "") -> Known:
    return Known(re.compile(pattern, re.IGNORECASE), category, item_type, sub_type, units)


KNOWN = (
    _known(r"avail", "EVENT", "AVAILABILITY"),
    _known(r"e_?stop(_state)?", "EVENT", "EMERGENCY_STOP"),
    _known(r"p?execution|program_status", "EVENT", "EXECUTION"),
    _known(r"p?mode|controller_mode", "EVENT", "CONTROLLER_MODE"),
    _known(r"p?program(_name(_running)?)?", "EVENT", "PROGRAM"),
    _known(r"program_name_editing", "EVENT", "PROGRAM_EDIT_NAME"),
    _known(r"(p\d?)?block", "EVENT", "BLOCK"),
    _known(r"line|(p\d?)?block_?number|(p\d?)?linenumber", "EVENT", "LINE"),
    _known(r"tool_?number|(p\d?)?current_?tool|tool_?id", "EVENT", "TOOL_NUMBER"),
    _known(r"p?part_?count(act)?", "EVENT", "PART_COUNT"),
    _known(r"p?fovr|feed_?override", "EVENT", "PATH_FEEDRATE_OVERRIDE", "PROGRAMMED", "PERCENT"),
    _known(r"f?rapid_?(override|ovr)|frapidovr", "EVENT", "PATH_FEEDRATE_OVERRIDE", "RAPID", "PERCENT"),
    _known(r"s\d?ovr|spindle_?override", "EVENT", "ROTARY_VELOCITY_OVERRIDE", "", "PERCENT"),
    _known(r"s\d?(rpm|speed)|spindle_?speed", "SAMPLE", "ROTARY_VELOCITY", "ACTUAL", "REVOLUTION/MINUTE"),
    _known(r"s\d?cmd", "SAMPLE", "ROTARY_VELOCITY", "PROGRAMMED", "REVOLUTION/MINUTE"),
    _known(r"[a-z]{1,2}\d?_?load|spindle_?load", "SAMPLE", "LOAD", "", "PERCENT"),
    _known(r"s\d?temp", "SAMPLE", "TEMPERATURE"),
    _known(r"(p\d?)?fact|feed_?rate", "SAMPLE", "PATH_FEEDRATE", "ACTUAL"),
    _known(r"[xyzuvw]\w?\d?(abs|act[mw]?|pos(ition)?)", "SAMPLE", "POSITION", "ACTUAL"),
    _known(r"[abc]\d?(deg|act[mw]?|pos(ition)?)", "SAMPLE", "ANGLE", "ACTUAL"),
)


def draft_device_model(device_name: str, lines: Iterable[Line | Command | Unusable]) -> str:
    """Write a Devices.xml for the keys of a recording."""
    categories = dict(_keys(lines))
    if not categories:
        raise RecordingError("no usable line in the recording, so no key to draft a device model from")
    items = [_item(device_name, key, is_condition) for key, is_condition in categories.items()]
    device = attributes({"id": "d1", "name": device_name, "uuid": device_name})
    body = "".join(f"\n        {item}" for item in items)
    return (
        f"<MTConnectDevices><Devices>\n  <Device{device}>\n"
        f"    <DataItems>{body}\n    </DataItems>\n  </Device>\n</Devices></MTConnectDevices>\n"
    )


def _keys(lines: Iterable[Line | Command | Unusable]) -> Iterator[tuple[str, bool]]:
    """Yield each key once, and whether it is a condition: five values, the first of them a condition's level."""
    seen: set[str] = set()
    for line in lines:
        if not isinstance(line, Line) or line.fields[0].startswith("@"):
            continue
        fields = line.fields
        is_condition = len(fields) == 1 + CONDITION_WIDTH and fields[1].upper() in CONDITION_LEVELS
        for key in fields[:1] if is_condition else fields[::2]:
            if key.strip() and key not in seen:
                seen.add(key)
                yield key.strip(), is_condition
        if len(seen) > KEYS_MAX:
            raise RecordingError(f"more than {KEYS_MAX} different keys; is this a recording of one machine?")


def _item(device_name: str, key: str, is_condition: bool) -> str:
    shown = {"id": f"{device_name}_{re.sub(r'[^A-Za-z0-9_.-]', '_', key)}", "name": key}
    if is_condition:
        return f"<DataItem{attributes(shown | {'category': 'CONDITION', 'type': 'SYSTEM'})}/>"
    known = next((k for k in KNOWN if k.pattern.fullmatch(key)), None)
    if known is None:
        return f"<DataItem{attributes(shown | {'category': 'EVENT', 'type': 'VARIABLE'})}/>"
    shown |= {"category": known.category, "type": known.type}
    if known.sub_type:
        shown["subType"] = known.sub_type
    if known.units:
        shown |= {"units": known.units, "nativeUnits": known.units}
    return f"<DataItem{attributes(shown)}/>"
