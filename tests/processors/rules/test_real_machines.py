"""The rules on days of real machines: where no fault is known, none is found."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from processors.actions import DeadLetter
from processors.rules.processor import PROCESSOR
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from tests.processors.rules.test_processor import alarms
from tests.processors.streams import EDGE, engine_of, fed
from tests.recordings import recording

OKUMA = {"S1speed": "spindle_rpm", "S1load": "spindle_load_pct", "p1Fact": "feed_mm_min", "pexecution": "exec_state"}
OKUMA_MILL = {"S6speed": "spindle_rpm", "S6load": "spindle_load_pct", "p1Fact": "feed_mm_min", "pexecution": "exec_state"}
MAZAK = {"Srpm": "spindle_rpm", "Sload": "spindle_load_pct", "Fact": "feed_mm_min", "execution": "exec_state"}
MAZAK_1 = MAZAK | {"Stemp": "spindle_temp_c"}
MAZAK_2 = {name.replace("S", "S2"): signal for name, signal in MAZAK_1.items()}


def replayed(path: Path, keys: Mapping[str, str], since: str) -> list[HostEvent]:
    """A recording as an edge would send it, one message a line, from the day `since` on."""
    events: list[HostEvent] = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        stamp, *rest = line.split("|")
        if stamp < since:
            continue
        try:
            at_ms = round(datetime.fromisoformat(stamp[:26].removesuffix("Z") + "+00:00").timestamp() * 1000)
        except ValueError:
            continue
        found = [_recorded(keys[key], text, at_ms) for key, text in zip(rest[::2], rest[1::2], strict=False) if key in keys]
        if found:
            events.append(HostEvent(EventKind.DATA, EDGE, "okuma", at_ms, tuple(found)))
    nothing = [Reading(name, None, events[0].timestamp_ms, Quality.BAD, None, "UNAVAILABLE", False) for name in keys.values()]
    return [HostEvent(EventKind.BIRTH, EDGE, "okuma", events[0].timestamp_ms, tuple(nothing)), *events]


def _recorded(name: str, text: str, at_ms: int) -> Reading:
    value: Any = text
    if name != "exec_state" or text == "UNAVAILABLE":
        try:
            value = float(text)
        except ValueError:
            return Reading(name, None, at_ms, Quality.BAD, None, "UNAVAILABLE", False)
    return Reading(name, value, at_ms, Quality.GOOD, None, None, False)


# What is recorded, from when on, and the loads over the limit and without feed that naive rules would have told.
DAYS = [
    ("mtconnect/okuma.txt", OKUMA, "2022", 6, 9),
    ("mtconnect/okuma.txt", OKUMA_MILL, "2022", 0, 1),
    ("nist/raw/Mazak01-20180718-20180719.txt", MAZAK_1, "2018-07-18", 1, 3),
    ("nist/raw/Mazak01-20180718-20180719.txt", MAZAK_2, "2018-07-18", 0, 1),
    ("nist/raw/Mazak03-20170629-20170630.txt", MAZAK_2, "2017-06-29", 0, 2),
]
NAIVE = {"load_dwell_s": 0.0, "no_feed_dwell_s": 0.0, "ramp_rpm_per_s": 1e6}


@pytest.mark.parametrize(("name", "keys", "since"), [day[:3] for day in DAYS])
def test_days_of_real_machines_on_which_no_fault_is_known_are_silent(name: str, keys: dict[str, str], since: str) -> None:
    """Spin-up peaks of 120 to 176 %, tool changes, sensors that drop to 0, a spindle that warms by 9 K in a minute."""
    actions = fed(engine_of(PROCESSOR), *replayed(recording(name), keys, since))
    assert not any(isinstance(action, DeadLetter) for action in actions)
    assert sum(alarms(actions).values()) == 0


@pytest.mark.parametrize(("name", "keys", "since", "over", "idle"), DAYS)
def test_without_dwell_and_without_regard_to_ramps_each_of_them_would_have_alarmed(
    name: str, keys: dict[str, str], since: str, over: int, idle: int
) -> None:
    """So that the silence above is not that of rules which see nothing."""
    actions = fed(engine_of(PROCESSOR, **NAIVE), *replayed(recording(name), keys, since))
    found = {name: count for name, count in alarms(actions).items() if count}
    assert found == {name: count for name, count in (("load_over_limit", over), ("load_without_feed", idle)) if count}
