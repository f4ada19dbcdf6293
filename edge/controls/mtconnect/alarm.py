"""The signal `alarm`: the text of all active conditions of a device.

A condition is not one value but a set of activations by native code (MTConnect part 3): Fault and Warning add one, Normal without
a code clears all of its data item, Normal with a code that one, Unavailable clears all and says that nothing is known.

>>> alarms = observe((), "servo", "Fault", "414", "X AXIS DETECTION ERROR")
>>> text_of(alarms)
'FAULT 414 X AXIS DETECTION ERROR'
>>> text_of(observe(alarms, "servo", "Normal", "", ""))
''
"""

from typing import NamedTuple

ALARMS_MAX = 256
TEXT_LENGTH_MAX = 512


class Alarm(NamedTuple):
    """One activation, or (level UNAVAILABLE) a condition that the control does not report."""

    data_item_id: str
    level: str
    native_code: str
    text: str


def observe(alarms: tuple[Alarm, ...], data_item_id: str, level: str, native_code: str, text: str) -> tuple[Alarm, ...]:
    """The activations after one more observation; past the bound the oldest goes."""
    level = level.upper()
    clears_all = level == "UNAVAILABLE" or (level == "NORMAL" and not native_code)
    rest = tuple(
        a
        for a in alarms
        if a.data_item_id != data_item_id or (not clears_all and a.native_code != native_code and a.level != "UNAVAILABLE")
    )
    if level == "NORMAL":
        return rest
    return (*rest, Alarm(data_item_id, level, native_code[:80], text[:TEXT_LENGTH_MAX]))[-ALARMS_MAX:]


def text_of(alarms: tuple[Alarm, ...]) -> str:
    """Return what a person reads: faults first, "" where there is none."""
    active = sorted(
        (a for a in alarms if a.level != "UNAVAILABLE"), key=lambda a: (a.level != "FAULT", a.data_item_id, a.native_code)
    )
    return "; ".join(" ".join(filter(None, (a.level, a.native_code, a.text))) or a.level for a in active)


def all_unavailable(alarms: tuple[Alarm, ...], conditions: int) -> bool:
    """Return whether none of the device's conditions is known."""
    return conditions > 0 and sum(a.level == "UNAVAILABLE" for a in alarms) >= conditions
