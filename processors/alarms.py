"""The alarms there are: every output that a processor declares as one.

Finding them imports the processors (a fifth of a second), once. It is left until a configuration is checked or an engine is made:
while processors are being imported, some of those that read alarms among them, their alarms are not all known.
"""

import logging
from functools import cache

from processors.discovery import find, modules
from twin.vocabulary.twin_signals import SCORE_DRIFT

OF_A_MODEL = frozenset({SCORE_DRIFT})
"""Alarms that ask for a model to be trained again; nothing has happened on the machine."""
_log = logging.getLogger(__name__)


def alarm_signals() -> tuple[str, ...]:
    """Return the names of all outputs with `is_alarm`, in the order of the processors."""
    return _declared()[0]


@cache
def machine_alarms() -> tuple[str, ...]:
    """Return the alarms that tell of the machine: they pin its raw data, and stand in the records of its parts."""
    return tuple(name for name in alarm_signals() if name not in OF_A_MODEL)


def unknown_processors() -> tuple[str, ...]:
    """Return the processors that cannot be imported, so that their alarms are not known."""
    return _declared()[1]


@cache
def _declared() -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the alarms, and the processors that cannot be imported; one that is broken does not silence the others."""
    alarms: list[str] = []
    broken: list[str] = []
    for name in modules():
        try:
            alarms += (spec.name for spec in find(name).outputs if spec.is_alarm)
        except Exception as error:  # whatever its module does when it is imported
            _log.warning("processor %s cannot be imported, its alarms are not known: %s: %s", name, type(error).__name__, error)
            broken.append(name)
    return tuple(alarms), tuple(broken)
