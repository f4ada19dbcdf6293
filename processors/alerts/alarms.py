"""The alarms there are: every output that a processor declares as one.

Finding them imports the other processors (a fifth of a second), once.
"""

from functools import cache

from processors.discovery import find, modules

OURSELVES = "alerts"


@cache
def alarm_signals() -> tuple[str, ...]:
    """Return the names of all outputs with `is_alarm`, in the order of the processors."""
    others = [find(name) for name in modules() if name != OURSELVES]
    return tuple(spec.name for processor in others for spec in processor.outputs if spec.is_alarm)
