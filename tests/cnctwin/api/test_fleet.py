"""The overview of a machine: what dates it."""

from cnctwin.api.fleet import newest_ms
from sparkplug.metric import Reading
from sparkplug.quality import Quality


def test_a_machine_is_as_old_as_its_newest_value_whoever_stamped_its_nulls() -> None:
    value = Reading("spindle_rpm", 3500.0, 1000, Quality.STALE, "rev/min", None, is_historical=False)
    null = Reading("tool_radius_mm", None, 9000, Quality.BAD, "mm", "unavailable", is_historical=False)
    assert newest_ms([value, null]) == 1000
    assert newest_ms([null]) is None
