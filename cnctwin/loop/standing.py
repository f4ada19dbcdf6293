"""The standing gap of a machine as the processor `gap` tells it on the broker: of the live description, and of the challenger.

Where no gap grows or stands open, a drift of the machine that `tool_wear` tells counts as one that grows: it is of the load
of the cut, which the gap has no live twin of.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime

from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary.twin_signals import (
    CHALLENGER_PREFIX,
    GAP_GROWING,
    GAP_GROWING_SIGNAL,
    GAP_OPEN,
    GAP_PREFIX,
    GAP_WINDOW,
    MACHINE_DRIFT,
    MACHINE_DRIFT_BASIS,
    TWIN_PREFIX,
    is_gap,
)

NONE = "none"
Span = tuple[int, int]
_MOMENT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:Z|[+-]\d\d:\d\d)")


@dataclass(frozen=True, slots=True)
class Standing:
    """The gap of a machine as it was heard.

    at_ms: the newest time of the machine, 0 before anything was heard; grows, opens: what stands there in words, empty = nothing
    window_ms: the stretch to diagnose; since_ms: when what grows or stands open began, as far as it is told
    live, challenger: gaps in floors by signal; challenger_at_ms: the time of the newest of the challenger's
    """

    at_ms: int = 0
    grows: str = ""
    opens: str = ""
    window_ms: Span | None = None
    since_ms: int | None = None
    live: Mapping[str, float] = field(default_factory=dict)
    challenger: Mapping[str, float] = field(default_factory=dict)
    challenger_at_ms: int = 0

    @property
    def is_open(self) -> bool:
        """True where something is to be diagnosed."""
        return bool(self.grows or self.opens)


def standing_of(readings: Iterable[Reading]) -> Standing:
    """Return what the readings of a machine's gap say; what is not good counts as not known.

    >>> reading = Reading("twin/gap_spindle_load_pct", 3.1, 1000, Quality.GOOD, None, None, False)
    >>> standing_of([reading]).live
    {'spindle_load_pct': 3.1}
    """
    told = {one.name: one for one in readings if one.quality is Quality.GOOD and one.value is not None and not one.is_historical}
    challenger = {name: one for name, one in told.items() if name.startswith(CHALLENGER_PREFIX)}
    growing = told.get(GAP_GROWING)
    grows = _text(told, GAP_GROWING_SIGNAL) if growing is not None and growing.value is True else ""
    opens = _text(told, GAP_OPEN)
    drifts = told.get(MACHINE_DRIFT)
    if not grows and not opens and drifts is not None and drifts.value is True:
        grows = _text(told, MACHINE_DRIFT_BASIS).partition("; to name the cause")[0] or "the load of all tools and programs"
    return Standing(
        at_ms=max((one.timestamp_ms for one in told.values()), default=0),
        grows=grows,
        opens=opens,
        window_ms=_span(_text(told, GAP_WINDOW)),
        since_ms=_since(grows or opens),
        live=_gaps(told.values(), TWIN_PREFIX),
        challenger=_gaps(challenger.values(), CHALLENGER_PREFIX),
        challenger_at_ms=max((one.timestamp_ms for one in challenger.values()), default=0),
    )


def _gaps(readings: Iterable[Reading], prefix: str) -> dict[str, float]:
    found = {}
    for one in readings:
        name = TWIN_PREFIX + one.name.removeprefix(prefix)
        if is_gap(name) and isinstance(one.value, int | float) and not isinstance(one.value, bool):
            found[name.removeprefix(GAP_PREFIX)] = float(one.value)
    return dict(sorted(found.items()))


def _text(told: Mapping[str, Reading], name: str) -> str:
    value = told[name].value if name in told else None
    return value if isinstance(value, str) and value != NONE else ""


def _since(text: str) -> int | None:
    """Return the earliest moment that a text names.

    >>> _since("spindle_temp_c in steady: twin minus measured has risen since 1970-01-01T00:00:01Z")
    1000
    """
    return min((_ms(moment) for moment in _MOMENT.findall(text)), default=None)


def _span(text: str) -> Span | None:
    moments = _MOMENT.findall(text)
    return (_ms(moments[0]), _ms(moments[1])) if len(moments) == 2 and _ms(moments[0]) < _ms(moments[1]) else None


def _ms(moment: str) -> int:
    return round(datetime.fromisoformat(moment).timestamp() * 1000)
