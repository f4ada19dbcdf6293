"""The sites of the simulated machine: the fixed, short list of places that a signal passes through, in order.

The physics is written as plain functions in which `quantity = at(Site.FRICTION, value)` marks a place where something else may
come in. Called as it stands, `at` hands the value through, so each function is its own nominal model. When a kernel is made, the
marks are woven (`twin.kernels.weave`): an effect changes the value, a recording replaces it, a trace keeps it; a mark that
nothing uses leaves no trace in the kernel, so what is not there costs nothing.
"""

from enum import StrEnum


class Site(StrEnum):
    """In the order in which the simulation calls them."""

    PROGRAM = "program"
    REFERENCE = "reference"
    CONTROLLER = "controller"
    DRIVE_FORCE = "drive force"
    FRICTION = "friction"
    MECHANICS = "mechanics"
    PROCESS_FORCE = "process force"
    SPINDLE = "spindle"
    THERMAL = "thermal"
    SENSOR = "sensor"
    CLOCK = "clock"


def at(site: Site, value: float) -> float:
    """`value`, unchanged: the nominal machine.

    >>> at(Site.FRICTION, 380.0)
    380.0
    """
    return value
