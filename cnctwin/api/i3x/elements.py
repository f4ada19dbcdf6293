"""Element ids: readable, free of white space at their ends and of control characters, and one for each thing.

    plant    machine/<machine>    signal/<machine>/<metric>

A name of a machine is percent-encoded, so it is one level; in the name of a metric the slashes stay.
"""

from typing import NamedTuple
from urllib.parse import quote, unquote

PLANT_ID = "plant"
_MACHINE, _SIGNAL = "machine/", "signal/"


class Place(NamedTuple):
    """The thing that an element id names: a signal of a machine, a machine (signal ""), or the plant (machine "")."""

    machine: str = ""
    signal: str = ""


def machine_id(machine: str) -> str:
    """Return the element id of a machine.

    >>> machine_id("cell 4/mill")
    'machine/cell%204%2Fmill'
    """
    return _MACHINE + quote(machine, safe="")


def signal_id(machine: str, signal: str) -> str:
    """Return the element id of a signal.

    >>> signal_id("vmc", "twin/spindle_temp_c")
    'signal/vmc/twin/spindle_temp_c'
    """
    return f"{_SIGNAL}{quote(machine, safe='')}/{quote(signal, safe='/')}"


def place_of(element_id: str) -> Place | None:
    """Return what an element id names; None where it is not written as one of ours.

    >>> place_of("signal/vmc/twin/spindle_temp_c")
    Place(machine='vmc', signal='twin/spindle_temp_c')
    >>> place_of("machine/a/b"), place_of("machine/%61")
    (None, None)
    """
    if element_id == PLANT_ID:
        return Place()
    if element_id.startswith(_MACHINE):
        place = Place(unquote(element_id.removeprefix(_MACHINE)))
        return place if place.machine and machine_id(place.machine) == element_id else None
    machine, _, signal = element_id.removeprefix(_SIGNAL).partition("/")
    place = Place(unquote(machine), unquote(signal))
    is_ours = all(place) and element_id.startswith(_SIGNAL) and signal_id(*place) == element_id
    return place if is_ours else None
