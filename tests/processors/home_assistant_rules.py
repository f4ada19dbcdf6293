"""The rules by which Home Assistant takes or refuses a device's announcement, as far as ours can break them.

Read in Home Assistant 2026.11.0 (the package `homeassistant` on PyPI): components/mqtt/discovery.py (TOPIC_MATCHER),
components/mqtt/schemas.py (DEVICE_DISCOVERY_SCHEMA), components/mqtt/sensor.py and binary_sensor.py (DISCOVERY_SCHEMA),
components/sensor/const.py (DEVICE_CLASS_UNITS, DEVICE_CLASS_STATE_CLASSES), components/binary_sensor/const.py.
"""

import re
from typing import Any

TOPIC = re.compile(r"homeassistant/(?P<component>\w+)/(?:(?P<node>[a-zA-Z0-9_-]+)/)?(?P<object>[a-zA-Z0-9_-]+)/config")
UNITS = {
    "current": {"μA", "mA", "A"},
    "distance": {"mm", "cm", "m", "km", "in", "ft", "yd", "mi", "nmi"},
    "duration": {"d", "h", "min", "s", "ms", "μs"},
    "power": {"mW", "W", "kW", "MW", "GW", "TW"},
    "speed": {
        *("Beaufort", "ft/s", "in/s", "m/min", "m/s", "km/h", "kn", "mph", "mm/s"),
        *("in/d", "in/h", "mm/d", "mm/h"),
    },
    "temperature": {"°C", "°F", "K"},
}
"""The device classes of sensors that we use; each may be a `measurement`."""
FLAGS = {"problem"}
REQUIRED = {"platform", "unique_id", "name", "state_topic", "value_template", "availability"}
OF_SENSORS = {"unit_of_measurement", "device_class", "state_class", "entity_category"}
OF_BINARY_SENSORS = {"device_class", "entity_category"}


def check(topic: str, payload: Any) -> dict[str, dict[str, Any]]:
    """Hold an announcement against the rules; its components, without those that are removed."""
    found = TOPIC.fullmatch(topic)
    assert found is not None
    assert found["component"] == "device"
    assert set(payload) == {"device", "origin", "components"}
    assert payload["device"]["identifiers"]
    assert payload["origin"]["name"]
    shown = {name: one for name, one in payload["components"].items() if set(one) != {"platform"}}
    assert len({one["unique_id"] for one in shown.values()}) == len(shown)
    for one in payload["components"].values():
        assert one["platform"] in ("sensor", "binary_sensor")
    for one in shown.values():
        _check(one)
    return shown


def _check(one: dict[str, Any]) -> None:
    is_sensor = one["platform"] == "sensor"
    assert set(one) >= REQUIRED
    assert set(one) <= REQUIRED | (OF_SENSORS if is_sensor else OF_BINARY_SENSORS)
    assert one.get("entity_category") in (None, "diagnostic")
    assert one.get("state_class") in (None, "measurement")
    for topic in (one["state_topic"], *(watched["topic"] for watched in one["availability"])):
        assert not set("+#\0") & set(topic)
    if (device_class := one.get("device_class")) is None:
        return
    if is_sensor:
        assert one["unit_of_measurement"] in UNITS[device_class]
    else:
        assert device_class in FLAGS
