"""Queries to VictoriaMetrics: metric = measurement_field, the tags are labels.

Prometheus forgets a series after five minutes without a sample; a signal that says when it changes may be silent for hours. So
the last value is looked for as far back as `hold_s`, and left out where it is bad now: a null is not drawn as the number before.
"""

from dashboard_source.board import RAW, Mark, Reading, Shown

BAD = 2
MACHINES = f"label_values({RAW}_value, machine)"
MACHINES_OF_METRICS = "label_values(twin_validation, machine)"


def _where(measurement: str, field: str, signal: str, *, many: bool = False, fleet: bool = False) -> str:
    machine = "" if fleet else 'machine="$machine",'
    return f'{measurement}_{field}{{{machine}signal{"=~" if many else "="}"{signal}"}}'


def _window(seconds: int) -> str:
    return f"{seconds // 86_400}d" if seconds % 86_400 == 0 else f"{seconds // 60}m"


def of_reading(reading: Reading) -> str:
    """The query of a series. Several nodes that tell one signal are one line: the largest."""
    labels = "machine, signal" if reading.many else "machine"
    values, qualities = (
        _where(reading.measurement, field, reading.signal, many=reading.many, fleet=reading.fleet)
        for field in ("value", "quality")
    )
    hold = _window(reading.hold_s)
    quality = f"max by ({labels}) (last_over_time({qualities}[{hold}]))"
    if reading.quality:
        return quality
    held = f"last_over_time({values}[{hold}])"
    if reading.shown is Shown.PEAK:
        held = f"max_over_time({values}[$__interval]) or {held}"
    return f"max by ({labels}) ({held}) unless on ({labels}) {quality} >= {BAD}"


def of_mark(mark: Mark) -> str:
    """The query of an annotation: a series with points only where something is to be marked."""
    values = _where(mark.measurement, "value", mark.signal)
    held = f"last_over_time({values}[{_window(mark.hold_s)}]"
    if mark.stretch:
        return f"max by (machine) (max_over_time({values}[$__interval]) or {held})) > 0"
    # Not changes(): told once, a new value is no change within the window to Prometheus, and the first of all is one here.
    return f"max by (machine) (abs({held}) - {held} offset $__interval))) > 0"


def legend(reading: Reading) -> str:
    """The legend, in Prometheus' form."""
    return reading.legend.replace("{}", f"{{{{{reading.told_apart_by}}}}}")
