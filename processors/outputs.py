"""The outputs there are: every metric that a processor declares, by name.

Finding them imports the processors, once. It is left until somebody asks, when all of them can be imported.
"""

import logging
from collections.abc import Mapping
from functools import cache

from processors.contract import PYTHON_TYPES, OutputSpec
from processors.discovery import find, modules
from twin.vocabulary.signals import Kind, canonical

_KINDS = {bool: Kind.FLAG, int: Kind.INTEGER, float: Kind.NUMBER, str: Kind.TEXT}
_log = logging.getLogger(__name__)


@cache
def declared_outputs() -> Mapping[str, OutputSpec]:
    """Return all outputs by name; those of a processor that cannot be imported are missing, and its log line says why."""
    found: dict[str, OutputSpec] = {}
    for name in modules():
        try:
            processor = find(name)
        except Exception:
            _log.exception("processor %s cannot be imported; its outputs are not known", name)
            continue
        found.update((output.name, output) for output in processor.outputs)
    return found


def kind_of(output: OutputSpec) -> Kind:
    """Return the kind of an output's values."""
    return _KINDS[PYTHON_TYPES[output.datatype][0]]


def kind_of_signal(name: str) -> Kind | None:
    """Return the kind of a signal's values, canonical or declared; None for a metric that neither is.

    >>> kind_of_signal("axis_x_pos_mm"), kind_of_signal("twin/anomaly_alarm"), kind_of_signal("coolant level")
    (<Kind.NUMBER: 'number'>, <Kind.FLAG: 'flag'>, None)
    """
    if (signal := canonical(name)) is not None:
        return signal.kind
    output = declared_outputs().get(name)
    return None if output is None else kind_of(output)
